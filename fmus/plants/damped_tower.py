"""A tower with an active tuned mass damper at its top as one plant (thesis.txt, 2.4.2).

    M_c x'' + C_c x' + K_c x = [w; u],  x = [x_1 ... x_n, x_m]           (2.1), (2.19)

w are the forces on the floors; u is the force of the actuator between top floor and
damper, +u on the damper and -u on the floor. Everything runs in the complex modes of
the coupled system (coupled_modes.py), so a step with held forces is exact:

    z_i' = lambda_i z_i + g_i,  g = phi' [w; u]
    z_i(t + h) = e^(lambda_i h) z_i + (e^(lambda_i h) - 1)/lambda_i g_i
    x = sum phi_i z_i,  x' = sum phi_i z_i',  x'' = sum phi_i lambda_i z_i'

The modes are computed when the plant is initialised, from the modes of the structure
alone and the parameters `stiffness`, m, c, k as they are then. phi' w is computed
again only when w has changed, so a load that is sampled more coarsely than the
communication step costs little.

Accelerations carry the force of the last step: at t_k they answer to u held over
[t_{k-1}, t_k].
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from cosim import Array, Continuous, Input, Local, Output, Parameter, State
from scenarios.tall_building.building import Damper, Structure, StructureError, modes_of

from ..kernels.coupled_modes import coupled_modes


class DampedTower(Continuous):
    """Structure with one tuned mass damper at its last DOF; exact for held forces."""

    stiffness = Parameter(1.0, "factor on the stiffness of the structure", unit="1", min=0.01)
    m = Parameter(500.0e3, "mass of the damper", unit="kg", min=1.0)
    c = Parameter(201.0e3, "damping of the damper", unit="N*s/m", min=0.0)
    k = Parameter(505.1e3, "stiffness of the damper", unit="N/m", min=1.0)
    omega2 = Parameter(shape="n", meaning="squared frequencies of the structure", unit="1/s^2", fixed=True)
    damping = Parameter(shape="n", meaning="2 zeta omega", unit="1/s", fixed=True)
    shapes = Parameter(shape=("n", "n"), meaning="mass-normalised modes, by column", fixed=True)
    floors = Parameter(shape="f", meaning="DOF with outputs, counted from 1", fixed=True)

    w = Input("forces on the DOF of the structure", shape="n", unit="N")
    u = Input("force of the actuator on the damper", unit="N")

    x = Output("displacements", shape="f", unit="m")
    v = Output("velocities", shape="f", unit="m/s")
    a = Output("accelerations", shape="f", unit="m/s^2")
    x_m = Output("stroke of the damper, relative to the top", unit="m")
    v_m = Output("velocity of the damper, relative", unit="m/s")
    a_m = Output("acceleration of the damper, relative", unit="m/s^2")

    z_re = State(shape="r", meaning="complex modal coordinates, real part")
    z_im = State(shape="r", meaning="complex modal coordinates, imaginary part")

    if TYPE_CHECKING:
        der_z_re: Array
        der_z_im: Array

    count = Local(0.0, "number of eigenvalues, one of each pair")
    stiffened = Local(shape="n", meaning="squared frequencies with the factor on the stiffness")
    top = Local(shape="n", meaning="modes at the damper")
    roots = Local(shape=("r", 2), meaning="eigenvalues, real and imaginary part", unit="1/s")
    phi_re = Local(shape=("r", "s"), meaning="eigenvectors in modes of the structure and x_m")
    phi_im = Local(shape=("r", "s"), meaning="their imaginary part")
    in_re = Local(shape=("s", "r"), meaning="phi', by DOF: what a force does to z")
    in_im = Local(shape=("s", "r"), meaning="its imaginary part")
    out_re = Local(shape=("r", "q"), meaning="phi of the floors with outputs and x_m; pairs count twice")
    out_im = Local(shape=("r", "q"), meaning="its imaginary part")
    sums = Local(shape=(3, "q"), meaning="displacements, velocities, accelerations")
    w_seen = Local(shape="n", meaning="forces that g_w belongs to", unit="N")
    g_w = Local(shape=(2, "r"), meaning="phi' w")
    hold_step = Local(0.0, "step that hold belongs to", unit="s")
    hold = Local(shape=(4, "r"), meaning="e^(lambda h) and its integral")

    def initialize(self) -> None:
        n = self.omega2.shape[0]
        for j in range(n):
            self.stiffened[j] = self.stiffness * self.omega2[j]
            self.top[j] = self.shapes[n - 1, j]
        count = coupled_modes(
            self.stiffened,
            self.damping,
            self.top,
            self.m,
            self.c,
            self.k,
            self.roots,
            self.phi_re,
            self.phi_im,
        )
        self.count = float(count)
        self.hold_step = 0.0
        for i in range(count, self.roots.shape[0]):
            for f in range(self.floors.shape[0] + 1):
                self.out_re[i, f], self.out_im[i, f] = 0.0, 0.0
        for i in range(count):
            for dof in range(n):
                re, im = 0.0, 0.0
                for j in range(n):
                    re += self.shapes[dof, j] * self.phi_re[i, j]
                    im += self.shapes[dof, j] * self.phi_im[i, j]
                self.in_re[dof, i], self.in_im[dof, i] = re, im
            self.in_re[n, i], self.in_im[n, i] = self.phi_re[i, n], self.phi_im[i, n]
            members = 2.0 if self.roots[i, 1] > 0.0 else 1.0
            for f in range(self.floors.shape[0] + 1):
                dof = n if f == self.floors.shape[0] else int(self.floors[f]) - 1
                self.out_re[i, f] = members * self.in_re[dof, i]
                self.out_im[i, f] = members * self.in_im[dof, i]
        for j in range(n):
            self.w_seen[j] = math.nan

    def derivatives(self, t: float) -> None:
        project_forces(self.w, self.w_seen, self.in_re, self.in_im, int(self.count), self.g_w)
        n = self.w.shape[0]
        for i in range(int(self.count)):
            re, im = self.roots[i, 0], self.roots[i, 1]
            self.der_z_re[i] = (
                re * self.z_re[i] - im * self.z_im[i] + self.g_w[0, i] + self.in_re[n, i] * self.u
            )
            self.der_z_im[i] = (
                im * self.z_re[i] + re * self.z_im[i] + self.g_w[1, i] + self.in_im[n, i] * self.u
            )

    def outputs(self, t: float) -> None:
        last = self.out_re.shape[1] - 1
        for f in range(last + 1):
            self.sums[0, f], self.sums[1, f], self.sums[2, f] = 0.0, 0.0, 0.0
        for i in range(0, int(self.count), 2):  # two modes a pass; behind the last one all is zero
            p_re, p_im = self.roots[i, 0], self.roots[i, 1]
            q_re, q_im = self.roots[i + 1, 0], self.roots[i + 1, 1]
            x_re, x_im, y_re, y_im = self.z_re[i], self.z_im[i], self.z_re[i + 1], self.z_im[i + 1]
            v_re, v_im, w_re, w_im = (
                self.der_z_re[i],
                self.der_z_im[i],
                self.der_z_re[i + 1],
                self.der_z_im[i + 1],
            )
            a_re, a_im = p_re * v_re - p_im * v_im, p_im * v_re + p_re * v_im
            b_re, b_im = q_re * w_re - q_im * w_im, q_im * w_re + q_re * w_im
            for f in range(last + 1):
                o_re, o_im = self.out_re[i, f], self.out_im[i, f]
                s_re, s_im = self.out_re[i + 1, f], self.out_im[i + 1, f]
                self.sums[0, f] += o_re * x_re - o_im * x_im + s_re * y_re - s_im * y_im
                self.sums[1, f] += o_re * v_re - o_im * v_im + s_re * w_re - s_im * w_im
                self.sums[2, f] += o_re * a_re - o_im * a_im + s_re * b_re - s_im * b_im
        for f in range(last):
            self.x[f], self.v[f], self.a[f] = self.sums[0, f], self.sums[1, f], self.sums[2, f]
        self.x_m, self.v_m, self.a_m = self.sums[0, last], self.sums[1, last], self.sums[2, last]

    def advance(self, t: float, h: float) -> None:
        if h != self.hold_step:
            hold_factors(self.roots, int(self.count), h, self.hold)
            self.hold_step = h
        project_forces(self.w, self.w_seen, self.in_re, self.in_im, int(self.count), self.g_w)
        n = self.w.shape[0]
        for i in range(int(self.count)):
            g_re = self.g_w[0, i] + self.in_re[n, i] * self.u
            g_im = self.g_w[1, i] + self.in_im[n, i] * self.u
            e_re, e_im, p_re, p_im = self.hold[0, i], self.hold[1, i], self.hold[2, i], self.hold[3, i]
            z_re, z_im = self.z_re[i], self.z_im[i]
            self.z_re[i] = e_re * z_re - e_im * z_im + p_re * g_re - p_im * g_im
            self.z_im[i] = e_im * z_re + e_re * z_im + p_im * g_re + p_re * g_im

    @classmethod
    def of(
        cls,
        structure: Structure,
        floors: Sequence[int],
        damper: Damper | None = None,
        stiffness: float = 1.0,
    ) -> DampedTower:
        """Make the plant of a structure (without damper); floors: DOF with outputs, from 1."""
        damper = damper or Damper()
        n = structure.dof
        outside = [f for f in floors if not 1 <= f <= n]
        if outside or not len(floors):
            raise StructureError(f"DampedTower: floors {list(floors)} must be some of 1..{n}")
        modes = modes_of(structure)
        return cls(
            omega2=modes.omega**2, damping=modes.damping, shapes=modes.shapes,
            floors=np.asarray(floors, float), stiffness=stiffness,
            m=damper.m, c=damper.c, k=damper.k, r=2 * n + 2, s=n + 1, q=len(floors) + 1,
        )  # fmt: skip


def project_forces(w: Array, seen: Array, in_re: Array, in_im: Array, count: int, g: Array) -> None:
    """g = phi' w, if w is not the w of the last time."""
    n = w.shape[0]
    same = True
    for j in range(n):
        if w[j] != seen[j]:
            same = False
            break
    if same:
        return
    for i in range(count):
        g[0, i], g[1, i] = 0.0, 0.0
    for j in range(0, n - 3, 4):  # four forces a pass, so that g is not loaded and stored for each
        a, b, c, d = w[j], w[j + 1], w[j + 2], w[j + 3]
        for i in range(count):
            g[0, i] += in_re[j, i] * a + in_re[j + 1, i] * b + in_re[j + 2, i] * c + in_re[j + 3, i] * d
        for i in range(count):
            g[1, i] += in_im[j, i] * a + in_im[j + 1, i] * b + in_im[j + 2, i] * c + in_im[j + 3, i] * d
    for j in range(n - n % 4, n):
        for i in range(count):
            g[0, i] += in_re[j, i] * w[j]
            g[1, i] += in_im[j, i] * w[j]
    for j in range(n):
        seen[j] = w[j]


def hold_factors(roots: Array, count: int, h: float, hold: Array) -> None:
    """hold = real and imaginary part of e^(lambda h), then of (e^(lambda h) - 1)/lambda."""
    for i in range(count):
        re, im = roots[i, 0] * h, roots[i, 1] * h
        size = math.exp(re)
        sine = math.sin(0.5 * im)
        hold[0, i], hold[1, i] = size * math.cos(im), size * math.sin(im)
        minus_re = math.expm1(re) * math.cos(im) - 2.0 * sine * sine
        minus_im = hold[1, i]
        square = roots[i, 0] * roots[i, 0] + roots[i, 1] * roots[i, 1]
        hold[2, i] = (minus_re * roots[i, 0] + minus_im * roots[i, 1]) / square
        hold[3, i] = (minus_im * roots[i, 0] - minus_re * roots[i, 1]) / square
