"""The control loop of chapter 2, and the choices that the thesis does not print.

All controllers share one model and one observer; the control laws stand in for each other.

    model      12 states by dominant modes: displacements and velocities of floors 16, 30, 46,
               60, 76 and of the damper (2.3); accelerations of floors 50, 76 and of the
               damper are measured (2.4)
    observer   S_ww = 1 on every floor, S_vv = S_VV (2.7): only the ratio matters
    weights    J = int q_a |a|^2 + q_x x_76^2 + q_v x_76'^2 + q_m x_m^2 + q_s x_m'^2
                       + (x_m' - c_x x_76 - c_v x_76' - c_m x_m)^2 + R u^2 dt
               a: accelerations of floors 46, 60, 76 without force, rows of A_r; the term
               in brackets (sliding surface only) makes the damper follow the building

The thesis prints neither the weights of the Riccati equations nor S_ww and S_vv. The values
below were fitted to the printed tables: least squares on the linear loop without noise, over
the logarithms of the printed cells, with a dead band of 12 % on J1 to J4 and J7 to J10 and
penalties on broken orderings. That script is lost; calibrate.py says which numbers were
fitted, and README.md how far the agreement with the print depends on them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from controllers.design.design_model import DesignModel
from controllers.design.reduction import dominant_modes
from controllers.laws.algorithm_1 import AlgorithmI
from controllers.laws.algorithm_2 import AlgorithmII
from controllers.laws.continuous_sliding_mode import ContinuousSlidingMode
from controllers.laws.equivalent_control import EquivalentControlGain
from controllers.laws.equivalent_force import design as equivalent_force
from controllers.laws.sliding_mode import SlidingMode
from controllers.laws.state_feedback import StateFeedback
from controllers.observers.observer import Observer
from cosim import Array, Block, System
from fmus.structures.structure import Structure

from .building import Damper, with_damper

Controller = Literal[
    "filtered-smc", "smc", "lqg", "continuous-smc", "passive", "none",
    "algorithm-1", "algorithm-2", "equivalent-control-gain",
]  # fmt: skip

KEPT = (16, 30, 46, 60, 76)
MEASURED = (50, 76)
PERIOD = 0.001
"""T_s, s (2.4.3)."""


@dataclass(frozen=True)
class Weights:
    """Weights q, c and R of the cost above; follow = (c_x, c_v, c_m)."""

    a: float
    x: float
    v: float
    m: float
    s: float
    R: float = 0.0
    follow: tuple[float, float, float] | None = None

    def matrix(self, model: DesignModel) -> Array:
        """Return Q (12, 12) for the states of `reduced_model`: six displacements, six velocities."""
        floor_46, floor_76, damper = KEPT.index(46), KEPT.index(76), len(KEPT)
        velocity = len(KEPT) + 1  # from a displacement to its velocity
        q = np.zeros(2 * velocity)
        q[floor_76], q[damper] = self.x, self.m
        q[floor_76 + velocity], q[damper + velocity] = self.v, self.s
        accelerations = model.A[floor_46 + velocity : floor_76 + velocity + 1]
        Q = np.diag(q) + self.a * accelerations.T @ accelerations
        if self.follow is not None:
            c_x, c_v, c_m = self.follow
            follow = np.zeros(2 * velocity)
            follow[damper + velocity] = 1.0
            follow[floor_76], follow[floor_76 + velocity], follow[damper] = -c_x, -c_v, -c_m
            Q += np.outer(follow, follow)
        return np.asarray(Q)


LQG_WEIGHTS = Weights(a=3.346e-4, x=3.975e5, v=22.82, m=36.11, s=14.86, R=1.0e-12)
SURFACE_WEIGHTS = Weights(
    a=7.3942e-6, x=2.01638e4, v=1666.6, m=1.46965e-2, s=1.0, follow=(10.5278, 13.6654, -0.59863)
)
S_VV = 3.9067e-12
CONTINUOUS_RATE = 1.265
"""Rate of approach of the continuous sliding mode controller, 1/s; delta follows from it."""


def reduced_model(building: Structure, damper: Damper | None = None) -> DesignModel:
    """Return the 12-state model of building and damper at nominal stiffness; x_m is relative."""
    coupled = with_damper(building, damper)
    top = building.dof
    keep = [floor - 1 for floor in KEPT] + [top]
    measured = [floor - 1 for floor in MEASURED] + [top]
    force = np.zeros((top + 1, 1))
    force[top] = 1.0
    floors = np.eye(top + 1)[:, :top]
    return dominant_modes(coupled.M, coupled.C, coupled.K, force, floors, keep, measured)


def tower_observer(model: DesignModel, S_vv: float = S_VV, period: float = PERIOD) -> Observer:
    """Return the observer that all controllers share."""
    return Observer.design(model, np.eye(model.E.shape[1]), S_vv * np.eye(model.C.shape[0]), period)


def add_controller(system: System, controller: Controller, model: DesignModel, a: float, delta: float) -> str:
    """Add the control law behind the observer; return the port of its force."""
    Q = SURFACE_WEIGHTS.matrix(model)
    law: Block
    if controller == "lqg":
        law = StateFeedback.lqr(model, LQG_WEIGHTS.matrix(model), np.array([[LQG_WEIGHTS.R]]))
    elif controller == "continuous-smc":
        law = ContinuousSlidingMode.design(model, Q, CONTINUOUS_RATE)
    elif controller in ("smc", "filtered-smc"):
        law = SlidingMode.design(model, Q, a, delta)
    else:
        surface, law = equivalent_force(model, Q)
        system.add("surface", surface)
        system.connect("observer.x_hat", "surface.x_hat")
        system.add("gain", _gain_law(controller))
        system.connect("surface.s", "gain.s")
    system.add("control", law)
    system.connect("observer.x_hat", "control.x_hat")
    if controller in ("algorithm-1", "algorithm-2", "equivalent-control-gain"):
        system.connect("gain.u", "control.switching")
    return "control.u"


def _gain_law(controller: Controller) -> Block:
    """Return a gain law of chapter 4; its M is a rate of s here, m/s^2, and a force in chapter 4."""
    if controller == "algorithm-1":
        return AlgorithmI(M=0.1, M_min=0.001, unit="m/s^2")
    if controller == "algorithm-2":
        return AlgorithmII(M=0.1, alpha=0.05, beta=0.5, M1=0.001, M2=0.3, unit="m/s^2")
    return EquivalentControlGain(M_0=0.1, tau=0.1, unit="m/s^2")
