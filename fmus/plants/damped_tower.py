"""A structure with an active tuned mass damper at its last degree of freedom, as one plant.

    M_c x'' + C_c x' + K_c x = [w; u],  x = [x_1 ... x_n, x_m]        (1), the thesis' (2.1), (2.19)

w are the forces on the structure; u is the force of the actuator between the last degree
of freedom and the damper, +u on the damper and -u on the structure. Everything runs in
the complex modes of the coupled system (kernels/coupled_modes.py), so a step with held
forces is exact:

    z_i' = lambda_i z_i + g_i,  g = phi' [w; u]                                           (2)
    z_i(t + h) = e^(lambda_i h) z_i + (e^(lambda_i h) - 1)/lambda_i g_i                   (3)
    x = sum phi_i z_i,  x' = sum phi_i z_i',  x'' = sum phi_i lambda_i z_i'               (4)

One mode of each complex pair is kept; the pair counts twice in (4), real parts only.
Real and imaginary parts are separate variables, with the suffixes _re and _im.

The modes are computed at initialisation, from the modes of the structure and the parameters
`stiffness`, m, c and k, which an exported FMU therefore has as parameters. phi' w is computed
again only when w has changed, so a load whose sample period is longer than the communication
step costs little.

Accelerations carry the force of the last step: at t_k they contain u held over
[t_{k-1}, t_k].
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from cosim import Array, Continuous, Input, Local, Output, Parameter, State

from ..kernels.coupled_modes import coupled_modes
from ..structures.structure import Structure, modes_of, require_freedoms


class DampedTower(Continuous):
    """Structure with one tuned mass damper at its last degree of freedom; exact for held forces."""

    stiffness = Parameter(1.0, "factor on the stiffness of the structure", unit="1", min=0.01)
    m = Parameter(1.0, "mass of the damper", unit="kg", min=1.0)
    c = Parameter(0.0, "damping of the damper", unit="N*s/m", min=0.0)
    k = Parameter(1.0, "stiffness of the damper", unit="N/m", min=1.0)
    omega2 = Parameter(shape="n", meaning="squared frequencies of the structure", unit="1/s^2", fixed=True)
    damping = Parameter(shape="n", meaning="2 zeta omega", unit="1/s", fixed=True)
    shapes = Parameter(shape=("n", "n"), meaning="mass-normalised modes, by column", fixed=True)
    floors = Parameter(shape="f", meaning="degrees of freedom with outputs, counted from 1", fixed=True)

    w = Input("forces on the degrees of freedom of the structure", shape="n", unit="N")
    u = Input("force of the actuator on the damper", unit="N")

    x = Output("displacements", shape="f", unit="m")
    v = Output("velocities", shape="f", unit="m/s")
    a = Output("accelerations", shape="f", unit="m/s^2")
    x_m = Output("stroke of the damper, relative to the top", unit="m")
    v_m = Output("velocity of the damper, relative", unit="m/s")
    a_m = Output("acceleration of the damper, relative", unit="m/s^2")

    z_re = State(shape="r", meaning="complex modal coordinates, real part")
    z_im = State(shape="r", meaning="complex modal coordinates, imaginary part")

    # sizes: n degrees of freedom, f of them with outputs, s = n + 1, q = f + 1, r = 2 n + 2 modes at most
    count = Local(0.0, "number of modes, one of each pair")
    stiffened = Local(shape="n", meaning="squared frequencies with the factor on the stiffness")
    top = Local(shape="n", meaning="modes of the structure at the damper")
    roots = Local(shape=("r", 2), meaning="lambda, real and imaginary part", unit="1/s")
    phi_re = Local(shape=("r", "s"), meaning="phi in modes of the structure and x_m, real part")
    phi_im = Local(shape=("r", "s"), meaning="its imaginary part")
    in_re = Local(shape=("s", "r"), meaning="phi by degree of freedom: effect of a force on z, real part")
    in_im = Local(shape=("s", "r"), meaning="its imaginary part")
    out_re = Local(shape=("r", "q"), meaning="phi of the outputs and x_m; pairs count twice, real part")
    out_im = Local(shape=("r", "q"), meaning="its imaginary part")
    sums = Local(shape=(3, "q"), meaning="(4): displacements, velocities, accelerations")
    w_seen = Local(shape="n", meaning="forces that g_w belongs to", unit="N")
    g_w = Local(shape=(2, "r"), meaning="phi' w, real and imaginary part")
    hold_step = Local(0.0, "step that hold belongs to", unit="s")
    hold = Local(shape=(4, "r"), meaning="e^(lambda h) and its integral over h, real and imaginary part")

    CACHE_KEYS = ("hold_step",)

    def initialize(self) -> None:
        n = self.omega2.shape[0]
        for j in range(n):
            self.stiffened[j] = self.stiffness * self.omega2[j]
            self.top[j] = self.shapes[n - 1, j]
        count = coupled_modes(
            self.stiffened, self.damping, self.top, self.m, self.c, self.k,
            self.roots, self.phi_re, self.phi_im,
        )  # fmt: skip
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
            weight = 2.0 if self.roots[i, 1] > 0.0 else 1.0
            for f in range(self.floors.shape[0] + 1):
                dof = n if f == self.floors.shape[0] else int(self.floors[f]) - 1
                self.out_re[i, f] = weight * self.in_re[dof, i]
                self.out_im[i, f] = weight * self.in_im[dof, i]
        for j in range(n):
            self.w_seen[j] = math.nan

    def derivatives(self, t: float) -> None:
        count = mode_count(self.count, self.roots)
        project_forces(self.w, self.w_seen, self.in_re, self.in_im, count, self.g_w)
        n = self.w.shape[0]
        for i in range(count):  # (2)
            root_re, root_im = self.roots[i, 0], self.roots[i, 1]
            self.der_z_re[i] = (
                root_re * self.z_re[i] - root_im * self.z_im[i] + self.g_w[0, i] + self.in_re[n, i] * self.u
            )
            self.der_z_im[i] = (
                root_im * self.z_re[i] + root_re * self.z_im[i] + self.g_w[1, i] + self.in_im[n, i] * self.u
            )

    def outputs(self, t: float) -> None:
        last = self.out_re.shape[1] - 1
        for f in range(last + 1):
            self.sums[0, f], self.sums[1, f], self.sums[2, f] = 0.0, 0.0, 0.0
        # (4), two modes per pass, which halves the loads and stores of the sums; the coefficients after
        # the last mode are zero
        for i in range(0, mode_count(self.count, self.roots), 2):
            root1_re, root1_im = self.roots[i, 0], self.roots[i, 1]
            root2_re, root2_im = self.roots[i + 1, 0], self.roots[i + 1, 1]
            z1_re, z1_im, z2_re, z2_im = self.z_re[i], self.z_im[i], self.z_re[i + 1], self.z_im[i + 1]
            dz1_re, dz1_im = self.der_z_re[i], self.der_z_im[i]
            dz2_re, dz2_im = self.der_z_re[i + 1], self.der_z_im[i + 1]
            ddz1_re, ddz1_im = root1_re * dz1_re - root1_im * dz1_im, root1_im * dz1_re + root1_re * dz1_im
            ddz2_re, ddz2_im = root2_re * dz2_re - root2_im * dz2_im, root2_im * dz2_re + root2_re * dz2_im
            for f in range(last + 1):
                phi1_re, phi1_im = self.out_re[i, f], self.out_im[i, f]
                phi2_re, phi2_im = self.out_re[i + 1, f], self.out_im[i + 1, f]
                self.sums[0, f] += phi1_re * z1_re - phi1_im * z1_im + phi2_re * z2_re - phi2_im * z2_im
                self.sums[1, f] += phi1_re * dz1_re - phi1_im * dz1_im + phi2_re * dz2_re - phi2_im * dz2_im
                self.sums[2, f] += (
                    phi1_re * ddz1_re - phi1_im * ddz1_im + phi2_re * ddz2_re - phi2_im * ddz2_im
                )
        for f in range(last):
            self.x[f], self.v[f], self.a[f] = self.sums[0, f], self.sums[1, f], self.sums[2, f]
        self.x_m, self.v_m, self.a_m = self.sums[0, last], self.sums[1, last], self.sums[2, last]

    def advance(self, t: float, h: float) -> None:
        count = mode_count(self.count, self.roots)
        if h != self.hold_step:
            hold_factors(self.roots, count, h, self.hold)
            self.hold_step = h
        project_forces(self.w, self.w_seen, self.in_re, self.in_im, count, self.g_w)
        n = self.w.shape[0]
        for i in range(count):  # (3)
            g_re = self.g_w[0, i] + self.in_re[n, i] * self.u
            g_im = self.g_w[1, i] + self.in_im[n, i] * self.u
            exp_re, exp_im = self.hold[0, i], self.hold[1, i]
            integral_re, integral_im = self.hold[2, i], self.hold[3, i]
            z_re, z_im = self.z_re[i], self.z_im[i]
            self.z_re[i] = exp_re * z_re - exp_im * z_im + integral_re * g_re - integral_im * g_im
            self.z_im[i] = exp_im * z_re + exp_re * z_im + integral_im * g_re + integral_re * g_im

    @classmethod
    def build(
        cls,
        structure: Structure,
        floors: Sequence[int],
        *,
        m: float,
        c: float,
        k: float,
        stiffness: float = 1.0,
    ) -> DampedTower:
        """Make the plant of a structure (without its damper) and of a damper m, c, k.

        floors: degrees of freedom with outputs, counted from 1.
        """
        n = structure.dof
        require_freedoms("DampedTower", floors, n)
        modes = modes_of(structure)
        return cls(
            omega2=modes.omega**2, damping=modes.damping, shapes=modes.shapes,
            floors=np.asarray(floors, float), stiffness=stiffness, m=m, c=c, k=k,
            r=2 * n + 2, s=n + 1, q=len(floors) + 1,
        )  # fmt: skip


def mode_count(count: float, roots: Array) -> int:
    """Return the number of modes; a restored state cannot make it exceed the arrays."""
    most: int = roots.shape[0]
    return min(max(int(count), 0), most)


def project_forces(w: Array, seen: Array, in_re: Array, in_im: Array, count: int, g: Array) -> None:
    """Write g = phi' w, unless w has not changed since the last call."""
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
    for j in range(0, n - 3, 4):  # four forces per pass: a quarter of the loads and stores of g
        w0, w1, w2, w3 = w[j], w[j + 1], w[j + 2], w[j + 3]
        for i in range(count):
            g[0, i] += in_re[j, i] * w0 + in_re[j + 1, i] * w1 + in_re[j + 2, i] * w2 + in_re[j + 3, i] * w3
        for i in range(count):
            g[1, i] += in_im[j, i] * w0 + in_im[j + 1, i] * w1 + in_im[j + 2, i] * w2 + in_im[j + 3, i] * w3
    for j in range(n - n % 4, n):
        for i in range(count):
            g[0, i] += in_re[j, i] * w[j]
            g[1, i] += in_im[j, i] * w[j]
    for j in range(n):
        seen[j] = w[j]


def hold_factors(roots: Array, count: int, h: float, hold: Array) -> None:
    """Write real and imaginary part of e^(lambda h), then of (e^(lambda h) - 1)/lambda, to `hold`."""
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
