"""Isolated FMUs: the same bits as without isolation, and crashes that end only the run."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import textwrap
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from cosim import FMU, Block, FMUError, Output, Simulation, SimulationError, SnapshotError, System, simulate
from cosim.fmi.instance.drivers import load
from cosim.fmi.isolation.isolation import compile_support
from cosim.loop.signals import RunSignals
from fmus.export import export
from tests.cosim.fmi.ball import ball
from tests.cosim.fmi.crash import crash
from tests.cosim.fmi.metronome import metronome
from tests.cosim.fmi.probe import probe
from tests.cosim.parts import Chain, closed
from tests.processes import children

H = 0.0625  # a binary fraction: times are exact
GUARD = 300.0  # s after which a test that hangs fails; Python may have to compile on a busy machine
VERSIONS = ["2.0", "3.0"]
INTERFACES = ["CoSimulation", "ModelExchange"]


class One(Block):
    """u = 1"""

    u = Output()

    def step(self, t, h):
        self.u = 1.0


def driven(plant: FMU) -> System:
    return System({"plant": plant, "one": One()}, [("one.u", "plant.u")])


@pytest.fixture(autouse=True)
def nothing_is_left():
    """No test leaves a process, an open file or memory with a name."""
    files, shared = len(os.listdir("/proc/self/fd")), set(os.listdir("/dev/shm"))
    before = children(os.getpid())
    yield
    assert children(os.getpid()) <= before
    assert len(os.listdir("/proc/self/fd")) <= files
    assert set(os.listdir("/dev/shm")) <= shared
    assert "structcosim (deleted)" not in Path("/proc/self/maps").read_text()


def both(system_of, **options):
    """Run without and with isolation; assert the same bits."""
    plain, isolated = (simulate(system_of(flag), **options) for flag in (False, True))
    assert plain.signals.keys() == isolated.signals.keys()
    for name, values in plain.signals.items():
        assert np.array_equal(values, isolated[name]), name
    return plain


# --------------------------------------------------------------------------- the same bits


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("interface", INTERFACES)
def test_an_exported_plant(tmp_path, version, interface):
    path = export(Chain(), tmp_path / "chain.fmu", fmi_version=version, interfaces=[interface])
    result = both(lambda flag: closed(FMU(path, isolated=flag)), step=0.01, stop=3.0)
    assert np.ptp(result["plant.a"], axis=0).min() > 0.5


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("interface", INTERFACES)
def test_numbers_of_all_types_and_events(tmp_path, version, interface):
    path = probe(tmp_path / "probe.fmu", version)
    start = {"label": "façade", "r_in": 3.5, "i_in": -4} | ({"n": 3} if version == "3.0" else {})
    options = {"start": start, "interface": interface}
    both(lambda flag: System({"p": FMU(path, isolated=flag, **options)}), step=H, stop=4.0)


def test_events_that_cvode_finds(tmp_path):
    path = ball(tmp_path / "ball.fmu")
    result = both(lambda flag: System({"b": FMU(path, isolated=flag)}), step=H, stop=4.0)
    assert result["b.bounces"][-1] >= 2.0


def test_event_mode_text_and_binary_data(tmp_path):
    path = metronome(tmp_path / "metronome.fmu", event_mode=True)
    start = {"word": "grün", "data": b"\0\1\2"}
    both(lambda flag: System({"m": FMU(path, start=start, isolated=flag)}), step=0.1, stop=3.0)


def test_as_block(tmp_path):
    path = export(One(), tmp_path / "one.fmu")
    result = both(lambda flag: System({"b": FMU(path, as_block=True, isolated=flag)}), step=H, stop=1.0)
    assert result["b.u"][0] == 1.0


@pytest.mark.parametrize("version", VERSIONS)
def test_states_are_saved_restored_and_branched(tmp_path, version):
    path = export(Chain(), tmp_path / "chain.fmu", fmi_version=version)
    with Simulation(closed(FMU(path, isolated=True)), step=0.01) as simulation:
        simulation.run(1.0)
        there = simulation.snapshot()
        assert there.portable
        first = simulation.run(2.0)
        simulation.restore(there)
        second = simulation.run(2.0)
        simulation.restore(there)
        with simulation.branch() as branch:  # in a process of its own
            third = branch.run(2.0)
    whole = simulate(closed(FMU(path)), step=0.01, stop=2.0)
    for result in (first, second, third):
        assert np.array_equal(result["plant.a"], whole["plant.a"][100:])


def test_a_state_whose_bytes_serve_in_one_process_only(tmp_path):
    """The states of the Reference FMUs are such: they contain the addresses of their vectors."""
    system = driven(crash(tmp_path))
    whole = simulate(system, step=H, stop=1.0)
    with Simulation(system, step=H) as simulation:
        simulation.run(0.5)
        there = simulation.snapshot()
        first = simulation.run(1.0)
        simulation.restore(there)  # in its own process the addresses are valid
        with pytest.raises(SnapshotError, match=r"crashed with SIGSEGV(.|\n)*without isolated=True"):
            simulation.branch()
        second = simulation.run(1.0)
    for result in (first, second):
        assert np.array_equal(result["plant.y"], whole["plant.y"][8:])


def test_several_instances_of_an_fmu_that_a_process_can_have_only_once(tmp_path):
    path = probe(tmp_path / "once.fmu", "2.0", once=True)
    members = {n: FMU(path, isolated=True, start={"r_in": float(i)}) for i, n in enumerate("abc")}
    result = simulate(System(members), step=H, stop=H)
    assert [result[f"{n}.r_out"][0] for n in "abc"] == [0.0, 2.0, 4.0]


# ------------------------------------------------------------------------ calls one by one


@contextmanager
def instance(fmu):
    """An isolated instance alone, to call its functions one by one."""
    driver = load(fmu, "p", False, RunSignals(), isolated=True)
    try:
        yield driver
        driver.free()
    finally:
        driver.close()


@pytest.mark.parametrize("version", VERSIONS)
def test_the_fmu_is_in_the_other_process_only(tmp_path, version):
    """FMPy finds the library differently for each version, and the same bits do not prove isolation."""

    def mapped(process: int) -> set[str]:
        lines = Path(f"/proc/{process}/maps").read_text().splitlines()
        return {line.split()[-1] for line in lines if "/probe.so" in line}

    before = mapped(os.getpid())  # those of earlier tests
    with instance(FMU(probe(tmp_path / "probe.fmu", version))):
        (child,) = children(os.getpid())
        assert mapped(child)
        assert mapped(os.getpid()) <= before


def test_strings_and_many_arguments(tmp_path):
    with instance(crash(tmp_path)) as driver:
        driver.api.setString([0, 1], ["façade", "x" * 30])
        assert driver.api.getString([0, 0]) == [("façade" + "x" * 30).encode()] * 2
        known, unknown, seed = [4, 5, 6], [1, 2], [0.0, 0.0, 0.25]
        assert list(driver.api.getDirectionalDerivative(unknown, known, seed)) == [160.25, 260.25]
        with pytest.raises(FMUError, match="the FMU's library has no function fmi2GetInteger"):
            driver.attempt("get its values", lambda: driver.api.getInteger([0]))


def test_binary_data_with_zeros_in_it(tmp_path):
    with instance(FMU(metronome(tmp_path / "m.fmu"), isolated=True)) as driver:
        for word, data in (("", b""), ("ein Wort", b"\0\1\2"), ("ü", b"ab\0")):
            driver.api.setString([40], [word])
            driver.api.setBinary([42], [data])
            assert driver.api.getString([41]) == [word + "!"]
            assert bytes(driver.api.getBinary([43])[0]) == data[::-1]
        with pytest.raises(
            FMUError, match="fmi3SetBinary passes more than the 255 MB that an isolated FMU has"
        ):
            driver.attempt("set its data", lambda: driver.api.setBinary([42], [bytes(1 << 28)]))


def test_no_line_of_the_log_is_lost(tmp_path):
    """500 lines in one call do not fit in the shared memory at once."""
    with pytest.raises(SimulationError, match="fmi2Error") as caught:
        simulate(driven(crash(tmp_path, "DoStep flood 0.5")), step=H, stop=1.0)
    lines = str(caught.value).splitlines()
    assert lines[-8:] == [f"  [warning] line {i}" for i in range(492, 500)]
    assert caught.value.result.time[-1] == 0.5


def test_a_failed_set_stops_the_step_that_it_is_sent_with(tmp_path):
    with pytest.raises(SimulationError, match=r"plant failed at t = 0\.5 s with fmi2Error") as caught:
        simulate(driven(crash(tmp_path, "none refuse 0.5")), step=H, stop=1.0)
    assert caught.value.result["plant.x"].tolist() == [k * H for k in range(9)]


def test_a_failed_set_among_more_than_fit_in_a_request_is_reported(tmp_path):
    """The third of 40 sets of the loop fails; a request has 16 calls, and sets do not wait for an answer."""
    with instance(crash(tmp_path, "none choosy 0")) as driver:
        set_real, get_real = driver.api.dll.loop_fmi2SetReal, driver.api.dll.loop_fmi2GetReal
        component, x = driver.api.component, (ctypes.c_uint32 * 1)(1)
        kinds = (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p)
        set_real.argtypes = get_real.argtypes = kinds
        statuses = [set_real(component, x, 1, (ctypes.c_double * 1)(i)) for i in range(1, 41)]
        assert statuses.count(3) == 1, statuses
        value = (ctypes.c_double * 1)()
        assert (get_real(component, x, 1, value), value[0]) == (0, 40.0)


ODD_CALLS = """
    import ctypes, sys
    from cosim import FMU
    from cosim.fmi.instance.drivers import load
    from cosim.fmi.isolation.isolation import _LOOK, _support
    from cosim.loop.signals import RunSignals

    fmu = FMU(sys.argv[1], isolated=True)
    driver = load(fmu, "p", False, RunSignals(), isolated=True)
    dll, c, vr = driver.api.dll, driver.api.component, (ctypes.c_uint32 * 1)(0)
    kinds = (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p)
    dll.loop_fmi2SetReal.argtypes = dll.loop_fmi2GetReal.argtypes = dll.fmi2SetString.argtypes = kinds
    dll.fmi2FreeInstance.argtypes = (ctypes.c_void_p,)
    dll.fmi2SetDebugLogging.argtypes = (ctypes.c_void_p, ctypes.c_int, ctypes.c_size_t, ctypes.c_void_p)
    print(dll.loop_fmi2SetReal(None, vr, 1, vr), dll.loop_fmi2GetReal(None, vr, 1, vr))
    print(dll.fmi2FreeInstance(None), dll.fmi2SetDebugLogging(c, 1, 2, None))
    print(dll.fmi2SetString(c, vr, 1, None), dll.fmi2SetString(c, vr, 1, None))
    driver.close()

    damaged = ctypes.create_string_buffer(1 << 20)
    caller = _support().caller_open(ctypes.addressof(damaged), 1 << 20, _LOOK(lambda *_: 0))
    for byte in (0x7F, 0xFF):
        ctypes.memset(damaged, byte, 1 << 20)
        print(_support().caller_function(caller), _support().caller_time(caller))
