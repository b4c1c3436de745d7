"""What chapter 2 does not print, chosen here: weights, noise intensities, and the reduced model.

The thesis gives neither the weights of the Riccati equations nor S_ww and S_vv. They were
chosen so that tables 2.1 and 2.2 are met as closely as their orderings allow (see the
notes of `cosim table tall_building`). All controllers share one model and one observer.

    model      12 states by dominant modes: displacements and velocities of floors 16, 30, 46,
               60, 76 and of the damper (2.3); accelerations of floors 50, 76 and of the
               damper are measured (2.4)
    observer   S_ww = 1 on every floor, S_vv = S_VV (2.7): only the ratio matters
    weights    J = int q_a |a|^2 + q_x x_76^2 + q_v x_76'^2 + q_m x_m^2 + q_s x_m'^2
                       + (x_m' - c_x x_76 - c_v x_76' - c_m x_m)^2 + R u^2 dt
               a: accelerations of floors 46, 60, 76 without force, rows of A_r; the term
               in brackets (sliding surface only) asks the damper to follow the building

Found by least squares on the linear loop without noise: the logarithms of the printed
cells, dead band of 12 % on J1 to J4 and J7 to J10, and penalties on broken orderings.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controllers.design.reduction import dominant_modes
from controllers.design.state_space import StateSpace
from controllers.observers.observer import Observer
from cosim import Array
from fmus.structures.structure import Structure

from .building import Damper, with_damper

KEPT = (16, 30, 46, 60, 76)
MEASURED = (50, 76)
PERIOD = 0.001
"""T_s, s (2.4.3)."""


@dataclass(frozen=True)
class Weights:
    """q, c and R of the cost above; follow = (c_x, c_v, c_m)."""

    a: float
    x: float
    v: float
    m: float
    s: float
    R: float = 0.0
    follow: tuple[float, float, float] | None = None

    def matrix(self, model: StateSpace) -> Array:
        """Q (12, 12) for the states of `reduced_model`."""
        Q = np.diag([0, 0, 0, 0, self.x, self.m, 0, 0, 0, 0, self.v, self.s])
        floors = model.A[8:11]
        Q = Q + self.a * floors.T @ floors
        if self.follow is not None:
            row = np.zeros(12)
            row[4], row[10], row[5] = (-c for c in self.follow)
            row[11] = 1.0
            Q += np.outer(row, row)
        return np.asarray(Q)


LQG_WEIGHTS = Weights(a=3.346e-4, x=3.975e5, v=22.82, m=36.11, s=14.86, R=1.0e-12)
SURFACE_WEIGHTS = Weights(
    a=7.3942e-6, x=2.01638e4, v=1666.6, m=1.46965e-2, s=1.0, follow=(10.5278, 13.6654, -0.59863)
)
S_VV = 3.9067e-12
CONTINUOUS_RATE = 1.265
"""Rate of approach of the continuous sliding mode controller, 1/s; delta follows from it."""


def reduced_model(building: Structure, damper: Damper | None = None) -> StateSpace:
    """The 12-state model of building and damper at nominal stiffness; x_m is relative."""
    coupled = with_damper(building, damper)
    top = building.dof
    keep = [floor - 1 for floor in KEPT] + [top]
    measured = [floor - 1 for floor in MEASURED] + [top]
    force = np.zeros((top + 1, 1))
    force[top] = 1.0
    floors = np.eye(top + 1)[:, :top]
    return dominant_modes(coupled.M, coupled.C, coupled.K, force, floors, keep, measured)


def tower_observer(model: StateSpace, S_vv: float = S_VV, period: float = PERIOD) -> Observer:
    """The observer that all controllers share."""
    return Observer.design(model, np.eye(model.E.shape[1]), S_vv * np.eye(model.C.shape[0]), period)
