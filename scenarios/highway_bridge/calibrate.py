"""Search of the parameters of scwnn-searched.

    python -m scenarios.highway_bridge.calibrate [FOLDER WITH BENCHMARK DATA]

These were declared before the search: SPACE, 60 candidates drawn at random from it
(log-uniform, seed 1), SEARCH_RECORDS, and the objective, the mean of J1 to J6 and J9 to J14
over these records. The other three records are tried once, with the best candidate. The
result is control.SEARCHED. Installed packages lack one of the records; the search of
control.SEARCHED took all six from the benchmark's folder.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cosim import simulate
from fmus.plants.nonlinear_structure import NonlinearStructure

from .control import DURATION, EQUIPMENT, STEP, STEP_UNCONTROLLED, bridge_system, plant
from .criteria import PORTS, Response, criteria, response
from .earthquakes import Earthquake, available, earthquake, records_folder
from .table import RATIOS

SPACE = {
    "k1": (30.0, 300.0),
    "k2": (1.0, 300.0),
    "g_min": (10.0, 300.0),
    "s_max": (1.0, 100.0),
    "eta_r": (0.1, 30.0),
    "leak": (0.01, 3.0),
    "eta_iw": (0.001, 0.1),
    "eta_ib": (0.001, 0.1),
}
SEARCH_RECORDS = ("el-centro", "northridge", "chi-chi")
CANDIDATES = 60
RECORDED = [f"bridge.{port}" for port in PORTS]


def stop(quake: Earthquake) -> float:
    """Return the length of a run: the record and two seconds."""
    return float(min(np.ceil(quake.duration) + 2.0, DURATION))


def judge(
    bridge: NonlinearStructure, quake: Earthquake, without: Response, network: Mapping[str, float]
) -> float:
    """Return the mean of J1 to J6 and J9 to J14 of one record, with the given network parameters."""
    system = bridge_system(bridge, quake, "scwnn", 1, network=network)
    result = simulate(system, step=STEP, stop=stop(quake), record=RECORDED)
    found = criteria(result, without, quake.duration, EQUIPMENT["scwnn"])
    return float(np.mean([found[name] for name in RATIOS]))


def uncontrolled(bridge: NonlinearStructure, quake: Earthquake) -> Response:
    """Return the response without control."""
    system = bridge_system(bridge, quake, "none", 1)
    run = simulate(system, step=STEP_UNCONTROLLED, stop=stop(quake), record=RECORDED)
    return response(run, quake.duration)


def candidates(n: int) -> list[dict[str, float]]:
    """Return the thesis' own parameters and n random ones."""
    rng = np.random.default_rng(1)
    return [{}] + [
        {k: float(np.exp(rng.uniform(*np.log(bounds)))) for k, bounds in SPACE.items()} for _ in range(n)
    ]


def main(data: Path | None, n: int = CANDIDATES) -> dict[str, float]:
    """Search, and print the result beside the thesis' parameters, record by record."""
    folder = records_folder(None, data)
    bridge = plant(data)
    quakes = {name: earthquake(name, folder) for name in available(folder)}
    without = {name: uncontrolled(bridge, quake) for name, quake in quakes.items()}
    best: dict[str, float] = {}
    lowest = float("inf")
    for i, network in enumerate(candidates(n)):
        searched = [r for r in SEARCH_RECORDS if r in quakes]
        value = float(np.mean([judge(bridge, quakes[r], without[r], network) for r in searched]))
        if value < lowest:
            best, lowest = network, value
            print(i, f"{value:.4f}", _rounded(network), flush=True)
    best = _rounded(best)
    print("record, thesis' parameters, searched parameters")
    for name, quake in quakes.items():
        pair = [judge(bridge, quake, without[name], network) for network in ({}, best)]
        role = "searched on" if name in SEARCH_RECORDS else "judged"
        print(f"{name:15} {pair[0]:.4f} {pair[1]:.4f} {role}")
    print(best)
    return best


def _rounded(network: Mapping[str, float]) -> dict[str, float]:
    return {k: float(f"{v:.3g}") for k, v in network.items()}


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
