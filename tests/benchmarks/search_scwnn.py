"""Search of network parameters: python tests/benchmarks/search_scwnn.py [FOLDER WITH BENCHMARK DATA]

Declared beforehand: SEARCH_SPACE in scenarios/_bridge_control.py, 60 candidates drawn at random
(log-uniform, seed 1); SEARCH_RECORDS there; the number to be lowered, the mean of J1 to J6 and J9
to J14 over these records. The other three records are looked at once, with the best candidate.
What is found goes to SEARCHED in scenarios/_bridge_control.py.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from cosim import simulate
from scenarios.highway_bridge import control
from scenarios.highway_bridge.control import SEARCH_RECORDS, SEARCH_SPACE
from scenarios.highway_bridge.criteria import PORTS, criteria, response
from scenarios.highway_bridge.earthquakes import NAMES, available, earthquake

COUNTED = [f"J{i}" for i in (*range(1, 7), *range(9, 15))]


def judge(bridge, quake, without, parameters):
    """Mean of the counted criteria of one record."""
    control.SEARCHED = parameters
    system = control.bridge_system(bridge, quake, "scwnn-searched", 1)
    stop = min(np.ceil(quake.duration) + 2.0, control.DURATION)
    ports = [f"bridge.{p}" for p in PORTS]
    result = simulate(system, step=control.STEP, stop=stop, record=ports)
    found = criteria(result, without, quake.duration, 16, 32, None)
    return float(np.mean([found[name] for name in COUNTED]))


def main(data: Path | None) -> None:
    folder = None if data is None else data / "records"
    bridge = control.plant(data)
    here = available(folder)
    quakes = {name: earthquake(name, folder) for name in here}
    without = {}
    for name, quake in quakes.items():
        system = control.bridge_system(bridge, quake, "none", 1)
        ports = [f"bridge.{p}" for p in PORTS]
        stop = min(np.ceil(quake.duration) + 2.0, control.DURATION)
        run = simulate(system, step=control.STEP_UNCONTROLLED, stop=stop, record=ports)
        without[name] = response(run, quake.duration)
    rng = np.random.default_rng(1)
    candidates = [{}] + [
        {k: float(np.exp(rng.uniform(*np.log(bounds)))) for k, bounds in SEARCH_SPACE.items()}
        for _ in range(60)
    ]
    best, lowest = {}, np.inf
    for i, candidate in enumerate(candidates):
        value = np.mean(
            [judge(bridge, quakes[n], without[n], candidate) for n in SEARCH_RECORDS if n in here]
        )
        if value < lowest:
            best, lowest = candidate, value
            print(i, f"{value:.4f}", {k: float(f"{v:.3g}") for k, v in candidate.items()}, flush=True)
    best = {k: float(f"{v:.3g}") for k, v in best.items()}
    print("record, printed parameters, searched parameters")
    for name in NAMES:
        if name in here:
            pair = [judge(bridge, quakes[name], without[name], p) for p in ({}, best)]
            role = "searched on" if name in SEARCH_RECORDS else "judged"
            print(f"{name:15} {pair[0]:.4f} {pair[1]:.4f} {role}")
    print(best)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
