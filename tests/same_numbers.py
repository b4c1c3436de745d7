"""Hashes of the results of the studies, an SSP and every exported class: `python -m tests.same_numbers`.

Run it before and after a change that must not alter a result; the two outputs must be equal,
bit for bit, on one machine. Options: --only PART, several times, of the parts in PARTS.
"""

from __future__ import annotations

import argparse
import hashlib
import tempfile
import warnings
from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path

import numpy as np

from cosim import FMU, Result, System, read_ssp, simulate
from fmus.export import export
from fmus.packaging.ssp import export_ssp
from scenarios.chattering.study import GAINS
from scenarios.chattering.study import Study as Chattering
from scenarios.highway_bridge.study import Study as HighwayBridge
from scenarios.tall_building.study import Study as TallBuilding
from tests.fmus.export.every_class import H, classes, makers

STEPS = 200


def digest(result: Result) -> str:
    """Return a hash of time and signals, by name."""
    h = hashlib.sha256(result.time.tobytes())
    for name in sorted(result.signals):
        h.update(name.encode() + np.ascontiguousarray(result.signals[name]).tobytes())
    return h.hexdigest()[:16]


def chattering_cases() -> Iterator[tuple[str, str]]:
    """Every case, gain law and coupling of chapter 4."""
    for case, gain, coupling in product(range(1, 7), GAINS, ("sampled", "continuous")):
        yield (
            f"case {case}, {gain}, {coupling}",
            digest(Chattering(case=case, gain=gain, coupling=coupling).run()),
        )


def tower() -> Iterator[tuple[str, str]]:
    """60 s of the tall building."""
    for controller in ("filtered-smc", "lqg"):
        yield controller, digest(TallBuilding(controller=controller, duration=60.0).run())


def bridge() -> Iterator[tuple[str, str]]:
    """El Centro on the highway bridge, 20 s."""
    for controller in ("scwnn", "lqg"):
        study = HighwayBridge(record="el-centro", controller=controller, duration=20.0, compare=False)
        yield controller, digest(study.run())


def ssp() -> Iterator[tuple[str, str]]:
    """Chattering, case 6, out as an SSP and in again."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "chattering.ssp"
        export_ssp(Chattering(case=6).build(), path, step=0.01, stop=10.0)
        yield "case 6", digest(simulate(read_ssp(path), step=0.01, stop=10.0))


def exported_classes() -> Iterator[tuple[str, str]]:
    """Every block and plant as an FMU, its inputs at rest."""
    for name, kind in sorted(classes().items(), key=lambda item: item[1].__name__):
        for i, make in enumerate(makers(kind)):
            with tempfile.TemporaryDirectory() as folder:
                for version in ("2.0", "3.0"):
                    path = export(make(), Path(folder) / f"part{version[0]}.fmu", fmi_version=version)
                    fmu = FMU(path, start={n: 0.25 for n, p in FMU(path).input_ports.items() if not p.shape})
                    result = simulate(System({"part": fmu}), step=H, stop=STEPS * H)
                    yield f"{name.rpartition('.')[2]}, {i + 1}, FMI {version}", digest(result)


PARTS: dict[str, Callable[[], Iterator[tuple[str, str]]]] = {
    "chattering": chattering_cases,
    "tower": tower,
    "bridge": bridge,
    "ssp": ssp,
    "classes": exported_classes,
}


def main() -> None:
    """Print one line per result, and one hash per part."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", action="append", choices=list(PARTS))
    warnings.simplefilter("ignore")
    for part in parser.parse_args().only or PARTS:
        total = hashlib.sha256()
        for name, value in PARTS[part]():
            print(f"{part}: {name}: {value}", flush=True)
            total.update(f"{name} {value}\n".encode())
        print(f"{part}: {total.hexdigest()[:16]}", flush=True)


if __name__ == "__main__":
    main()
