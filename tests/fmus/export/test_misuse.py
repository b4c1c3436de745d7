"""Every misuse of an exported FMI 2.0 FMU: status Error and one line in the log that says what, no crash.

A refused call changes nothing: after each the same instance still does its work.
"""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable

import numpy as np
import pytest

from tests.fmus.export.host import CO_SIMULATION, ERROR, MODEL_EXCHANGE, OK, Host

NULL = None
ONE = np.uint64(1)


def running(h: Host) -> None:
    h.setup()


def running_me(h: Host) -> None:
    h.setup(MODEL_EXCHANGE)


def instantiated(h: Host) -> None:
    h.instantiate()


def initializing(h: Host) -> None:
    h.instantiate()
    h.prepare()
    h.call("EnterInitializationMode")


def terminated(h: Host) -> None:
    h.setup()
    h.call("Terminate")


U, A, X, DER_X, M, LOCAL = 0, 2, 3, 5, "m", 9
value = np.zeros(1)

# (what, instance before, call, part of the log line)
MISUSE: list[tuple[str, Callable[[Host], None], Callable[[Host], int], str]] = [
    (
        "enter initialization without experiment",
        instantiated,
        lambda h: h.call("EnterInitializationMode"),
        "not allowed now",
    ),
    (
        "exit initialization first",
        instantiated,
        lambda h: h.call("ExitInitializationMode"),
        "not allowed now",
    ),
    ("step before initialization", instantiated, lambda h: h.step(0.0, 0.1), "instantiated"),
    ("step in initialization", initializing, lambda h: h.step(0.0, 0.1), "initialization mode"),
    ("step after the end", terminated, lambda h: h.step(0.0, 0.1), "terminated"),
    ("terminate twice", terminated, lambda h: h.call("Terminate"), "terminated"),
    ("read before initialization", instantiated, lambda h: h.read([A], value), "not allowed now"),
    ("experiment while running", running, lambda h: h.prepare(), "step mode"),
    ("step in Model Exchange", running_me, lambda h: h.step(0.0, 0.1), "event mode"),
    ("time in Co-Simulation", running, lambda h: h.call("SetTime", 1.0), "step mode"),
    (
        "states in event mode",
        running_me,
        lambda h: h.call("SetContinuousStates", np.zeros(2), np.uint64(2)),
        "event mode",
    ),
    ("unknown reference read", running, lambda h: h.read([4711], value), "unknown value reference 4711"),
    ("unknown reference written", running, lambda h: h.set((4711, 1.0)), "unknown value reference 4711"),
    ("reference of a local", running, lambda h: h.read([LOCAL], value), "unknown value reference 9"),
    ("write an output", running, lambda h: h.set((A, 1.0)), "output a cannot be set at all"),
    ("write a derivative", running, lambda h: h.set((DER_X, 1.0)), "derivative der(x) cannot be set at all"),
    ("write a state late", running, lambda h: h.set((X, 1.0)), "state x cannot be set now"),
    ("write a parameter late", running, lambda h: h.set((M, 1.0)), "parameter m cannot be set now"),
    ("parameter below its bound", instantiated, lambda h: h.set((M, -1.0)), "m = -1 is outside [1e-12, inf]"),
    ("NaN into an input", running, lambda h: h.set((U, np.nan)), "u = nan is not finite"),
    ("NaN into a parameter", instantiated, lambda h: h.set((M, np.nan)), "m = nan is not finite"),
    ("infinity into a state", instantiated, lambda h: h.set((X, np.inf)), "x = inf is not finite"),
    ("step of zero", running, lambda h: h.step(0.0, 0.0), "step 0 is not positive"),
    ("step backwards", running, lambda h: h.step(0.0, -0.1), "step -0.1 is not positive"),
    ("step of NaN", running, lambda h: h.step(0.0, float("nan")), "not finite"),
    (
        "step from another time",
        running,
        lambda h: h.step(5.0, 0.1),
        "step from t = 5, but the instance is at 0",
    ),
    ("start time of infinity", instantiated, lambda h: h.prepare(float("inf")), "not finite"),
    ("stop before start", instantiated, lambda h: h.prepare(2.0, 1.0), "stop time 1 is before start time 2"),
    ("references NULL", running, lambda h: h.call("GetReal", NULL, ONE, value), "valueReferences is NULL"),
    ("values NULL", running, lambda h: h.call("GetReal", np.uint32([U]), ONE, NULL), "values is NULL"),
    (
        "values NULL on writing",
        running,
        lambda h: h.call("SetReal", np.uint32([U]), ONE, NULL),
        "values is NULL",
    ),
    ("state pointer NULL", running, lambda h: h.call("GetFMUstate", NULL), "FMUState is NULL"),
    ("state NULL", running, lambda h: h.call("SetFMUstate", NULL), "FMUState is NULL"),
    (
        "serialise NULL",
        running,
        lambda h: h.call("SerializeFMUstate", NULL, NULL, np.uint64(0)),
        "FMUState is NULL",
    ),
    ("event info NULL", running_me, lambda h: h.call("NewDiscreteStates", NULL), "info is NULL"),
    (
        "number of states",
        running_me,
        lambda h: h.call("GetContinuousStates", np.zeros(9), np.uint64(9)),
        "9 values for 2 states",
    ),
    (
        "event indicators",
        running_me,
        lambda h: h.call("GetEventIndicators", np.zeros(9), np.uint64(9)),
        "0 event indicators",
    ),
    (
        "an Integer variable",
        running,
        lambda h: h.call("GetInteger", np.uint32([U]), ONE, value),
        "all variables are Real",
    ),
    (
        "a String variable",
        running,
        lambda h: h.call("SetString", np.uint32([U]), ONE, value),
        "all variables are Real",
    ),
    (
        "unknown log category",
        running,
        lambda h: h.call("SetDebugLogging", 1, ONE, (ctypes.c_char_p * 1)(b"logFish")),
        "logFish",
    ),
    ("categories NULL", running, lambda h: h.call("SetDebugLogging", 1, ONE, NULL), "categories is NULL"),
    ("cancel a step", running, lambda h: h.call("CancelStep"), "synchronous"),
    ("status of no step", running, lambda h: h.call("GetStatus", 0, value), "no step is pending"),
    (
        "input derivatives",
        running,
        lambda h: h.call("SetRealInputDerivatives", np.uint32([U]), ONE, np.int32([1]), value),
        "not interpolated",
    ),
    (
        "output derivatives",
        running,
        lambda h: h.call("GetRealOutputDerivatives", np.uint32([A]), ONE, np.int32([1]), value),
        "maxOutputDerivativeOrder",
    ),
    (
        "differentiate by an output",
        running,
        lambda h: h.call(
            "GetDirectionalDerivative", np.uint32([A]), ONE, np.uint32([A]), ONE, np.ones(1), value
        ),
        "a is not an input or state",
    ),
    (
        "differentiate an input",
        running,
        lambda h: h.call(
            "GetDirectionalDerivative", np.uint32([U]), ONE, np.uint32([X]), ONE, np.ones(1), value
        ),
        "u is not an output",
    ),
]


