"""Seeded across-wind load on a tower, by floor.

The force per metre of height is the sum of two stationary Gaussian processes, each given by
its one-sided cross-spectral density S_ij(f) = sqrt(S_i(f) S_j(f)) R_ij:

    vortex shedding (Vickery and Clark, 1972)
        S_i = q_i^2 b^2 C_s^2 / (sqrt(pi) B f_i) exp(-((f/f_i - 1)/B)^2),  f_i = St U_i/b
        R_ij = exp(-((z_i - z_j)/(l_s b))^2)
    lateral turbulence (von Karman form of the crosswise component)
        S_i = q_i^2 b^2 C_t^2 4 T_i (1 + 188.4 n^2)/(1 + 70.7 n^2)^(11/6),  n = 2 f T_i, T_i = L/U_i
        R_ij = exp(-|z_i - z_j|/l_t)

with the mean wind U_i = U_H (z_i/H)^alpha and q_i = rho U_i^2/2. Coherence does not depend
on frequency, so a realisation is a root of R times independent processes: one inverse FFT of
Gaussian numbers, which takes seconds for 900 s on 76 floors.

The load is sampled every `sample_period` seconds and has zero mean; `FloorLoad` feeds it to a
system, linear between the samples. The study of the tall building calibrated the defaults, in
place of a wind tunnel record, which is not available.
"""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
import scipy.linalg as la

from cosim import Array, Block, DeclarationError, Output, Parameter, RecordError
from cosim.blocks.table_source import row_at


@dataclass(frozen=True)
class AcrossWind:
    """Parameters of the load."""

    speed: float = 47.25  # U_H, mean wind at the top, m/s
    exponent: float = 0.25  # alpha of the profile
    breadth: float = 42.0  # b, m
    density: float = 1.2  # rho, kg/m^3
    strouhal: float = 0.06  # St
    bandwidth: float = 0.36  # B
    shedding: float = 0.3037  # C_s, RMS lift coefficient of shedding
    shedding_length: float = 3.0  # l_s, in breadths
    turbulence: float = 0.1647  # C_t, RMS lift coefficient of turbulence
    turbulence_scale: float = 100.0  # L, m
    turbulence_length: float = 150.0  # l_t, m


def _shedding(wind: AcrossWind, f: Array, U: Array) -> Array:
    """Return the spectral density for unit RMS, 1/Hz, (frequencies, floors)."""
    peak = wind.strouhal * U / wind.breadth
    x = (f[:, None] / peak - 1.0) / wind.bandwidth
    return np.asarray(np.exp(-(x**2)) / (np.sqrt(np.pi) * wind.bandwidth * peak))


def _turbulence(wind: AcrossWind, f: Array, U: Array) -> Array:
    """Return the spectral density for unit RMS, 1/Hz, (frequencies, floors)."""
    T = wind.turbulence_scale / U
    n2 = (2.0 * f[:, None] * T) ** 2
    return 4.0 * T * (1.0 + 188.4 * n2) / (1.0 + 70.7 * n2) ** (11.0 / 6.0)


def coherence_factor(R: Array) -> Array:
    """Return G = G' with G G = R for a positive semidefinite correlation matrix.

    The symmetric root is unique and smooth in R, unlike Cholesky's or that of the
    eigenvectors, so a small change of a parameter changes the realisation little.
    """
    values, vectors = la.eigh(R)
    if values[0] < -1e-8 * values[-1]:
        raise DeclarationError(f"wind: the coherence matrix is not positive semidefinite ({values[0]:.2g})")
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)


