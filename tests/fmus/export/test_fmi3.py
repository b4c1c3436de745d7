"""FMI 3.0: arrays as arrays, and the same answers to misuse as in FMI 2.0.

What both versions share (evaluation, states, derivatives) is one core, tested through FMI 2.0;
here is what the front end of FMI 3.0 adds.
"""

from __future__ import annotations

import ctypes
import subprocess
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu

from cosim import Array, Continuous, Input, Output, State
from fmus.export import export
from tests.fmus.export.host import ERROR, OK, Accumulator, building, convert
from tests.fmus.export.linear import EXACT, linear_building, linear_oscillator, relative

LOGGER = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)
CS, ME = "CoSimulation", "ModelExchange"
NO = ctypes.c_bool(False)
ONE = np.uint64(1)


@dataclass
class Host3:
    """An FMI 3.0 library with one instance; every call returns the status."""

    path: Path
    library: ctypes.CDLL
    log: list[tuple[int, str, str]] = field(default_factory=list)
    instance: int | None = None

    def __post_init__(self) -> None:
        self.description = read_model_description(str(self.path))
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.token = self.description.guid.encode()
        self.logger = LOGGER(lambda _, s, c, m: self.log.append((s, c.decode(), m.decode())))

    def instantiate(
        self, kind: str = CS, token: bytes | None = None, *, event_mode: bool = False
    ) -> int | None:
        function = getattr(self.library, f"fmi3Instantiate{kind}")
        function.restype = ctypes.c_void_p
        token = self.token if token is None else token
        first = (b"it", token, None, NO, ctypes.c_bool(True))
        steps = (ctypes.c_bool(event_mode), NO, None, ctypes.c_size_t(0)) if kind == CS else ()
        self.instance = function(*first, *steps, None, self.logger, None, None, None)
        return self.instance

    def call(self, name: str, *arguments: Any) -> int:
        return int(
            getattr(self.library, f"fmi3{name}")(ctypes.c_void_p(self.instance), *map(convert, arguments))
        )

    def initialise(self, stop: float | None = None) -> int:
        status = self.call(
            "EnterInitializationMode", NO, 0.0, 0.0, ctypes.c_bool(stop is not None), stop or 0.0
        )
        return status or self.call("ExitInitializationMode")

    def setup(self, kind: str = CS) -> None:
        self.instantiate(kind)
        assert self.initialise() == OK

    def set(self, name: str | int, *values: float) -> int:
        reference = name if isinstance(name, int) else self.variables[name].valueReference
        return self.call("SetFloat64", np.uint32([reference]), ONE, np.array(values), np.uint64(len(values)))

    def get(self, *names: str) -> Array:
        references = np.uint32([self.variables[n].valueReference for n in names])
        size = sum(int(np.prod(self.variables[n].shape or (1,))) for n in names)
        values = np.zeros(size)
        assert self.call("GetFloat64", references, np.uint64(len(names)), values, np.uint64(size)) == OK, (
            self.log
        )
        return values

    def step(self, t: float, h: float) -> int:
        flags, last = (ctypes.c_bool * 3)(True, True, True), np.full(1, np.nan)
        places = [ctypes.byref(flags, i) for i in range(3)]
        status = self.call("DoStep", t, h, ctypes.c_bool(True), *places, last)
        if status == OK:
            assert (list(flags), last[0]) == ([False] * 3, t + h)
        return status

    def free(self) -> None:
        if self.instance:
            self.library.fmi3FreeInstance(ctypes.c_void_p(self.instance))
        self.instance = None


@pytest.fixture
def host3(fmu_of: Callable[..., Path], tmp_path: Path) -> Iterator[Callable[[str], Host3]]:
    hosts: list[Host3] = []

    def give(name: str) -> Host3:
        path = fmu_of(name, "3.0")
        with zipfile.ZipFile(path) as archive:
            library = next(n for n in archive.namelist() if n.startswith("binaries/"))
            place = archive.extract(library, tmp_path / str(len(hosts)))
        hosts.append(Host3(path, ctypes.CDLL(place)))
        return hosts[-1]

    yield give
    for h in hosts:
        h.free()


