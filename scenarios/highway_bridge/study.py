"""Highway bridge: the 91/5 overcrossing under six earthquakes, its network and its LQG (chapter 3).

A nonlinear bridge, two-directional records, 16 actuators of 1000 kN between deck and
abutments. The default plant is the project's reduced bridge; `--data` takes the full
430-degree-of-freedom model from a folder with the benchmark's files. Records come from
installed packages or from a folder (`--records`, or `records` within `--data`).

What differs from the printed table, and why (full model, all six records):
- Peaks of bearings, J5 and J16, are lower than printed in five records of six, forces below the
  cap in four where the print has 1000 kN in all: the guard of g decides how hard the network
  pushes, and is not printed. g_min = 100 m/s2 gives full force at 1 m/s; it is not tuned.
- With that guard the term -k1 x'/g_min is larger than what the network has learnt, so the
  network acts nearly as the passive dampers of the same 1 MN s/m do. Its own part shows where
  it may learn more (scwnn-searched).
- Accelerations J4 and J12 are above the print in three and four records of six, and base shear
  J1 is above 1 under N. Palm Springs: forces at the deck's ends shake the deck.
- Northridge J14 stays above 1: the columns' lasting curvature, a matter of when they yield, is
  most of that norm.
- J18 is a third to a fifth of the print's, for LQG too, while J17 agrees: the print's J18 has
  another time step or normalisation than its definition.
- LQG: the benchmark's own weights and sensors are not printed; ours are in _bridge_control.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from cosim import Result, SimulationError, System, simulate
from scenarios.highway_bridge.earthquakes import NAMES as RECORDS
from scenarios.highway_bridge.earthquakes import Earthquake, available, earthquake

from .control import DURATION, STEP, STEP_UNCONTROLLED, Controller, bridge_system, plant
from .criteria import NAMES as CRITERIA
from .criteria import PORTS, Response, criteria, curvatures, response
from .printed import printed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Record = Literal["n-palm-springs", "chi-chi", "el-centro", "northridge", "turkey", "kobe"]
#: what a controller has: devices, sensors, states of its own
EQUIPMENT: dict[str, tuple[int, int, int | None]] = {
    "none": (0, 0, 0),
    "passive": (16, 0, 0),
    "lqg": (16, 12, 28),
    "scwnn": (16, 32, None),
    "scwnn-searched": (16, 32, None),
    "scwnn-six-sensors": (16, 6, None),
}
#: criteria of displacement, moment and bearing: where the thesis claims the network's success
CLAIMED = ("J2", "J3", "J5", "J6", "J11", "J13", "J14", "J16")


def _records_folder(records: Path | None, data: Path | None) -> Path | None:
    if records is None and data is not None and (data / "records").is_dir():
        return data / "records"
    return records


def build(
    *,
    record: Record = "el-centro",
    controller: Controller = "scwnn",
    data: Path | None = None,
    records: Path | None = None,
    late_events: bool = False,
    seed: int = 1,
) -> System:
    """Return the bridge with its records, sensors and controller."""
    quake = earthquake(record, _records_folder(records, data))
    return bridge_system(plant(data, late_events), quake, controller, seed)


def run(
    *,
    record: Record = "el-centro",
    controller: Controller = "scwnn",
    data: Path | None = None,
    records: Path | None = None,
    late_events: bool = False,
    seed: int = 1,
    duration: float = DURATION,
    compare: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> Result:
    """Run the bridge under an earthquake.

    Parameters
    ----------
    record
        earthquake, in two directions
    controller
        none, passive (viscous dampers), lqg, scwnn (the thesis' network), scwnn-searched
        (parameters searched on three records), scwnn-six-sensors (an observer in front)
    data
        folder with the benchmark's phase1_430dof.npz: the full model
    records
        folder with the six records (.csv or .AT2); without it, installed packages
    late_events
        columns yield a step late, as in the benchmark's own code
    seed
        of the sensors' noise
    duration
        of the run in s
    compare
        run without control and with LQG too, for figures 3.7 and 3.8
    """
    quake = earthquake(record, _records_folder(records, data))
    system = bridge_system(plant(data, late_events), quake, controller, seed)
    result = _simulate(system, controller, duration, progress)
    others: tuple[Controller, ...] = ("none", "lqg") if compare and controller not in ("none", "lqg") else ()
    for other in others:
        system = bridge_system(plant(data, late_events), quake, other, seed, step=STEP)
        run = simulate(system, step=STEP, stop=duration, record=["bridge.deformation"])
        result.signals[f"{other}.deformation"] = run["bridge.deformation"]
        result.units[f"{other}.deformation"] = None
    return result


def _simulate(
    system: System, controller: str, duration: float, progress: Callable[[int, int], None] | None
) -> Result:
    ports = [f"bridge.{port}" for port in PORTS]
    if controller.startswith("scwnn"):
        ports += ["control.nodes", "control.full", "control.s", "control.r"]
    step = STEP_UNCONTROLLED if controller == "none" else STEP
    try:
        return simulate(system, step=step, stop=duration, record=ports, progress=progress)
    except SimulationError as error:
        found = error.result
        if found is None or "bridge.failure" not in found or found["bridge.failure"][-1, 0] < 0.0:
            raise
        element, time, residual = found["bridge.failure"][-1]
        told = SimulationError(
            f"bridge: element {int(element)} did not converge in the step after t = {time:.4f} s, residual "
            f"{residual:.2g} of its scale; take a smaller step, or more bisections"
        )
        told.result = found
        raise told from error


def metrics(result: Result) -> dict[str, tuple[float, str]]:
    """Peaks of the response, yielded column ends, and how the energy balance closes."""
    own = response(result, float(result.time[-1]))
    energy = result["bridge.energy"]
    gap = np.abs(energy[:, :2].sum(axis=1) - energy[:, 2:].sum(axis=1)).max()
    units = {
        "shear": "N",
        "moment": "N m",
        "midspan": "m",
        "acceleration": "m/s2",
        "bearing": "m",
        "curvature": "1/m",
    }
    found = {f"peak {name}": (value, units[name]) for name, value in own.peak.items()}
    found["plastic energy of a column end"] = (own.plastic_energy, "J")
    found["yielded column ends"] = (float(own.yielded), "")
    found["peak force"] = (float(np.abs(result["bridge.u"]).max()), "N")
    found["energy balance, gap over input"] = (float(gap / np.abs(energy).max()), "")
    if "control.nodes" in result:
        found["most nodes"] = (float(result["control.nodes"].max()), "")
        found["nodes wanted beyond the largest number"] = (float(result["control.full"][-1]), "")
    return found


# -------------------------------------------------------------------------- table 3.1


def table(
    *,
    data: Path | None = None,
    records: Path | None = None,
    controllers: tuple[Controller, ...] = ("lqg", "scwnn", "scwnn-searched", "scwnn-six-sensors", "passive"),
    late_events: bool = False,
    seed: int = 1,
) -> list[dict[str, Any]]:
    """Table 3.1, printed and computed, for all records and controllers.

    Parameters
    ----------
    data
        folder with the benchmark's phase1_430dof.npz: the full model
    records
        folder with the six records; without it, installed packages
    controllers
        which controllers
    late_events
        columns yield a step late, as in the benchmark's own code
    seed
        of the sensors' noise
    """
    folder = _records_folder(records, data)
    here = available(folder)
    rows = []
    for record in RECORDS:
        values: dict[str, dict[str, float | None]] = {}
        note = None
        if record in here:
            quake = earthquake(record, folder)
            note = quake.note
            values = _criteria_of(quake, controllers, data, late_events, seed)
        for controller in controllers:
            for criterion in CRITERIA:
                rows.append({
                    "record": record, "controller": controller, "criterion": criterion,
                    "printed": printed(controller, criterion, record),
                    "computed": values.get(controller, {}).get(criterion), "note": note,
                })  # fmt: skip
    return rows


def _criteria_of(
    quake: Earthquake, controllers: tuple[Controller, ...], data: Path | None, late_events: bool, seed: int
) -> dict[str, dict[str, float | None]]:
    without = _uncontrolled(quake.name, quake, data, late_events)
    found: dict[str, dict[str, float | None]] = {}
    for controller in controllers:
        system = bridge_system(plant(data, late_events), quake, controller, seed)
        result = _simulate(system, controller, DURATION, None)
        found[controller] = criteria(result, without, quake.duration, *EQUIPMENT[controller])
    return found


def _uncontrolled(name: str, quake: Earthquake, data: Path | None, late_events: bool) -> Response:
    system = bridge_system(plant(data, late_events), quake, "none", 1)
    return response(_simulate(system, "none", DURATION, None), quake.duration)


def table_text(rows: list[dict[str, Any]]) -> str:
    """One block a record: criteria down, controllers across, each printed and computed."""
    lines: list[str] = []
    controllers = list(dict.fromkeys(row["controller"] for row in rows))
    cell = {(r["record"], r["controller"], r["criterion"]): r for r in rows}
    for record in dict.fromkeys(row["record"] for row in rows):
        note = next(r["note"] for r in rows if r["record"] == record)
        lines.append(f"\n{record}: {note or 'record not at hand'}")
        lines.append(f"{'':4}" + "".join(f"{c:>18}" for c in controllers))
        lines.append(f"{'':4}" + f"{'printed computed':>18}" * len(controllers))
        for criterion in CRITERIA:
            pairs = (cell[record, c, criterion] for c in controllers)
            text = "".join(f"{_number(p['printed']):>9}{_number(p['computed']):>9}" for p in pairs)
            lines.append(f"{criterion:<4}{text}")
    return "\n".join([*lines, "", *_verdict(rows)])


def _number(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:.0f}" if value == int(value) else f"{value:.4f}"


def _verdict(rows: list[dict[str, Any]]) -> list[str]:
    """How many of the cells that the thesis' network improves are improved here."""
    lines = []
    for controller in dict.fromkeys(row["controller"] for row in rows):
        claimed = [
            r for r in rows
            if r["controller"] == controller and r["criterion"] in CLAIMED and r["computed"] is not None
            and (printed("scwnn", r["criterion"], r["record"]) or math.inf) < 1.0
        ]  # fmt: skip
        below = sum(r["computed"] < 1.0 for r in claimed)
        lines.append(
            f"{controller}: below 1 in {below} of {len(claimed)} displacement, moment and bearing cells "
            f"({', '.join(CLAIMED)}) that the thesis prints below 1"
        )
    return lines


# ---------------------------------------------------------------------------- figures


def figures(result: Result) -> dict[str, Figure]:
    """Figures 3.7 to 3.9, hysteresis loops of a bearing and a column, and which ends yield."""
    from . import figures as draw

    found = {
        "figure-3.7-second-sensor": draw.displacements(result, 1, "second"),
        "figure-3.8-seventh-sensor": draw.displacements(result, 6, "seventh"),
        "hysteresis": draw.loops(result, curvatures(result)),
        "yield-map": draw.yield_map(curvatures(result)),
    }
    if "control.nodes" in result:
        found["figure-3.9-nodes"] = draw.nodes(result)
    return found
