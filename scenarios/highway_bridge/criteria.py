"""The 21 criteria of the highway bridge benchmark (appendix C of the thesis).

Ratios of peaks J1 to J6, of dissipated energy and yielded column ends J7 and J8, of norms
|x| = sqrt(sum x^2 dt / T) J9 to J14; then the effort of control, J15 to J21. The bridge's elements
are 16 bearings, then the segments of two columns from top to base, in y and in x, two ends each.

    base shear        of a column, in one direction: (m_1 + m_2) / length of its lowest segment
    moment            at any segment's end
    curvature         m / EI + plastic curvature; yields beyond My / EI
    plastic energy    int m d(curvature) at an end
    J16               stroke over the largest resultant bearing deformation without control
    J17, J18          as the benchmark computes them: largest sum |P| / (x' W), and largest
                      sum |P| dt / (x W), P force times velocity of a device. Appendix C prints
                      them in exchanged places
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim import Array, Result

from .bridge import EI, M_Y, SEGMENT

BEARINGS = 16
WEIGHT = 41.57e6  # N, of the superstructure
NAMES = tuple(f"J{i}" for i in range(1, 22))
#: ports of the bridge that the criteria need
PORTS = ("y", "a", "deformation", "force", "plastic", "u", "stroke", "stroke_rate", "energy", "failure")

#: in the order of J1 to J6 and J9 to J14
MOTIONS = ("shear", "moment", "midspan", "acceleration", "bearing", "curvature")


@dataclass(frozen=True)
class Equipment:
    """Numbers of devices, sensors and states of a controller (None: it has no state vector)."""

    devices: int
    sensors: int
    states: int | None


@dataclass(frozen=True)
class Response:
    """Peaks and norms of one run."""

    peak: dict[str, float]
    norm: dict[str, float]
    plastic_energy: float  # largest of all column ends, J
    yielded: int  # number of column ends
    bearing_speed: float
    bearing_resultant: float


def moments(result: Result) -> Array:
    """Return the moments (samples, ends) at the segments' ends, N*m."""
    return result["bridge.force"][:, BEARINGS:]


def curvatures(result: Result) -> Array:
    """Return the curvatures (samples, ends) at the segments' ends, 1/m."""
    return moments(result) / EI + result["bridge.plastic"][:, BEARINGS:]


def base_shears(result: Result) -> Array:
    """Return the base shears (samples, 4) of two columns in two directions, N."""
    m = moments(result)
    ends = m.reshape(len(m), 2, -1, 2, 2)  # sample, column, segment from top to base, plane, end
    lowest = ends[:, :, -1]
    return (lowest[..., 0] + lowest[..., 1]).reshape(len(m), 4) / SEGMENT


def response(result: Result, duration: float) -> Response:
    """Return peaks over the run, and norms over the record's duration; the rest of the run is decay."""
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
    controlled: Result, uncontrolled: Response, duration: float, equipment: Equipment
) -> dict[str, float | None]:
    """Return J1 to J21 by name."""
    own = response(controlled, duration)
    dt = float(controlled.time[1] - controlled.time[0])
    power = np.abs(controlled["bridge.u"] * controlled["bridge.stroke_rate"]).sum(axis=1).max()
    states = equipment.states
    values = (
        *(own.peak[n] / uncontrolled.peak[n] for n in MOTIONS),
        own.plastic_energy / uncontrolled.plastic_energy if uncontrolled.plastic_energy else 0.0,
        own.yielded / uncontrolled.yielded if uncontrolled.yielded else float(own.yielded),
        *(own.norm[n] / uncontrolled.norm[n] for n in MOTIONS),
        float(np.abs(controlled["bridge.u"]).max()) / WEIGHT,
        float(np.abs(controlled["bridge.stroke"]).max()) / uncontrolled.bearing_resultant,
        float(power) / (uncontrolled.bearing_speed * WEIGHT),
        float(power) * dt / (uncontrolled.bearing_resultant * WEIGHT),
        float(equipment.devices),
        float(equipment.sensors),
        None if states is None else float(states),
    )
    return dict(zip(NAMES, values, strict=True))