def test_arrays_are_arrays(fmu_of: Callable[..., Path]) -> None:
    variables = {v.name: v for v in read_model_description(str(fmu_of("accumulator", "3.0"))).modelVariables}
    assert list(variables) == ["time", "u", "y", "s", "K"]
    K = variables["K"]
    assert (tuple(K.shape), K.unit, K.max, K.start) == ((2, 3), "N/m", "10.0", "1.0 2.0 3.0 4.0 5.0 6.0")
    assert variables["time"].causality == "independent"


def test_values_go_in_and_out_as_arrays(host3: Callable[[str], Host3]) -> None:
    h, kernel = host3("accumulator"), Accumulator(m=2, n=3)
    h.instantiate()
    assert h.set("K", 0.5, -1.0, 2.0, 3.0, 0.25, -4.0) == OK
    assert h.set("s", 10.0, 20.0) == OK
    assert h.initialise() == OK
    kernel.K[:] = [[0.5, -1.0, 2.0], [3.0, 0.25, -4.0]]
    kernel.s[:] = [10.0, 20.0]
    for k, u in enumerate(np.random.default_rng(5).normal(size=(50, 3))):
        kernel.u[:] = u
        kernel.step(k * 0.1, 0.1)
        assert h.set("u", *u) == OK
        assert h.step(k * 0.1, 0.1) == OK
        assert list(h.get("s", "u", "y")) == [*kernel.s, *u, *kernel.y]
    assert h.get("time")[0] == pytest.approx(5.0)


MISUSE: list[tuple[str, str | None, Callable[[Host3], int], str]] = [
    ("too few values", CS, lambda h: h.set("force", 1.0), "1 values for variables of 3 elements"),
    (
        "too many values",
        CS,
        lambda h: h.set("force", 1.0, 2.0, 3.0, 4.0),
        "4 values for variables of 3 elements",
    ),
    ("reference inside an array", CS, lambda h: h.set(2, 1.0), "unknown value reference 2"),
    ("set the time", CS, lambda h: h.set("time", 1.0), "unknown value reference"),
    ("set an output", CS, lambda h: h.set("drift", 1.0, 2.0, 3.0), "output drift cannot be set at all"),
    ("NaN in an element", CS, lambda h: h.set("force", 1.0, np.nan, 3.0), "force[2] = nan is not finite"),
    ("bound of an element", None, lambda h: h.set("m", 1.0, 2.0, -3.0), "m[3] = -3 is outside [1e-12, inf]"),
    ("step too early", None, lambda h: h.step(0.0, 0.1), "instantiated"),
    ("no step", CS, lambda h: h.step(0.0, 0.0), "step 0 is not positive"),
    (
        "step without room for answers",
        CS,
        lambda h: h.call("DoStep", 0.0, 0.1, NO, None, None, None, None),
        "is NULL",
    ),
    ("initialise twice", CS, lambda h: h.initialise(), "step mode"),
    ("step mode", CS, lambda h: h.call("EnterStepMode"), "not allowed now"),
    ("event mode in Co-Simulation", CS, lambda h: h.call("EnterEventMode"), "step mode"),
    ("configuration", None, lambda h: h.call("EnterConfigurationMode"), "no structural parameters"),
    ("a clock", CS, lambda h: h.call("GetClock", np.uint32([0]), ONE, np.zeros(1)), "no clocks"),
    ("an integer", CS, lambda h: h.call("GetInt32", np.uint32([0]), ONE, np.zeros(1), ONE), "are Float64"),
    ("binary data", CS, lambda h: h.call("GetBinary", np.uint32([0]), ONE, None, None, ONE), "are Float64"),
    ("answers NULL", ME, lambda h: h.call("UpdateDiscreteStates", *[None] * 6), "eventTime is NULL"),
    (
        "states of another number",
        ME,
        lambda h: h.call("GetContinuousStates", np.zeros(2), np.uint64(2)),
        "6 states",
    ),
    (
        "adjoint",
        CS,
        lambda h: h.call("GetAdjointDerivative", *[None, np.uint64(0)] * 4),
        "adjoint derivatives are not supported",
    ),
    (
        "seed too short",
        CS,
        lambda h: derivative(h, ["base_shear"], ["x"], np.ones(2))[0],
        "2 values for knowns of 3",
    ),
]


