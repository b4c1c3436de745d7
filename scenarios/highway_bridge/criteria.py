"""The 21 criteria of the highway bridge benchmark (thesis.txt, appendix C).

Ratios of peaks J1 to J6, of dissipated energy and yielded column ends J7 and J8, of norms
|x| = sqrt(sum x^2 dt / T) J9 to J14; then what control takes, J15 to J21. The bridge's elements are
16 bearings, then the segments of two columns from top to base, in y and in x, two ends each.

    base shear        of a column, in one direction: (m_1 + m_2) / length of its lowest segment
    moment            at any segment's end
    curvature         m / EI + plastic curvature; yields beyond My / EI
    plastic energy    int m d(curvature) at an end
    J16               stroke over the largest resultant bearing deformation without control
    J17, J18          as the benchmark computes them: largest sum |P| / (x' W), and largest
                      sum |P| dt / (x W), P force times velocity of a device. Appendix C prints
                      the two in each other's place
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim import Array, Result

from .bridge import EI, M_Y, SEGMENT

BEARINGS = 16
WEIGHT = 41.57e6  # N, of the superstructure
NAMES = tuple(f"J{i}" for i in range(1, 22))
#: what has to be recorded
PORTS = ("y", "a", "deformation", "force", "plastic", "u", "stroke", "stroke_rate", "energy", "failure")


@dataclass(frozen=True)
class Response:
    """Peaks and norms of one run."""

    peak: dict[str, float]
    norm: dict[str, float]
    plastic_energy: float  # the largest of a column's end, J
    yielded: int  # column ends
    bearing_speed: float
    bearing_resultant: float


def moments(result: Result) -> Array:
    """(r, ends) at the segments' ends, N m."""
    return result["bridge.force"][:, BEARINGS:]


def curvatures(result: Result) -> Array:
    """(r, ends) at the segments' ends, 1/m."""
    return moments(result) / EI + result["bridge.plastic"][:, BEARINGS:]


def base_shears(result: Result) -> Array:
    """(r, 4): two columns in two directions, N."""
    m = moments(result)
    per_column = m.shape[1] // 2
    lowest = [c * per_column + per_column - 4 + d for c in range(2) for d in (0, 2)]
    return np.column_stack([(m[:, i] + m[:, i + 1]) / SEGMENT for i in lowest])


def response(result: Result, duration: float) -> Response:
    """Peaks over the run; norms over the record's duration: what comes later is rest."""
    dt = float(result.time[1] - result.time[0])
    shaken = result.time < duration
    bearings = result["bridge.deformation"][:, :BEARINGS]
    m, phi = moments(result), curvatures(result)
    signals = {
        "shear": base_shears(result), "moment": m, "midspan": result["bridge.y"],
        "acceleration": result["bridge.a"][:, :2], "bearing": bearings, "curvature": phi,
    }  # fmt: skip
    energy = (0.5 * (m[1:] + m[:-1]) * np.diff(phi, axis=0)).sum(axis=0)
    yields = np.abs(phi).max(axis=0) > M_Y / EI
    return Response(
        peak={n: float(np.abs(s).max()) for n, s in signals.items()},
        norm={
            n: float(np.sqrt((s[shaken] ** 2).sum(axis=0) * dt / duration).max()) for n, s in signals.items()
        },
        plastic_energy=float(energy[yields].max()) if yields.any() else 0.0,
        yielded=int(yields.sum()),
        bearing_speed=float(np.abs(result["bridge.stroke_rate"]).max()),
        bearing_resultant=float(np.hypot(bearings[:, ::2], bearings[:, 1::2]).max()),
    )


def criteria(
    controlled: Result,
    uncontrolled: Response,
    duration: float,
    devices: int,
    sensors: int,
    states: int | None,
) -> dict[str, float | None]:
    """J1 to J21 by name; states None: a controller without a state vector of its own."""
    own = response(controlled, duration)
    dt = float(controlled.time[1] - controlled.time[0])
    power = np.abs(controlled["bridge.u"] * controlled["bridge.stroke_rate"]).sum(axis=1).max()
    order = ("shear", "moment", "midspan", "acceleration", "bearing", "curvature")
    values: list[float | None] = [own.peak[n] / uncontrolled.peak[n] for n in order]
    values.append(own.plastic_energy / uncontrolled.plastic_energy if uncontrolled.plastic_energy else 0.0)
    values.append(own.yielded / uncontrolled.yielded if uncontrolled.yielded else float(own.yielded))
    values += [own.norm[n] / uncontrolled.norm[n] for n in order]
    values.append(float(np.abs(controlled["bridge.u"]).max()) / WEIGHT)
    values.append(float(np.abs(controlled["bridge.stroke"]).max()) / uncontrolled.bearing_resultant)
    values.append(float(power) / (uncontrolled.bearing_speed * WEIGHT))
    values.append(float(power) * dt / (uncontrolled.bearing_resultant * WEIGHT))
    values += [float(devices), float(sensors), None if states is None else float(states)]
    return dict(zip(NAMES, values, strict=True))