"""


def test_null_pointers_and_damaged_memory_do_not_crash_this_process(tmp_path):
    """The calls are made in another process, which would crash. The first string crashes the host."""
    fmu = crash(tmp_path)
    command = [sys.executable, "-c", textwrap.dedent(ODD_CALLS), str(fmu.path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=GUARD)
    assert done.stdout.split("\n") == ["3 3", "None 0", "4 4", "-1 nan", "-1 nan", ""], done.stderr


# --------------------------------------------------------------------------------- crashes

ENDS = {
    "null": r"crashed with SIGSEGV \(.*\)",
    "abort": r"crashed with SIGABRT \(.*\)",
    "exit": "ended its process with exit code 3",
}


@pytest.mark.parametrize("way", ENDS)
@pytest.mark.parametrize("function", ["DoStep", "GetReal", "SetReal"])
def test_a_crash_in_the_loop(tmp_path, function, way):
    """The result has the eight points before the crash, and the ninth if its outputs could be read."""
    plant = crash(tmp_path, f"{function} {way} 0.5")
    text = rf"^plant \(crash.fmu\) {ENDS[way]} in fmi2{function} at t = 0\.5 s; .* \(step \d\)"
    with pytest.raises(SimulationError, match=text) as caught:
        simulate(driven(plant), step=H, stop=1.0)
    assert f"[warning] {function} is at its fault, u = 1" in str(caught.value)
    result = caught.value.result
    assert result.time.tolist() == [k * H for k in range(8 if function == "GetReal" else 9)]
    assert result["plant.x"].tolist() == result.time.tolist()
    with pytest.raises(SimulationError, match=r"at t = 0\.5 s"):  # the FMU can be run again
        simulate(driven(plant), step=H, stop=1.0)
    assert simulate(driven(plant), step=H, stop=0.25)["plant.x"][-1] == 0.25


@pytest.mark.parametrize("function", ["GetDerivatives", "CompletedIntegratorStep"])
def test_a_crash_in_model_exchange(tmp_path, function):
    plant = crash(tmp_path, f"{function} null 0.53", "ModelExchange")
    text = rf"crashed with SIGSEGV .* in fmi2{function} at t = 0\.5[36]\d* s"
    with pytest.raises(SimulationError, match=text) as caught:
        simulate(driven(plant), step=H, stop=1.0)
    # equal to rounding, because the importer integrates x
    assert caught.value.result["plant.x"] == pytest.approx([k * H for k in range(9)], abs=1e-12)


@pytest.mark.parametrize("way", ENDS)
def test_a_crash_before_the_run(tmp_path, way):
    with pytest.raises(SimulationError, match=f"{ENDS[way]} in fmi2Instantiate, when it was to instantiate"):
        simulate(driven(crash(tmp_path, f"Instantiate {way}")), step=H, stop=1.0)
    text = f"{ENDS[way]} in fmi2ExitInitializationMode at t = 0 s, when it was to exit init"
    with pytest.raises(SimulationError, match=text) as caught:
        simulate(driven(crash(tmp_path, f"ExitInitializationMode {way}")), step=H, stop=1.0)
    assert len(caught.value.result.time) == 0


@pytest.mark.parametrize("function", ["Terminate", "FreeInstance"])
def test_a_crash_after_the_run_keeps_all_of_it(tmp_path, function):
    text = f"in fmi2{function} at t = 1 s, after the run, which is complete"
    with pytest.raises(SimulationError, match=text) as caught:
        simulate(driven(crash(tmp_path, f"{function} abort 0.5")), step=H, stop=1.0)
    assert caught.value.result.time[-1] == 1.0


def test_a_library_that_cannot_be_loaded(tmp_path):
    fmu = crash(tmp_path)
    next(fmu.directory.glob("binaries/*/crash.*")).write_bytes(b"no library")
    with pytest.raises(FMUError, match=r"the binary of .* cannot be loaded: .*crash"):
        simulate(driven(fmu), step=H, stop=1.0)


def test_a_crash_when_the_library_is_loaded(tmp_path, monkeypatch):
    monkeypatch.setenv("CRASH_AT_LOAD", "1")
    with pytest.raises(FMUError, match=r"cannot be loaded: crashed with SIGABRT \(.*\) when its library was"):
        simulate(driven(crash(tmp_path)), step=H, stop=1.0)


def test_runs_in_threads(tmp_path):
    """Each instance finds its own process."""
    plants = [crash(folder) for folder in (tmp_path / "a", tmp_path / "b", tmp_path / "c")]
    systems = [
        System({"plant": FMU(p.path, start={"u": 1.0 + i}, isolated=True)}) for i, p in enumerate(plants)
    ]
    with ThreadPoolExecutor(3) as pool:
        results = list(pool.map(lambda s: simulate(s, step=H, stop=2.0), systems))
    assert [r["plant.x"][-1] for r in results] == [2.0, 4.0, 6.0]


def test_twenty_runs(tmp_path):
    """The fixture `nothing_is_left` would find the process, file or memory that a run leaves."""
    plant = crash(tmp_path)
    for _ in range(20):
        assert simulate(driven(plant), step=H, stop=H)["plant.x"][-1] == H


# ---------------------------------------------------------------------------------- Ctrl-C

HANG = """
    import os, signal, sys, threading, time
    from cosim import FMU, System, simulate, Interrupted

    signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where tests run in the background
    plant = FMU(sys.argv[1], isolated=True)

    def press():
        while not os.path.exists(os.environ["CRASH_HANGS"]):
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=press).start()
    try:
        simulate(System({"plant": plant}), step=0.0625, stop=1.0)
    except Interrupted as interrupted:
        print("interrupted", len(interrupted.result.time))
    except KeyboardInterrupt:
        print("interrupted before")