@pytest.mark.parametrize(("before", "call", "says"), [m[1:] for m in MISUSE], ids=[m[0] for m in MISUSE])
def test_misuse_is_an_error_with_a_reason_and_changes_nothing(
    host_of: Callable[[str], Host],
    before: Callable[[Host], None],
    call: Callable[[Host], int],
    says: str,
) -> None:
    h = host_of("oscillator")
    before(h)
    h.log.clear()
    assert call(h) == ERROR
    assert [(status, category) for status, category, _ in h.log] == [(ERROR, "logStatusError")]
    assert says in h.log[0][2]
    # still as good as new: reset, run, and get the numbers of an untouched instance
    assert h.call("Reset") == OK
    mode = MODEL_EXCHANGE if before is running_me else CO_SIMULATION
    h.prepare()
    assert h.call("EnterInitializationMode") == OK
    assert h.call("ExitInitializationMode") == OK
    if mode == CO_SIMULATION:
        assert h.step(0.0, 0.1) == OK
    other = host_of("oscillator")
    other.setup(mode)
    if mode == CO_SIMULATION:
        other.step(0.0, 0.1)
    assert h.get("x", "v", "a") == other.get("x", "v", "a")


def test_every_function_survives_a_null_instance(host_of: Callable[[str], Host]) -> None:
    h = host_of("oscillator")
    library = h.library._name
    names = subprocess.run(
        ["nm", "-D", "--defined-only", library], capture_output=True, text=True, check=True
    ).stdout
    functions = [line.split()[-1] for line in names.splitlines()]
    assert len(functions) == 44  # the functions of FMI 2.0, and no other symbol
    for name in functions:
        assert name.startswith("fmi2")
        if name in ("fmi2GetVersion", "fmi2GetTypesPlatform", "fmi2Instantiate", "fmi2FreeInstance"):
            continue
        zeros = [ctypes.c_void_p(None)] * 8  # an instance of NULL, and nothing for the rest
        assert getattr(h.library, name)(*zeros) == ERROR, name
    h.library.fmi2FreeInstance(None)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"guid": b"0000"}, "GUID 0000 is not that of this library"),
        ({"guid": None}, "GUID NULL"),
        ({"name": None}, "no name"),
        ({"name": b""}, "no name"),
    ],
)
def test_instantiation_with_wrong_arguments_gives_null_and_a_line_even_without_logging(
    host_of: Callable[[str], Host], arguments: dict[str, bytes | None], says: str
) -> None:
    h = host_of("oscillator")
    assert h.instantiate(logging=0, **arguments) is None  # type: ignore[arg-type]
    assert len(h.log) == 1
    assert says in h.log[0][2]


