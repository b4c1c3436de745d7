"""An n-story shear building under ground acceleration and forces on its floors.

    M x'' + C x' + K x = f - M 1 a_g

    story shear        q_i = k_i (x_i - x_{i-1}),   x_0 = 0
    equation of floor  m_i x''_i = f_i - (C x')_i - q_i + q_{i+1} - m_i a_g

x is relative to the ground. Outputs: accelerations relative (x'') and absolute (x'' + a_g),
drifts x_i - x_{i-1}, base shear q_1. The step is exact for inputs held over it
(LinearContinuous). Masses and stiffnesses may be set before a run; the damping matrix follows
from their values at construction and does not change with them:

    ShearBuilding.build(m, k, ratio)                      modal damping, one ratio for all modes or one each
    ShearBuilding.build(m, k, ratio, rayleigh=(1, 2))     C = a M + b K, `ratio` at two modes
"""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import eigh

from cosim import Array, DeclarationError, Input, LinearContinuous, Output, Parameter, State


class ShearBuilding(LinearContinuous):
    """M x'' + C x' + K x = f - M 1 a_g for n stories"""

    m = Parameter(1.0, "mass of each floor", shape="n", unit="kg", min=1e-12)
    k = Parameter(1.0, "stiffness of each story", shape="n", unit="N/m", min=0.0)
    C = Parameter(0.0, "damping matrix", shape=("n", "n"), unit="N*s/m", fixed=True)
    ground_acceleration = Input("acceleration of the ground", unit="m/s^2")
    force = Input("force on each floor", shape="n", unit="N")
    x = State(0.0, "displacement of each floor, relative to the ground", shape="n", unit="m")
    v = State(0.0, "velocity of each floor, relative to the ground", shape="n", unit="m/s")
    acceleration = Output("absolute acceleration of each floor", shape="n", unit="m/s^2")
    relative_acceleration = Output("acceleration relative to the ground", shape="n", unit="m/s^2")
    drift = Output("drift of each story", shape="n", unit="m")
    base_shear = Output("shear force in the columns of the first story", unit="N")

    def derivatives(self, t: float) -> None:
        n = self.x.shape[0]
        for i in range(n):
            self.der_x[i] = self.v[i]
            below = self.x[i - 1] if i > 0 else 0.0
            total = self.force[i] - self.k[i] * (self.x[i] - below)
            if i + 1 < n:
                total += self.k[i + 1] * (self.x[i + 1] - self.x[i])
            for j in range(n):
                total -= self.C[i, j] * self.v[j]
            self.der_v[i] = total / self.m[i] - self.ground_acceleration

    def outputs(self, t: float) -> None:
        for i in range(self.x.shape[0]):
            self.relative_acceleration[i] = self.der_v[i]
            self.acceleration[i] = self.der_v[i] + self.ground_acceleration
            self.drift[i] = self.x[i] - (self.x[i - 1] if i > 0 else 0.0)
        self.base_shear = self.k[0] * self.drift[0]

    @classmethod
    def build(
        cls, m: ArrayLike, k: ArrayLike, ratio: ArrayLike, *, rayleigh: tuple[int, int] | None = None
    ) -> Self:
        """Make the building of floors m and stories k with damping ratios.

        Without `rayleigh`, C = M Phi diag(2 zeta_i omega_i) Phi' M, with Phi' M Phi = 1 and one
        ratio or one for each mode. With two modes, counted from 1, C = a M + b K with
        a/(2 omega) + b omega/2 = ratio at both.
        """
        masses, stiffness, omega, modes = _modes(m, k)
        if rayleigh is None:
            zeta = np.broadcast_to(np.asarray(ratio, dtype=float), omega.shape)
            scaled = np.diag(masses) @ modes
            return cls(m=masses, k=stiffness, C=(scaled * (2.0 * zeta * omega)) @ scaled.T)
        if not 1 <= min(rayleigh) < max(rayleigh) <= omega.size or np.ndim(ratio):
            raise DeclarationError(
                f"ShearBuilding: Rayleigh damping takes one ratio and two modes of 1 to {omega.size}, "
                f"not ratio {ratio!r} at modes {rayleigh}"
            )
        zeta = np.asarray(ratio, dtype=float)
        first, second = omega[rayleigh[0] - 1], omega[rayleigh[1] - 1]
        a, b = 2.0 * zeta * first * second / (first + second), 2.0 * zeta / (first + second)
        return cls(m=masses, k=stiffness, C=a * np.diag(masses) + b * stiffness_matrix(stiffness))


def stiffness_matrix(k: Array) -> Array:
    """Return K of stories with stiffness k, the first between ground and first floor."""
    above = np.append(k[1:], 0.0)
    return np.diag(k + above) - np.diag(k[1:], 1) - np.diag(k[1:], -1)


def _modes(m: ArrayLike, k: ArrayLike) -> tuple[Array, Array, Array, Array]:
    """Return masses, stiffnesses, frequencies in rad/s (ascending) and modes with Phi' M Phi = 1."""
    masses, stiffness = np.atleast_1d(np.asarray(m, float)), np.atleast_1d(np.asarray(k, float))
    if masses.shape != stiffness.shape or masses.ndim != 1:
        raise DeclarationError(
            f"ShearBuilding: {masses.size} masses and {stiffness.size} stiffnesses; give one per story"
        )
    if not ((masses > 0.0).all() and (stiffness > 0.0).all()):
        raise DeclarationError("ShearBuilding: masses and stiffnesses must be above zero")
    squares, modes = eigh(stiffness_matrix(stiffness), np.diag(masses))
    return masses, stiffness, np.sqrt(squares), modes