"""


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("DoStep hang 0.5", "interrupted 9"),
        ("Instantiate hang", "interrupted before"),
        ("ExitInitializationMode hang", "interrupted 0"),
        ("Terminate hang", "interrupted 17"),
    ],
)
def test_ctrl_c_while_the_fmu_hangs(tmp_path, fault, said):
    """The signal goes to this process alone, as in a notebook; in a terminal, the FMU's process ignores it.

    The time limit is a guard, which a busy machine does not reach: a run without the signal never ends.
    """
    fmu = crash(tmp_path, fault)
    command = [sys.executable, "-c", textwrap.dedent(HANG), str(fmu.path)]
    env = os.environ | {"CRASH_HANGS": str(tmp_path / "hangs")}
    done = subprocess.run(command, capture_output=True, text=True, timeout=GUARD, env=env)
    assert done.stdout.strip() == said, done.stderr


def test_the_fmu_ends_with_the_process_that_runs_it(tmp_path):
    """The process is killed, as for a lack of memory, while the FMU hangs and cannot be asked to end."""
    fmu = crash(tmp_path, "DoStep hang 0.5")
    mark = tmp_path / "hangs"
    script = textwrap.dedent(HANG).replace("os.kill(", "(lambda *_: None)(")  # without Ctrl-C
    env = os.environ | {"CRASH_HANGS": str(mark)}
    parent = subprocess.Popen([sys.executable, "-c", script, str(fmu.path)], env=env)
    deadline = time.monotonic() + GUARD
    while not mark.exists():
        assert time.monotonic() < deadline, "the FMU has not come to its fault"
        time.sleep(0.05)
    fmus = children(parent.pid)
    assert len(fmus) == 1
    parent.kill()
    parent.wait()
    while any(Path(f"/proc/{pid}").exists() for pid in fmus):
        assert time.monotonic() < deadline, "the FMU's process has outlived its parent"
        time.sleep(0.05)


def test_the_c_code_compiles_without_a_warning(tmp_path):
    done, _ = compile_support(tmp_path, "-Wshadow", "-Werror")
    assert (done.returncode, done.stderr) == (0, "")


def test_after_a_fatal_answer_nothing_is_called(tmp_path):
    """This FMU crashes if it is freed after a fatal status, which `close` would report."""
    simulation = Simulation(driven(crash(tmp_path, "EnterInitializationMode fatal 0")), step=H)
    with pytest.raises(FMUError, match=r"fmi2EnterInitializationMode failed with status 4 \(fatal\)"):
        simulation.run(1.0)
    simulation.close()
