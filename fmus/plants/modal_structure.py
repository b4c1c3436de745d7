"""A classically damped structure in its real modes.

    M x'' + C x' + K x = f                                          (1), the thesis' (2.1)
    eta_j'' + d_j eta_j' + w_j eta_j = phi_j' f,  x = sum phi_j eta_j               (2)

with w_j = omega_j^2 and d_j = 2 zeta_j omega_j. `advance` is exact for forces held over
the step, for under-, critically and overdamped modes: with s = d/2 and p = w - s^2, the
functions cos(sqrt(p) h) and sin(sqrt(p) h)/sqrt(p) continue to negative p as cosh and
sinh.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from cosim import Array, Continuous, Input, Local, Output, Parameter, State
from cosim.functions import transposed_matvec

from ..structures.structure import Structure, modes_of, require_freedoms


class ModalStructure(Continuous):
    """M x'' + C x' + K x = f in real modes; exact for held forces."""

    stiffness = Parameter(1.0, "factor on the stiffness", unit="1", min=0.01)
    omega2 = Parameter(shape="n", meaning="squared frequencies", unit="1/s^2", fixed=True)
    damping = Parameter(shape="n", meaning="2 zeta omega", unit="1/s", fixed=True)
    shapes = Parameter(shape=("n", "n"), meaning="mass-normalised modes, by column", fixed=True)
    shapes_out = Parameter(
        shape=("n", "f"), meaning="modes at the degrees of freedom with outputs, by row", fixed=True
    )

    w = Input("forces on the degrees of freedom", shape="n", unit="N")
    top = Input("further force on the last degree of freedom", unit="N")
    x = Output("displacements", shape="f", unit="m")
    v = Output("velocities", shape="f", unit="m/s")
    a = Output("accelerations", shape="f", unit="m/s^2")
    eta = State(shape="n", meaning="modal coordinates")
    eta_dot = State(shape="n", meaning="their derivatives")

    g = Local(shape="n", meaning="phi' w")
    hold_step = Local(0.0, "step that hold belongs to", unit="s")
    hold = Local(shape=(4, "n"), meaning="transition (2 x 2, by row) of each mode over the step")

    CACHE_KEYS = ("hold_step",)

    def derivatives(self, t: float) -> None:
        transposed_matvec(self.shapes, self.w, self.g)
        last = self.w.shape[0] - 1
        for j in range(last + 1):
            self.der_eta[j] = self.eta_dot[j]
            self.der_eta_dot[j] = (
                self.g[j]
                + self.shapes[last, j] * self.top
                - self.damping[j] * self.eta_dot[j]
                - self.stiffness * self.omega2[j] * self.eta[j]
            )

    def outputs(self, t: float) -> None:
        transposed_matvec(self.shapes_out, self.eta, self.x)
        transposed_matvec(self.shapes_out, self.eta_dot, self.v)
        transposed_matvec(self.shapes_out, self.der_eta_dot, self.a)

    def advance(self, t: float, h: float) -> None:
        if h != self.hold_step:
            for j in range(self.omega2.shape[0]):
                modal_hold(self.stiffness * self.omega2[j], self.damping[j], h, self.hold[:, j])
            self.hold_step = h
        transposed_matvec(self.shapes, self.w, self.g)
        last = self.w.shape[0] - 1
        for j in range(last + 1):
            static = (self.g[j] + self.shapes[last, j] * self.top) / (self.stiffness * self.omega2[j])
            away, speed = self.eta[j] - static, self.eta_dot[j]
            self.eta[j] = static + self.hold[0, j] * away + self.hold[1, j] * speed
            self.eta_dot[j] = self.hold[2, j] * away + self.hold[3, j] * speed

    @classmethod
    def build(cls, structure: Structure, floors: Sequence[int], stiffness: float = 1.0) -> ModalStructure:
        """Make the plant of a structure; floors: degrees of freedom with outputs, counted from 1."""
        require_freedoms("ModalStructure", floors, structure.dof)
        modes = modes_of(structure)
        rows = np.asarray(floors, int) - 1
        return cls(
            omega2=modes.omega**2, damping=modes.damping, shapes=modes.shapes,
            shapes_out=np.ascontiguousarray(modes.shapes[rows].T), stiffness=stiffness,
        )  # fmt: skip


def modal_hold(w: float, d: float, h: float, out: Array) -> None:
    """Write to `out` the transition of (eta - static, eta') over h under a constant force."""
    s = 0.5 * d
    p = w - s * s
    root = math.sqrt(abs(p))
    if p > 0.0:
        decay = math.exp(-s * h)
        even = decay * math.cos(root * h)
        odd = decay * (math.sin(root * h) / root)
    elif p < 0.0:
        # e^(-s h) cosh, sinh from the two real roots, without overflow of cosh
        slow = math.exp(-w / (s + root) * h)
        fast = math.exp(-(s + root) * h)
        even = 0.5 * (slow + fast)
        odd = 0.5 * (slow - fast) / root
    else:
        even = math.exp(-s * h)
        odd = even * h
    out[0] = even + s * odd
    out[1] = odd
    out[2] = -w * odd
    out[3] = even - s * odd
