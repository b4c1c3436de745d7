"""An FMU in the loop: the same plant in Python and as FMU, and FMUs that cannot be used."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from cosim import (
    FMU,
    FMUError,
    ModelExchange,
    SimulationError,
    System,
    WiringError,
    simulate,
)
from fmus.export import DefaultExperiment, export
from tests.cosim.fmi.probe import changed
from tests.cosim.parts import Chain, Diverges, closed


@pytest.fixture(scope="module")
def fmu_path(tmp_path_factory):
    return export(Chain(), tmp_path_factory.mktemp("fmu") / "chain.fmu")


@pytest.mark.parametrize("options", [{}, {"coupling": "continuous", "solver": "ode4"}])
def test_python_and_fmu_give_the_same_trajectory(fmu_path, options):
    """CS by the same code; ME by the same Runge-Kutta: a few roundings of 1e-16 a step, 300 steps."""
    record = ["plant.a", "g.u"]
    runs = [
        simulate(closed(plant), step=0.01, stop=3.0, record=record, **options)
        for plant in (Chain(), FMU(fmu_path))
    ]
    for name in record:
        assert runs[1][name] == pytest.approx(runs[0][name], abs=1e-12)
    assert np.ptp(runs[0]["plant.a"], axis=0).min() > 0.5


def test_model_exchange_alone_is_integrated_in_substeps(tmp_path):
    path = export(Chain(), tmp_path / "me.fmu", interfaces=["ModelExchange"])
    result = simulate(
        closed(FMU(path, interface=ModelExchange(substeps=2))), step=0.02, stop=2.0, record=["plant.a"]
    )
    exact = simulate(closed(Chain()), step=0.02, stop=2.0, record=["plant.a"])
    # ode4 with h = 0.01: (2 h)^5 / 120 of error a step at most, over 200 steps; Euler would give 1e-2
    assert result["plant.a"] == pytest.approx(exact["plant.a"], abs=1e-8)


def test_start_values_of_parameters_and_of_unconnected_inputs(fmu_path):
    """u[2] is not connected: it keeps its start value at every step."""
    plant = Chain(k=5.0, u=[0.0, 1.5])
    fmu = FMU(fmu_path, start={"k": 5.0, "u": [0.0, 1.5]})
    runs = [simulate(closed(p), step=0.01, stop=1.0, record=["plant.a"]) for p in (plant, fmu)]
    assert runs[1]["plant.a"][1:] == pytest.approx(runs[0]["plant.a"][1:], abs=1e-12)


@pytest.mark.parametrize(
    ("start", "words"),
    [
        ({"kk": 1.0}, "no variable 'kk'; did you mean 'k'"),
        ({"k": "stiff"}, "start value k = 'stiff' must be a number with a unit"),
        ({"k": np.nan}, "does not fit type Real"),
        ({1: 2.0}, "has no variable '1'"),
        ([1.0, 2.0], r"start=\[1.0, 2.0\] has no names"),
        ({"u": [1.0, 2.0, 3.0]}, r"does not fit type Real of shape \(2,\)"),
    ],
)
def test_wrong_start_values_are_refused(fmu_path, start, words):
    with pytest.raises(FMUError, match=words):
        FMU(fmu_path, start=start)


def test_options_of_a_wrong_type(fmu_path):
    for interface in (["CoSimulation"], 2):
        with pytest.raises(FMUError, match=r"interface .* is not known"):
            FMU(fmu_path, interface=interface)
    with pytest.raises(FMUError, match="solver '4' is not known"):
        ModelExchange(solver=4)
    with pytest.raises(FMUError, match="None is not the path of an FMU"):
        FMU(None)


def test_further_start_values(fmu_path):
    """A copy with the values of both; the FMU that it comes from keeps its own."""
    fmu = FMU(fmu_path, start={"k": 2.0, "u": 1.0})
    more = fmu.with_start({"u": [3.0, 4.0]})
    assert more.start_values() == {"k": [2.0], "u[1]": [3.0], "u[2]": [4.0]}
    assert fmu.start_values() == {"k": [2.0], "u[1]": [1.0], "u[2]": [1.0]}
    with pytest.raises(FMUError, match="has no variable 'w'"):
        fmu.with_start({"w": 1.0})


def test_files_that_are_not_usable_fmus(fmu_path, tmp_path):
    def is_binary(name):
        return name.startswith("binaries/")

    before = Path.cwd()
    with pytest.raises(FMUError, match="there is no file"):
        FMU(tmp_path / "missing.fmu")
    (tmp_path / "text.fmu").write_text("no zip")
    with pytest.raises(FMUError, match="not a ZIP archive"):
        FMU(tmp_path / "text.fmu")
    for change, words in [
        (lambda name, old: None if name == "modelDescription.xml" else old, r"no modelDescription\.xml"),
        (lambda name, old: old.replace(b'fmiVersion="2.0"', b'fmiVersion="1.0"'), r"FMI version 1\.0"),
        (lambda name, old: None if is_binary(name) else old, "has no binary for .*available: none"),
    ]:
        with pytest.raises(FMUError, match=words):
            FMU(changed(tmp_path / "changed.fmu", fmu_path, change))
    broken = changed(tmp_path / "broken.fmu", fmu_path, lambda name, old: b"" if is_binary(name) else old)
    with pytest.raises(FMUError, match="cannot be loaded"):
        simulate(closed(FMU(broken)), step=0.1, stop=1.0)
    assert Path.cwd() == before  # FMPy would stay in the folder of the library


def test_stage_coupling_needs_model_exchange(tmp_path):
    path = export(Chain(), tmp_path / "cs.fmu", interfaces=["CoSimulation"])
    with pytest.raises(WiringError, match=r"plant \(cs\.fmu\) has no Model Exchange"):
        simulate(closed(FMU(path)), step=0.1, stop=1.0, coupling="continuous")


def test_many_runs_in_one_process_leave_nothing_behind(fmu_path):
    """After 300 runs, no more files are open, and the memory has grown by less than an instance per run."""
    system = closed(FMU(fmu_path))

    def used() -> tuple[int, int]:
        pages = int(open("/proc/self/statm").read().split()[1])  # noqa: SIM115
        return len(os.listdir("/proc/self/fd")), pages * os.sysconf("SC_PAGE_SIZE")

    for _ in range(50):
        simulate(system, step=0.1, stop=1.0)
    files, memory = used()
    for _ in range(300):
        simulate(system, step=0.1, stop=1.0)
    more_files, more_memory = used()
    assert more_files == files
    assert more_memory - memory < 10_000_000


def test_the_log_of_an_fmu_is_part_of_the_error(tmp_path):
    path = tmp_path / "diverges.fmu"
    export(Diverges(), path, interfaces=["ModelExchange"], experiment=DefaultExperiment(stop=0.1, step=0.01))
    with pytest.raises(SimulationError, match=r"(?s)plant failed at t = .*fmi2Error.*der\(x\) became inf"):
        simulate(System({"plant": FMU(path)}), step=0.1, stop=9.0, coupling="continuous", solver="ode1")


def test_lines_of_the_log_go_to_the_fmu_that_they_come_from(capsys):
    """FMPy's native proxy has room for one logger; with one per FMU, the last one would get all lines."""
    import gc

    from cosim.fmi.instance.fmi2_log import callbacks

    class Instance:
        def __init__(self):
            self.lines = []

        def note(self, status, message):
            self.lines.append((status, message))

    a, b = Instance(), Instance()
    of_a, of_b = callbacks(a), callbacks(b)
    of_a.logger(of_a.componentEnvironment, b"a", 1, b"", b"of a")
    of_b.logger(of_b.componentEnvironment, b"b", 3, b"", b"of b")
    assert (a.lines, b.lines) == ([(1, b"of a")], [(3, b"of b")])
    del b
    gc.collect()
    of_b.logger(of_b.componentEnvironment, b"b", 3, b"", b"too late")  # its instance is gone
    of_a.logger(None, b"another", 1, b"", b"of FMPy")
    assert capsys.readouterr().out == "[WARNING] of FMPy\n"


def test_start_values_cannot_be_changed_behind_their_check(fmu_path):
    """A start value written into the FMU after its check would be ignored in silence."""
    fmu = FMU(fmu_path)
    with pytest.raises(TypeError, match="does not support item assignment"):
        fmu.start["k"] = 2.0
    assert fmu.with_start({"k": 2.0}).start == {"k": 2.0}
    assert fmu.start == {}
