"""Sensor dynamics: any transfer function, any state space, and 1/(mu s + 1)^2 of the thesis."""

from __future__ import annotations

import math
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array
from ..core.participant import Continuous, LinearContinuous
from ..core.variables import Input, Local, Output, Parameter, State
from ..errors import DeclarationError
from ..functions import dot
from .options import Signal


class SensorDynamics(Continuous):
    """y = 1 / (mu s + 1)^2 u, from rest: the unmodeled dynamics of thesis 4.3.2, mu = 0.008 s.

        y' = z,  z' = (u - 2 mu z - y) / mu^2

    For u held over [t, t + h], with e = y - u and r = h / mu, exactly

        e(t + h) = e^-r ((1 + r) e + h z)
        z(t + h) = e^-r ((1 - r) z - r e / mu)
    """

    DEFAULT_SIZES = {"n": 1}

    mu = Parameter(0.008, "time constant", unit="s", min=1e-12)
    u = Input("true signal", unit="$unit", shape="n")
    y = State(0.0, "measured signal", unit="$unit", shape="n")
    z = State(0.0, "its rate", unit="($unit)/s", shape="n")
    held = Local(0.0, "step for which decay is valid", unit="s")
    decay = Local(0.0, "e^(-h / mu)")

    def __init__(self, mu: float = 0.008, **options: Unpack[Signal]) -> None:
        super().__init__(mu=mu, **options)

    def derivatives(self, t: float) -> None:
        for i in range(self.y.shape[0]):
            self.der_y[i] = self.z[i]
            self.der_z[i] = (self.u[i] - 2.0 * self.mu * self.z[i] - self.y[i]) / (self.mu * self.mu)

    def advance(self, t: float, h: float) -> None:
        r = h / self.mu
        if h != self.held:
            self.held, self.decay = h, math.exp(-r)
        decay = self.decay
        for i in range(self.y.shape[0]):
            e, z = self.y[i] - self.u[i], self.z[i]
            self.y[i] = self.u[i] + decay * ((1.0 + r) * e + h * z)
            self.z[i] = decay * ((1.0 - r) * z - r * e / self.mu)


class _LinearSensor(LinearContinuous):
    """x' = A x + B u"""

    A = Parameter(0.0, "dynamics", shape=("n", "n"), fixed=True)
    B = Parameter(0.0, "input", shape=("n", "m"), fixed=True)
    C = Parameter(0.0, "output", shape=("p", "n"), fixed=True)
    u = Input("true signal", unit="$unit", shape="m")
    x = State(0.0, "state", shape="n")
    y = Output("measured signal", unit="$unit", shape="p")

    def derivatives(self, t: float) -> None:
        for i in range(self.x.shape[0]):
            self.der_x[i] = dot(self.A[i], self.x) + dot(self.B[i], self.u)


class StrictlyProper(_LinearSensor):
    """x' = A x + B u, y = C x: a sensor with an output that does not depend directly on its input."""

    def __init__(self, A: ArrayLike, B: ArrayLike, C: ArrayLike, *, unit: str | None = None) -> None:
        super().__init__(A=A, B=B, C=C, unit=unit)

    def outputs(self, t: float) -> None:
        for i in range(self.y.shape[0]):
            self.y[i] = dot(self.C[i], self.x)


class StateSpace(_LinearSensor):
    """x' = A x + B u, y = C x + D u; use `StrictlyProper` without D, so that no direct path closes a loop."""

    D = Parameter(0.0, "direct path", shape=("p", "m"), fixed=True)

    def __init__(
        self, A: ArrayLike, B: ArrayLike, C: ArrayLike, D: ArrayLike, *, unit: str | None = None
    ) -> None:
        super().__init__(A=A, B=B, C=C, D=D, unit=unit)

    def outputs(self, t: float) -> None:
        for i in range(self.y.shape[0]):
            self.y[i] = dot(self.C[i], self.x) + dot(self.D[i], self.u)


def transfer_function(model: Any, *, unit: str | None = None) -> StateSpace | StrictlyProper:
    """Return a sensor with a given transfer function, exact over steps of any length.

    model
        a control.TransferFunction or scipy.signal.TransferFunction in s with one input
        and one output; anything with A, B, C, D; or a pair (numerator, denominator) of
        coefficients, highest power of s first

    Numerator and denominator become the controllable canonical form, its states scaled
    by powers of two so that the coefficients are of like size. Without a direct path
    the result is StrictlyProper.
    """
    if getattr(model, "dt", None) not in (None, 0, 0.0, False):
        raise DeclarationError(
            f"transfer_function: the model is discrete (dt = {model.dt}); give the model in s, "
            "which is discretised exactly for the step of the run"
        )
    if all(hasattr(model, name) for name in "ABCD"):
        A, B, C, D = (np.atleast_2d(np.asarray(getattr(model, n), dtype=np.float64)) for n in "ABCD")
    else:
        numerator, denominator = (
            (model.num, model.den) if hasattr(model, "num") and hasattr(model, "den") else model
        )
        A, B, C, D = _canonical(
            _coefficients(numerator, "numerator"), _coefficients(denominator, "denominator")
        )
    if D.any():
        return StateSpace(A, B, C, D, unit=unit)
    return StrictlyProper(A, B, C, unit=unit)


def _coefficients(values: Any, what: str) -> Array:
    """Return the coefficients of one polynomial without leading zeros."""
    while isinstance(values, (list, tuple)) and len(values) == 1 and np.ndim(values[0]) > 0:
        values = values[0]  # control keeps one list for every output and input
    try:
        found = np.atleast_1d(np.asarray(values, dtype=np.float64))
    except (TypeError, ValueError) as error:
        raise DeclarationError(
            f"transfer_function: the {what} must be a single polynomial; take one input and one output, "
            "model[0, 1], and one sensor for each"
        ) from error
    if found.ndim != 1 or not np.isfinite(found).all():
        raise DeclarationError(
            f"transfer_function: the {what} {values!r} must be finite coefficients; "
            "give one input and one output, highest power of s first"
        )
    return np.trim_zeros(found, "f")


def _canonical(numerator: Array, denominator: Array) -> tuple[Array, Array, Array, Array]:
    """Return A, B, C, D of the controllable canonical form, balanced."""
    from scipy.linalg import matrix_balance

    n = denominator.size - 1
    if n < 0:
        raise DeclarationError("transfer_function: the denominator is zero")
    if numerator.size > n + 1:
        raise DeclarationError(
            f"transfer_function: the numerator's degree {numerator.size - 1} is above the denominator's {n}: "
            "such a sensor would know the future; add the missing poles"
        )
    if n == 0:
        raise DeclarationError(
            "transfer_function: a constant factor has no dynamics; use WeightedSum, or a unit conversion"
        )
    a = denominator[1:] / denominator[0]
    b = np.concatenate([np.zeros(n + 1 - numerator.size), numerator]) / denominator[0]
    A = np.vstack([-a, np.eye(n)[:-1]])
    B = np.eye(n)[:, :1]
    C = (b[1:] - a * b[0])[None, :]
    A, T = matrix_balance(A, permute=False)
    return A, B / np.diag(T)[:, None], C * np.diag(T), np.array([[b[0]]])
