"""Every block and plant as an FMU: both versions of FMI, no finding, the same trajectory in the loop.

Every class in the packages is walked (every_class.py). Participant and FMU stand side by side in one
system, driven by the same noise; a block's FMU acts as a block, a plant's runs as Co-Simulation and,
under stage coupling, as Model Exchange. They are the same bits: one LLVM IR, no
fast-math, and the same libm.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy.validation import validate_fmu
from fmu_manipulation_toolbox import checker
from fmu_manipulation_toolbox.cli.fmutool import fmutool

from cosim import FMU, Block, Continuous, DeclarationError, Participant, System, simulate
from cosim.blocks import Constant, WhiteNoise
from fmus.export import export
from fmus.export.fmu import FMI_VERSIONS
from scenarios.highway_bridge.bridge import highway_bridge
from tests.benchmark_data import needs_data
from tests.cosim.blocks.drive import assert_same_bits
from tests.fmus.export.every_class import MAKE, H, classes, makers, whole_bridge, whole_tower

STEPS = 120
KINDS = classes()
PAIRS = [(kind, i) for kind in KINDS.values() for i in range(len(makers(kind)))]
#: FMI 2.0 and 3.0 in turn, since linking takes half a second; `long` runs the other version too
CASES = [
    pytest.param(
        *pair,
        version,
        id=f"{pair[0].__name__}-{pair[1]}-{version}",
        marks=[pytest.mark.long] if (k + j) % 2 else [],
    )
    for k, pair in enumerate(PAIRS)
    for j, version in enumerate(FMI_VERSIONS)
]


def test_every_class_can_be_made() -> None:
    assert len(KINDS) > 35
    for name, kind in KINDS.items():
        try:
            made = {type(make()).__name__ for make in makers(kind)}
        except (TypeError, DeclarationError) as error:
            pytest.fail(f"say in every_class.py how to make {name}, so that its export is tested: {error}")
        assert made == {kind.__name__} or kind.__name__.startswith("_")
    gone = sorted(kind.__name__ for kind in MAKE if kind not in KINDS.values())
    assert not gone, f"every_class.py makes {', '.join(gone)}, which no package has"


schema = lru_cache(checker.xmlschema.XMLSchema)


@pytest.fixture
def fmutool_says(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[[Path], str]:
    """`fmutool -input path -check` in this process, with FMI's schemas read once: 0.3 s instead of 1.5."""
    monkeypatch.setattr(checker.xmlschema, "XMLSchema", schema)

    def says(path: Path) -> str:
        monkeypatch.setattr("sys.argv", ["fmutool", "-input", str(path), "-check"])
        fmutool()
        logging.getLogger("fmu_manipulation_toolbox").handlers.clear()  # each call adds its own
        said = capsys.readouterr()
        return said.out + said.err

    return says


def side_by_side(
    ours: Participant, path: Path, steps: int, h: float, **options: Any
) -> dict[str, np.ndarray]:
    """Run a participant and its FMU on the same noise; return every port of each."""
    rate = {"every": ours.every, "sample_period": ours.sample_period} if isinstance(ours, Block) else {}
    system = System({"ours": ours, "fmu": FMU(path, as_block=isinstance(ours, Block), **rate)})
    ports = ours.ports("input")
    sizes = [port.size for port in ports.values()]
    if sizes:
        system.add("drive", WhiteNoise(sample_period=h, n=sum(sizes), seed=8))
        first = np.cumsum([1, *sizes])
        for (name, port), a, size in zip(ports.items(), first, sizes, strict=False):
            part = f"drive.y[{a}:{a + size - 1}]" if port.shape else f"drive.y[{a}]"
            for member in ("ours", "fmu"):
                system.connect(part, f"{member}.{name}")
    wanted = [f"{m}.{port}" for m in ("ours", "fmu") for port in ours.declared_outputs]
    result = simulate(system, step=h, stop=steps * h, record=wanted, **options)
    return {port: result[port] for port in wanted}


def check_leaves(
    ours: Participant, version: str, folder: Path, says: Callable[[Path], str], h: float = H
) -> dict[str, np.ndarray]:
    """Export, check and compare a participant; return the signals."""
    path = export(ours, folder / "it.fmu", fmi_version=version)
    assert validate_fmu(str(path)) == []
    said = says(path)
    assert f"compliant with FMI-{version}" in said
    assert "No semantic error" in said
    assert "ERROR" not in said
    assert "WARNING" not in said
    couplings: list[dict[str, str]] = [{}]
    if isinstance(ours, Continuous) and "derivatives" in ours.kernels:
        couplings.append({"coupling": "continuous", "solver": "ode3"})  # Model Exchange
    for options in couplings:
        signals = side_by_side(ours, path, STEPS, h, **options)
        for port, values in signals.items():
            expected = signals["ours." + port.partition(".")[2]]
            assert np.array_equal(values, expected), f"{port}: off by {np.abs(values - expected).max()}"
    return signals


@pytest.mark.parametrize(("kind", "i", "version"), CASES)
def test_a_class_leaves(
    kind: type[Participant], i: int, version: str, tmp_path: Path, fmutool_says: Callable[[Path], str]
) -> None:
    signals = check_leaves(makers(kind)[i](), version, tmp_path, fmutool_says)
    moved = [np.ptp(v, axis=0).max() > 0.0 for v in signals.values()]
    assert any(moved) or kind is Constant


@pytest.mark.parametrize("kind", [k for n, k in KINDS.items() if n.startswith("controllers.")])
def test_a_controller_interpreted_is_compiled(kind: type[Participant]) -> None:
    """So the FMU computes what the debugger shows; cosim.blocks has its own test of this.

    On many seeds: a power that one of the two multiplies out differs in one of three.
    """
    for make in makers(kind):
        ours = make()
        for seed in range(20):
            inputs = np.random.default_rng(seed).normal(size=(40, ours.zones["input"][1]))
            assert_same_bits(ours, inputs, H)


@pytest.mark.long
@pytest.mark.parametrize("version", FMI_VERSIONS)
@pytest.mark.parametrize(
    ("make", "h"),
    [
        (whole_tower, 2e-5),  # its highest modes are stiff for ode3
        (highway_bridge, 1e-3),
        pytest.param(whole_bridge, 1e-3, marks=needs_data),
    ],
)
def test_a_full_size_participant_leaves(
    make: Callable[[], Participant],
    h: float,
    version: str,
    tmp_path: Path,
    fmutool_says: Callable[[Path], str],
) -> None:
    check_leaves(make(), version, tmp_path, fmutool_says, h)