@pytest.mark.parametrize(("kind", "call", "says"), [m[1:] for m in MISUSE], ids=[m[0] for m in MISUSE])
def test_misuse_is_an_error_with_a_reason(
    host3: Callable[[str], Host3], kind: str | None, call: Callable[[Host3], int], says: str
) -> None:
    h = host3("building")
    h.instantiate(kind or CS)
    if kind:
        h.initialise()
    h.log.clear()
    assert call(h) == ERROR
    assert [(status, category) for status, category, _ in h.log] == [(ERROR, "logStatusError")]
    assert says in h.log[0][2]
    assert h.call("Reset") == OK
    assert h.initialise() == OK


def test_instantiation_that_cannot_be(host3: Callable[[str], Host3]) -> None:
    h = host3("oscillator")
    assert h.instantiate(token=b"other") is None
    assert h.instantiate(event_mode=True) is None
    assert h.instantiate("ScheduledExecution") is None
    said = [line[2] for line in h.log]
    assert "is not that of this library" in said[0]
    assert "hasEventMode is false" in said[1]
    assert "has no interface for this kind of simulation" in said[2]


def test_every_function_is_there_and_survives_a_null_instance(host3: Callable[[str], Host3]) -> None:
    h = host3("oscillator")
    command = ["nm", "-D", "--defined-only", h.library._name]
    listing = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    functions = {line.split()[-1] for line in listing.splitlines()}
    assert len(functions) == 75  # the functions of FMI 3.0, and no other symbol
    for name in functions - {"fmi3GetVersion", "fmi3FreeInstance"}:
        if not name.startswith("fmi3Instantiate"):
            assert getattr(h.library, name)(*[ctypes.c_void_p(None)] * 12) == ERROR, name
    h.library.fmi3FreeInstance(None)
    h.library.fmi3GetVersion.restype = ctypes.c_char_p
    assert h.library.fmi3GetVersion().startswith(b"3.0")


def derivative(h: Host3, unknown: list[str], known: list[str], seed: Array) -> tuple[int, Array]:
    def references(names: list[str]) -> tuple[Any, Any]:
        return np.uint32([h.variables[n].valueReference for n in names]), np.uint64(len(names))

    size = sum(int(np.prod(h.variables[n].shape or (1,))) for n in unknown)
    result = np.zeros(size)
    status = h.call(
        "GetDirectionalDerivative", *references(unknown), *references(known),
        seed, np.uint64(seed.size), result, np.uint64(size),
    )  # fmt: skip
    return status, result


def test_directional_derivatives_by_arrays(host3: Callable[[str], Host3]) -> None:
    """To 1e-9: the difference quotient divides rounding (1e-16) by its width (1e-6)."""
    A, B, C, D = linear_building()
    h = host3("building")
    h.setup(ME)
    seed = np.random.default_rng(2).normal(size=10)
    jacobian = np.vstack([np.hstack([A, B])[3:], np.hstack([C, D])[:4]])
    status, found = derivative(
        h, ["der(v)", "acceleration", "base_shear"], ["x", "v", "ground_acceleration", "force"], seed
    )
    assert status == OK
    assert np.abs(found - jacobian @ seed).max() < 1e-9 * np.abs(jacobian).max()


