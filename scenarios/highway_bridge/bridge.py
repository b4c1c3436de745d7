"""A reduced model of the 91/5 overcrossing (thesis, 3.6; data of the benchmark).

Two spans of 58.5 m along y, a bent of an outrigger 31.4 m long across (x) on two columns,
four bearings at each abutment, piles under the columns and soil behind the abutments as
springs and dashpots. The frame is built from the sections below: a few nodes per span, the
columns' lower part as segments with hinges. The ports are those of the full model
(benchmark.py): 16 bearings (x and y in turn), then the segments of both columns from top to
base, each bending in y and in x; y is the midspan in x and y, a the absolute acceleration
there and at the deck's two ends.

    C = alpha M + beta K_frame + dashpots;  bearings and soil springs do not contribute to K_frame
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cosim import Array
from fmus.elements.bilinear import bilinear
from fmus.elements.column_segment import column_segment
from fmus.elements.element import Element
from fmus.plants.nonlinear_structure import NonlinearStructure
from fmus.structures.frame import FREEDOMS, Frame, Section, chord_rotations, end_stiffness
from fmus.structures.structure import Structure

SPAN, DECK_MEMBERS = 58.52, 4  # m, members per span
DECK = Section(1.7424e11, 9.036e10, {"x": 1.474e11, "z": 1.5158e12}, {"x": 6.32e10, "z": 7.41e10})
DECK_MASS = 19008.0  # kg/m
DECK_INERTIA = (16080.0, 181440.0, 165360.0)  # kg m about x, y, z
OUTRIGGER = Section(2.146e11, 1.0517e11, {"y": 1.8318e11, "z": 1.6615e11}, {"y": 6.6e10, "z": 6.6e10})
OUTRIGGER_MASS = 23412.0  # kg/m
OUTRIGGER_INERTIA = (38110.0, 19983.0, 18126.0)  # kg m
ARMS = (13.41, 17.98)  # m, from the deck to the columns

SEGMENT = 0.732  # m
SHAFT, SEGMENTS = 5, 3  # the shaft is 5 segments long; the lower 3 have hinges
EI, EI1, M_Y = 2.091e10, 1.791e8, 5.0822e7  # elastic and plastic stiffness N*m^2, yield moment N*m
COLUMN = Section(1.0274e11, 2.727e10, {"x": EI, "y": EI}, {"x": 3.26554e10, "y": 3.26554e10})
FLARE = Section(1.21e11, 3.85e10, {"x": 4.84e10, "y": 5.94e10}, {"x": 4.364e10, "y": 4.374e10})
RIGID = Section(1.364e14, 4.714e13, {"x": 5.5e13, "y": 7.7e13}, {"x": 4.9e13, "y": 4.9e13})
COLUMN_MASS, FLARE_MASS = 11208.0, 13490.0  # kg/m
COLUMN_INERTIA, FLARE_INERTIA = (4164.0, 4164.0, 8328.0), (5460.0, 6960.0, 12420.0)  # kg m

PILES = {"ux": 4.943e8, "uy": 4.943e8, "uz": 1.4524e9, "rx": 3.174e10, "ry": 3.174e10, "rz": 2.092e10}
PILES_COUPLING = -8.146e8  # N, sway with rocking
PILES_DASHPOT = {"ux": 1.45e7, "uy": 1.45e7, "uz": 5.43e7}


class Abutment(NamedTuple):
    """Mass of an abutment, and the soil behind it: springs and dashpots."""

    mass: float  # kg
    inertia: float  # about z, kg*m^2
    k: float  # in x and y, N/m
    k_r: float  # about z, N*m/rad
    c_x: float  # N*s/m
    c_y: float  # N*s/m
    c_r: float  # about z, N*m*s/rad


ABUTMENTS = (
    Abutment(mass=4.96e5, inertia=3.943e6, k=4.12e8, k_r=5.685e9, c_x=4.0e7, c_y=3.2e7, c_r=4.691e8),
    Abutment(mass=5.972e5, inertia=6.882e6, k=4.12e8, k_r=8.041e9, c_x=4.0e7, c_y=3.2e7, c_r=6.724e8),
)
#: places (x, y) of the bearings from the deck's end, along the skewed abutment, m
BEARINGS = (
    ((-4.229, -2.442), (-1.676, -0.968), (1.676, 0.968), (4.229, 2.442)),
    ((-4.897, -3.254), (-1.760, -1.169), (1.760, 1.169), (4.897, 3.254)),
)


class Bearing(NamedTuple):
    """A bilinear bearing in one direction."""

    k1: float  # elastic stiffness, N/m
    k2: float  # stiffness beyond yield, N/m
    dy: float  # yield displacement, m


BEARING = Bearing(k1=4.8e6, k2=6.0e5, dy=0.015)
ALPHA, BETA = 0.4912, 0.005036  # 1/s, s


def highway_bridge(*, late_events: bool = False, bisections: int = 5) -> NonlinearStructure:
    """Return the reduced bridge; benchmark_bridge describes the arguments."""
    frame = Frame()
    _deck(frame)
    for side, arm in enumerate(ARMS):
        _column(frame, side, arm)
    for end in range(2):
        frame.node(f"abutment{end}", ("ux", "uy", "rz"))
        abutment = ABUTMENTS[end]
        frame.add_mass(f"abutment{end}", abutment.mass, (0.0, 0.0, abutment.inertia))
    M, K = frame.matrices()
    C = ALPHA * M + BETA * K
    _soil(frame, C, K)
    elements = [*_bearings(frame), *_segments(frame, late_events)]
    for element in elements[:16]:
        K += element.k0 * element.rows.T @ element.rows
    places = [f"deck{i}" for i in (0, -DECK_MEMBERS, DECK_MEMBERS)]
    at = np.array([frame.freedoms.row({(place, d): 1.0}) for place in places for d in ("ux", "uy")])
    actuators = np.vstack([e.rows for e in elements[:16]])
    structure = Structure(M, C, K, frame.freedoms.rigid_motion(("ux", "uy")), actuators, at[:2], at)
    return NonlinearStructure.build(structure, elements, bisections=bisections)


def _deck(frame: Frame) -> None:
    L = SPAN / DECK_MEMBERS
    names = [f"deck{i}" for i in range(-DECK_MEMBERS, DECK_MEMBERS + 1)]
    for name in names:
        frame.node(name, ("ux", "uy", "rx", "ry", "rz") if name in (names[0], names[-1]) else FREEDOMS)
    for first, second in pairwise(names):
        frame.connect(first, second, "y", L, DECK)
        _spread(frame, first, second, L, DECK_MASS, DECK_INERTIA)


def _spread(
    frame: Frame, first: str, second: str, L: float, mass: float, inertia: tuple[float, float, float]
) -> None:
    """Lump half of a member's mass at each of its ends."""
    for name in (first, second):
        frame.add_mass(
            name, 0.5 * L * mass, (0.5 * L * inertia[0], 0.5 * L * inertia[1], 0.5 * L * inertia[2])
        )


