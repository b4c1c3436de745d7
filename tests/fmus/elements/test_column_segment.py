"""The column segment against closed forms of its two parallel components."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.elements.column_segment import column_segment
from fmus.elements.element import OWN, PLASTIC


def segment_path(path, late=False):
    """Moments, energies, last tangents and memory; the segment is rows 1 and 2."""
    EI = 2.1e4
    element = column_segment(np.zeros((2, 1)), 3.4e4, -2.3e4, EI, 0.02 * EI, 50.0, late)
    p = np.tile(element.parameters, (3, 1))
    z0, z = np.zeros((2, 3, OWN + element.memory))
    force, tangent, coupling = np.zeros(3), np.zeros(3), np.zeros(3)
    d0, history, energy = np.zeros(3), [], np.zeros(2)
    for theta in path:
        d = np.array([0.0, *theta])
        stored, lost = element.law(1, d, d0, p, z0, z, force, tangent, coupling)
        energy += [0.0, lost]
        energy[0] = stored
        history.append(force[1:].copy())
        z0[:], d0 = z, d
    return np.array(history), energy, (tangent[1], coupling[1], tangent[2]), z


def test_segment_in_uniform_bending_is_bilinear_in_moment_and_curvature():
    """theta and -theta: both ends yield at once, dm = (k11 - k12) dtheta with r beyond My.

    Exact up to rounding: the events are found in closed form.
    """
    k, r, M_y = 3.4e4 + 2.3e4, 0.02, 50.0
    theta_y = M_y / k
    moments, _, _, z = segment_path([(4 * theta_y, -4 * theta_y), (0.0, 0.0)])
    top = M_y * (1.0 + 3.0 * r)
    assert moments[0] == pytest.approx([top, -top], rel=1e-12)
    # back by 4 theta_y: elastic over 2 theta_y, then yielding the other way
    back = top - 2.0 * M_y - 2.0 * r * M_y
    assert moments[1] == pytest.approx([back, -back], rel=1e-12)
    curvature = (1.0 / r - 1.0) / 2.1e4 * (3.0 * r - 2.0 * r) * M_y  # (3): its plastic part
    assert z[1, PLASTIC] == pytest.approx(curvature, rel=1e-9)


def test_segment_does_not_depend_on_how_a_straight_path_is_cut():
    """The path within a step is followed exactly, so 1 step or 57 give the same (1e-10)."""
    end = (6e-3, -1e-3)
    coarse = segment_path([end])
    fine = segment_path([(a * end[0], a * end[1]) for a in np.linspace(0, 1, 58)[1:]])
    assert fine[0][-1] == pytest.approx(coarse[0][-1], rel=1e-10)
    assert fine[1] == pytest.approx(coarse[1], rel=1e-10)


def test_segment_tangents_are_those_of_two_parallel_components():
    """No hinge: k; one: r k + (1 - r) (k11 - k12^2/k11) at the far end; both: r k."""
    k11, k12, r = 3.4e4, -2.3e4, 0.02
    assert segment_path([(2e-4, -3e-4)])[2] == (k11, k12, k11)
    far = r * k11 + (1 - r) * (k11 - k12**2 / k11)
    assert segment_path([(2e-3, 5e-4)])[2] == pytest.approx((r * k11, r * k12, far), rel=1e-12)
    assert segment_path([(5e-4, 2e-3)])[2] == pytest.approx((far, r * k12, r * k11), rel=1e-12)
    both = segment_path([(9e-3, -9e-3)])[2]
    assert both == pytest.approx((r * k11, r * k12, r * k11), rel=1e-12)


@pytest.mark.parametrize("steps", [40, 101, 333])
def test_late_events_overshoot_by_at_most_one_elastic_step(steps):
    """The step in which My is passed is taken with the elastic tangent; afterwards both run parallel."""
    k, r = 3.4e4 + 2.3e4, 0.02
    end = np.array([9e-3, -9e-3])
    exact = segment_path([end])[0][-1]
    late = segment_path([a * end for a in np.linspace(0, 1, steps + 1)[1:]], late=True)[0][-1]
    assert 0.0 < late[0] - exact[0] <= (1.0 - r) * k * 9e-3 / steps * (1.0 + 1e-9)