def test_a_state_as_bytes_in_another_instance(host3: Callable[[str], Host3]) -> None:
    h, other = host3("building"), host3("building")
    h.setup()
    h.set("force", 1.0, 2.0, 3.0)
    h.step(0.0, 0.3)
    state, size, copy = ctypes.c_void_p(), ctypes.c_size_t(), ctypes.c_void_p()
    assert h.call("GetFMUState", ctypes.byref(state)) == OK
    assert h.call("SerializedFMUStateSize", state, ctypes.byref(size)) == OK
    data = np.zeros(size.value, dtype=np.uint8)
    assert h.call("SerializeFMUState", state, data, np.uint64(data.size)) == OK
    assert h.call("FreeFMUState", ctypes.byref(state)) == OK
    other.instantiate()
    assert other.call("DeserializeFMUState", data, np.uint64(data.size), ctypes.byref(copy)) == OK
    assert other.call("SetFMUState", copy) == OK
    assert other.call("FreeFMUState", ctypes.byref(copy)) == OK
    for each in (h, other):
        assert each.step(0.3, 0.2) == OK
    assert list(h.get("acceleration", "x")) == list(other.get("acceleration", "x"))


def test_number_of_states_and_event_indicators(host3: Callable[[str], Host3]) -> None:
    h = host3("building")
    h.instantiate(ME)
    n = ctypes.c_size_t()
    assert h.call("GetNumberOfContinuousStates", ctypes.byref(n)) == OK
    assert n.value == 6
    assert h.call("GetNumberOfEventIndicators", ctypes.byref(n)) == OK
    assert n.value == 0


def test_model_exchange_in_fmpy(fmu_of: Callable[..., Path]) -> None:
    """Forward Euler is x + h f(x): the same recursion in NumPy, to rounding."""
    A, B, _, _ = linear_oscillator()
    result = simulate_fmu(
        str(fmu_of("oscillator", "3.0")), fmi_type=ME, solver="Euler", step_size=0.01, output_interval=0.01,
        stop_time=10.0, start_values={"u": 2.0}, output=["x", "v"],
    )  # fmt: skip
    x = np.array([14.0, 25.0])
    for _ in range(1000):
        x = x + 0.01 * (A @ x + B @ np.array([2.0, 0.0]))
    assert relative(np.array([[result["x"][-1], result["v"][-1]]]), x[None]) < EXACT


def test_co_simulation_in_fmpy_with_array_parameters(fmu_of: Callable[..., Path]) -> None:
    """A building twice as heavy and as stiff moves the same under its ground."""
    path = str(fmu_of("building", "3.0"))
    start = {"ground_acceleration": 1.0}
    options: dict[str, Any] = {
        "fmi_type": CS,
        "stop_time": 1.0,
        "output_interval": 0.01,
        "output": ["x", "base_shear"],
    }
    once = simulate_fmu(path, start_values=start, **options)
    heavy = start | {"m": [6.0, 4.0, 3.0], "k": [6000.0, 4000.0, 2000.0]}
    twice = simulate_fmu(path, start_values=heavy, **options)
    assert once["x"].shape == (101, 3)
    assert twice["x"][1] == pytest.approx(once["x"][1], rel=0.05)  # damping stays: half the ratio
    assert not np.allclose(twice["base_shear"], once["base_shear"])


class Timed(Continuous):
    """A variable with the name of the independent one"""

    time = Input("a port of that name", unit="s")
    x = State(unit="s^2")
    y = Output(unit="s")

    def derivatives(self, t: float) -> None:
        self.der_x = self.time

    def outputs(self, t: float) -> None:
        self.y = self.time + t


def test_the_independent_variable_finds_a_free_name(tmp_path: Path) -> None:
    path = export(Timed(), tmp_path / "t.fmu", fmi_version="3.0")
    independent = [
        v.name for v in read_model_description(str(path)).modelVariables if v.causality == "independent"
    ]
    assert independent == ["time_"]


def test_every_platform_has_its_folder(tmp_path: Path) -> None:
    platforms = {"x86_64-linux": "so", "aarch64-linux": "so", "aarch64-darwin": "dylib"}
    path = export(building(), tmp_path / "b.fmu", fmi_version="3.0", platforms=platforms)
    with zipfile.ZipFile(path) as archive:
        names = {n for n in archive.namelist() if n.startswith("binaries/")}
    assert names == {f"binaries/{name}/ShearBuilding.{suffix}" for name, suffix in platforms.items()}