def test_a_block_has_no_model_exchange(host_of: Callable[[str], Host]) -> None:
    h = host_of("accumulator")
    assert h.instantiate(MODEL_EXCHANGE) is None
    assert "has no interface for Model Exchange" in h.log[0][2]


def test_instantiation_without_callbacks_gives_null(host_of: Callable[[str], Host]) -> None:
    h = host_of("oscillator")
    assert h.library.fmi2Instantiate(b"it", CO_SIMULATION, h.guid, None, None, 0, 1) is None


def test_logging_is_off_when_the_host_says_so(host_of: Callable[[str], Host]) -> None:
    h = host_of("oscillator")
    h.instantiate(logging=0)
    assert h.step(0.0, 0.1) == ERROR
    assert h.log == []
    errors = (ctypes.c_char_p * 1)(b"logStatusError")
    assert h.call("SetDebugLogging", 1, ONE, errors) == OK
    assert h.step(0.0, 0.1) == ERROR
    assert len(h.log) == 1
    h.prepare(), h.call("EnterInitializationMode"), h.call("ExitInitializationMode")
    assert len(h.log) == 1  # events are another category
    assert h.call("SetDebugLogging", 0, np.uint64(0), NULL) == OK
    assert h.step(0.0, 0.0) == ERROR
    assert len(h.log) == 1


def test_events_are_logged_as_information(host_of: Callable[[str], Host]) -> None:
    h = host_of("oscillator")
    h.setup()
    assert h.log == [(OK, "logEvents", "fmi2ExitInitializationMode: initialized at t = 0")]


def test_a_result_that_is_not_a_number_names_the_variable(host_of: Callable[[str], Host]) -> None:
    h = host_of("root")
    h.setup()
    h.log.clear()
    assert h.set(("u", -1.0)) == OK
    assert h.read(["y"], value) == ERROR
    assert h.log[0][2].startswith("fmi2GetReal: y became")
    assert "nan at t = 0" in h.log[0][2]
    assert h.set(("u", 4.0)) == OK  # the state is untouched: with another input it goes on
    assert h.get("y") == [4.0]


def test_a_state_that_overflows_stops_the_instance(host_of: Callable[[str], Host]) -> None:
    h = host_of("root")
    h.setup()
    h.log.clear()
    assert h.step(0.0, 1e200) == ERROR  # one Runge-Kutta step of that size leaves the range of doubles
    assert "x became" in h.log[0][2]
    assert h.log[0][2].startswith("fmi2DoStep")
    assert h.step(1e200, 0.1) == ERROR
    assert "stopped by an error" in h.log[1][2]
    assert h.call("Reset") == OK
    h.prepare(), h.call("EnterInitializationMode"), h.call("ExitInitializationMode")
    assert h.step(0.0, 0.1) == OK


def test_stop_time_is_not_passed(host_of: Callable[[str], Host]) -> None:
    h = host_of("oscillator")
    h.setup(stop=1.0)
    assert h.step(0.0, 0.75) == OK
    h.log.clear()
    assert h.step(0.75, 0.5) == ERROR
    assert "passes the stop time" in h.log[0][2]
    assert h.step(0.75, 0.25) == OK


def test_elements_of_arrays_are_named_in_messages(host_of: Callable[[str], Host]) -> None:
    h = host_of("accumulator")
    h.instantiate()
    assert h.set(("K[2,3]", 11.0)) == ERROR
    assert "K[2,3] = 11 is outside [-inf, 10]" in h.log[0][2]
    assert h.set(("u[3]", np.nan)) == ERROR
    assert "u[3] = nan is not finite" in h.log[1][2]


def test_all_values_of_a_refused_call_are_left_alone(host_of: Callable[[str], Host]) -> None:
    h = host_of("oscillator")
    h.setup()
    assert h.set(("u", 1.0), ("d", 2.0)) == OK
    assert h.set(("u", 7.0), ("d", np.inf)) == ERROR
    assert h.get("u", "d") == [1.0, 2.0]
