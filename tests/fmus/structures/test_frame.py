"""Frames against closed forms of beam theory: Timoshenko's cantilever, and a corner that bends and twists."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.structures.frame import AXES, Frame, Section

# six stiffnesses that differ, and members short enough for shear to take a third of the deflection
SECTION = Section(
    EA=7.0e5, GJ=3.0e4, EI={"x": 5.0e4, "y": 8.0e4, "z": 2.0e4}, GA={"x": 6.0e4, "y": 4.0e4, "z": 9.0e4}
)
P = 1.7e3  # N
PAIRS = [(axis, direction) for axis in AXES for direction in AXES if axis != direction]


def deflected(frame: Frame, node: str, direction: str) -> dict[str, float]:
    """Return the motion of a node under a force P on it, by freedom."""
    force = P * frame.freedoms.row({(node, f"u{direction}"): 1.0})
    motion = np.linalg.solve(frame.matrices()[1], force)
    return {f: float(motion[i]) for (n, f), i in frame.freedoms.items() if n == node}


@pytest.mark.parametrize(("axis", "direction"), PAIRS)
def test_a_cantilever_is_timoshenkos(axis: str, direction: str) -> None:
    """Tip: P L^3 / 3 EI + P L / GA, and a rotation of P L^2 / 2 EI about axis x direction.

    The element is exact, also in a series of several: the solver leaves 1e-9.
    """
    L, members = 2.4, 3
    frame = Frame()
    frame.node("0", ())
    for i in range(members):
        frame.node(str(i + 1))
        frame.connect(str(i), str(i + 1), axis, L / members, SECTION)
    unit = np.eye(3)
    turn = np.cross(unit[AXES.index(axis)], unit[AXES.index(direction)])  # right-handed
    about = AXES[int(np.abs(turn).argmax())]
    EI, GA = SECTION.EI[about], SECTION.GA[direction]
    tip = deflected(frame, str(members), direction)
    assert tip[f"u{direction}"] == pytest.approx(P * L**3 / (3.0 * EI) + P * L / GA, rel=1e-9)
    assert tip[f"r{about}"] == pytest.approx(turn.sum() * P * L**2 / (2.0 * EI), rel=1e-9)


@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_a_corner_bends_and_twists(first: str, second: str) -> None:
    """Two members at a right angle, loaded across their plane: bending of both, and torsion of the first.

    The torque P b twists the first member by P b a / GJ, which lifts the tip by that angle times b.
    """
    a, b = 1.6, 0.9
    across = next(axis for axis in AXES if axis not in (first, second))
    frame = Frame()
    frame.node("root", ())
    frame.node("corner")
    frame.node("tip")
    frame.connect("root", "corner", first, a, SECTION)
    frame.connect("corner", "tip", second, b, SECTION)
    # a member along `first` that bends towards `across` turns about `second`, and conversely
    bending = a**3 / (3.0 * SECTION.EI[second]) + b**3 / (3.0 * SECTION.EI[first])
    shear = (a + b) / SECTION.GA[across]
    tip = deflected(frame, "tip", across)
    assert tip[f"u{across}"] == pytest.approx(P * (bending + shear + a * b**2 / SECTION.GJ), rel=1e-9)


def test_a_turned_member_is_free_of_force() -> None:
    """A rigid rotation of 1 about each axis moves a point at L by r x L, and costs no force."""
    for axis in AXES:
        frame = Frame()
        frame.node("0")
        frame.node("1")
        L = np.zeros(3)
        L[AXES.index(axis)] = 1.3
        frame.connect("0", "1", axis, 1.3, SECTION)
        K = frame.matrices()[1]
        for i, rotation in enumerate(np.eye(3)):
            moved = dict(zip(AXES, np.cross(rotation, L), strict=True))
            weights = {(node, f"r{AXES[i]}"): 1.0 for node in "01"}
            weights |= {("1", f"u{d}"): float(x) for d, x in moved.items()}
            assert np.abs(K @ frame.freedoms.row(weights)).max() < 1e-9 * np.abs(K).max()