def _column(frame: Frame, side: int, arm: float) -> None:
    """Add arm of the outrigger, rigid joint, flared upper part, shaft with segments; column 0 is at -x."""
    cap, names = f"cap{side}", _column_nodes(side)
    for name in (cap, *names):
        frame.node(name)
    first, second = (cap, "deck0") if side == 0 else ("deck0", cap)
    frame.connect(first, second, "x", arm, OUTRIGGER)
    _spread(frame, first, second, arm, OUTRIGGER_MASS, OUTRIGGER_INERTIA)
    for part, (upper, lower) in zip(COLUMN_PARTS, pairwise((cap, *names)), strict=True):
        L = part.segments * SEGMENT
        frame.connect(lower, upper, "z", L, part.section)
        _spread(frame, lower, upper, L, part.mass, part.inertia)


class Part(NamedTuple):
    """A part of a column: its length in segments, its section, mass per metre and inertia."""

    segments: int
    section: Section
    mass: float
    inertia: tuple[float, float, float]


#: from the cap down: rigid joint, flare, elastic shaft, segments with hinges
COLUMN_PARTS = (
    Part(1, RIGID, FLARE_MASS, FLARE_INERTIA),
    Part(4, FLARE, FLARE_MASS, FLARE_INERTIA),
    Part(SHAFT - SEGMENTS, COLUMN, COLUMN_MASS, COLUMN_INERTIA),
    *(Part(1, COLUMN, COLUMN_MASS, COLUMN_INERTIA),) * SEGMENTS,
)


def _column_nodes(side: int) -> list[str]:
    return [f"column{side}_{i}" for i in range(SEGMENTS + 3)]


def _soil(frame: Frame, C: Array, K: Array) -> None:
    for side in range(2):
        base = _column_nodes(side)[-1]
        at = {f: frame.freedoms[base, f] for f in FREEDOMS}
        for freedom, k in PILES.items():
            K[at[freedom], at[freedom]] += k
            C[at[freedom], at[freedom]] += PILES_DASHPOT.get(freedom, 0.0)
        for translation, rotation, sign in (("ux", "ry", 1.0), ("uy", "rx", -1.0)):
            i, j = at[translation], at[rotation]
            K[i, j] += sign * PILES_COUPLING
            K[j, i] += sign * PILES_COUPLING
    for end, soil in enumerate(ABUTMENTS):
        for freedom, spring, dashpot in (
            ("ux", soil.k, soil.c_x),
            ("uy", soil.k, soil.c_y),
            ("rz", soil.k_r, soil.c_r),
        ):
            i = frame.freedoms[f"abutment{end}", freedom]
            K[i, i] += spring
            C[i, i] = dashpot


def _bearings(frame: Frame) -> list[Element]:
    """Return the bearings, x and y in turn: motion of the deck's end less that of the abutment."""
    elements = []
    for end, places in enumerate(BEARINGS):
        deck, abutment = f"deck{(2 * end - 1) * DECK_MEMBERS}", f"abutment{end}"
        for x, y in places:
            for translation, lever in (("ux", -y), ("uy", x)):
                row = {(deck, translation): 1.0, (deck, "rz"): lever}
                row |= {(abutment, translation): -1.0, (abutment, "rz"): -lever}
                elements.append(bilinear(frame.freedoms.row(row), *BEARING))
    return elements


def _segments(frame: Frame, late_events: bool) -> list[Element]:
    k11, k12 = end_stiffness(EI, COLUMN.GA["x"], SEGMENT)
    elements = []
    for side in range(2):
        names = _column_nodes(side)[-SEGMENTS - 1 :]
        for upper, below in pairwise(names):
            for direction in ("y", "x"):
                rows = frame.end_rows(below, upper, chord_rotations("z", direction, SEGMENT))[::-1]
                elements.append(column_segment(rows, k11, k12, EI, EI1, M_Y, late_events))
    return elements