def across_wind(
    heights: Array,
    duration: float = 900.0,
    seed: int = 0,
    wind: AcrossWind | None = None,
    sample_period: float = 0.1,
) -> Array:
    """Return the forces on the floors in N, (samples, floors), at 0, sample_period, ..., duration.

    heights (floors,): story heights from the ground up, m. The same seed gives the same load.
    """
    wind = wind or AcrossWind()
    if sample_period <= 0.0 or duration < sample_period:
        raise DeclarationError(
            f"across_wind: duration {duration} s and sample_period {sample_period} s must be above zero, "
            "and the duration at least one period"
        )
    z = np.cumsum(heights)
    tributary = 0.5 * (heights + np.append(heights[1:], 0.0))
    U = wind.speed * (z / z[-1]) ** wind.exponent
    load = 0.5 * wind.density * U**2 * wind.breadth * tributary  # N per unit coefficient
    gap = np.abs(z[:, None] - z)

    samples = round(duration / sample_period) + 1
    length = 2 * samples  # the load is half a period of the Fourier series
    f: Array = np.asarray(np.fft.rfftfreq(length, sample_period), float)
    rng = np.random.default_rng(seed)
    spectrum = np.zeros((len(f), len(z)), complex)
    for coefficient, density, R in (
        (wind.shedding, _shedding, np.exp(-((gap / (wind.shedding_length * wind.breadth)) ** 2))),
        (wind.turbulence, _turbulence, np.exp(-gap / wind.turbulence_length)),
    ):
        G = coherence_factor(R)
        noise = rng.standard_normal((len(f), G.shape[1], 2)) @ np.array([1.0, 1j])
        amplitude = coefficient * np.sqrt(density(wind, f, U) * f[1] / 4.0)
        spectrum += amplitude * (noise @ G.T)
    spectrum[0] = 0.0
    return np.asarray(np.fft.irfft(spectrum * length, length, axis=0)[:samples] * load)


class FloorLoad(Block):
    """w(t) from a table of forces: linear between its samples, held beyond its ends"""

    table = Parameter(0.0, "forces at 0, dt, 2 dt, ...", shape=("samples", "n"), unit="N", fixed=True)
    dt = Parameter(0.1, "sample period of the table", unit="s", min=1e-9, fixed=True)
    w = Output("forces on the floors", shape="n", unit="N")

    def step(self, t: float, h: float) -> None:
        i, q = row_at(t, self.dt, self.table.shape[0])
        after = min(i + 1, self.table.shape[0] - 1)
        for j in range(self.w.shape[0]):
            self.w[j] = self.table[i, j] + q * (self.table[after, j] - self.table[i, j])


def load_forces(path: str | PathLike[str], floors: int) -> tuple[Array, float]:
    """Read forces (samples, floors) in N and their sample period in s from a file.

    .npz with arrays `time` (samples,) in s and `force` (samples, floors) in N; or .csv with
    the columns time, force on floor 1, 2, ... (one line of titles is allowed).
    """
    path = Path(path)
    try:
        if path.suffix == ".npz":
            with np.load(path) as data:
                missing = {"time", "force"} - set(data.files)
                if missing:
                    raise RecordError(f"{path}: no array {sorted(missing)} (found {sorted(data.files)})")
                time, force = np.asarray(data["time"], float), np.asarray(data["force"], float)
        else:
            with path.open(encoding="utf-8") as file:
                titled = any(c.isalpha() for c in file.readline().replace("e", "").replace("E", ""))
            columns = np.loadtxt(path, delimiter=",", skiprows=int(titled), ndmin=2)
            time, force = columns[:, 0], columns[:, 1:]
    except (OSError, ValueError) as error:
        raise RecordError(
            f"{path} is not a record of forces ({error}); give .npz or .csv as `load_forces` describes them"
        ) from error
    if force.ndim != 2 or force.shape != (len(time), floors) or len(time) < 2:
        raise RecordError(
            f"{path}: forces of shape {force.shape} for {len(time)} times; the building needs "
            f"({len(time)}, {floors}) with at least two samples"
        )
    if not (np.isfinite(time).all() and np.isfinite(force).all()):
        row = int(np.argmin(np.isfinite(time) & np.isfinite(force).all(axis=1)))
        raise RecordError(f"{path}: row {row + 1} contains NaN or infinity")
    period = (time[-1] - time[0]) / (len(time) - 1)
    if period <= 0.0 or np.abs(np.diff(time) - period).max() > 1e-6 * period:
        raise RecordError(f"{path}: the times are not evenly spaced; resample the record first")
    return force, float(period)
