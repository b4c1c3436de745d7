"""Get, set, serialise and restore the state; reset; many instances; no growth."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fmus.export.host import CO_SIMULATION, ERROR, MODEL_EXCHANGE, OK, Host

OUTPUTS = ("acceleration[1]", "acceleration[3]", "base_shear", "x[2]", "v[3]")
moves = st.lists(st.tuples(st.floats(-10.0, 10.0), st.floats(1e-4, 0.5)), min_size=1, max_size=6)
in_one_process = settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def run(h: Host, t: float, path: list[tuple[float, float]]) -> tuple[float, list[list[float]]]:
    """Drive a building; return the time that is reached and all outputs on the way."""
    rows = []
    for ground, step in path:
        assert h.set(("ground_acceleration", ground)) == OK
        assert h.step(t, step) == OK, h.log
        t += step
        rows.append(h.get(*OUTPUTS))
    return t, rows


def save(h: Host) -> ctypes.c_void_p:
    state = ctypes.c_void_p()
    assert h.call("GetFMUstate", ctypes.byref(state)) == OK
    return state


def serialise(h: Host, state: ctypes.c_void_p) -> np.ndarray:
    size = ctypes.c_size_t()
    assert h.call("SerializedFMUstateSize", state, ctypes.byref(size)) == OK
    data = np.zeros(size.value, dtype=np.uint8)
    assert h.call("SerializeFMUstate", state, data, np.uint64(data.size)) == OK
    return data


def restore(h: Host, data: np.ndarray) -> int:
    state = ctypes.c_void_p()
    status = h.call("DeSerializeFMUstate", data, np.uint64(data.size), ctypes.byref(state))
    if status == OK:
        status = h.call("SetFMUstate", state)
        assert h.call("FreeFMUstate", ctypes.byref(state)) == OK
    return status


@in_one_process
@given(first=moves, second=moves)
def test_a_restored_state_continues_bit_for_bit(
    host_of: Callable[[str], Host], first: list[tuple[float, float]], second: list[tuple[float, float]]
) -> None:
    """In the same instance, and from bytes in another one."""
    h, other = host_of("building"), host_of("building")
    h.setup()
    t, _ = run(h, 0.0, first)
    state = save(h)
    data = serialise(h, state)
    _, expected = run(h, t, second)
    assert h.call("SetFMUstate", state) == OK
    assert run(h, t, second)[1] == expected
    assert h.call("FreeFMUstate", ctypes.byref(state)) == OK
    assert state.value is None
    other.instantiate()
    assert restore(other, data) == OK
    assert run(other, t, second)[1] == expected
    h.free(), other.free()


@in_one_process
@given(data=st.data())
def test_damaged_bytes_are_refused(host_of: Callable[[str], Host], data: st.DataObject) -> None:
    """Any damaged byte: of the header, of the record with its indices and matrices, of the checksum.

    The instance goes on from where it was, and other bytes of the same length are refused too.
    """
    h = host_of("building")
    h.setup()
    h.step(0.0, 0.1)
    state = save(h)
    whole = serialise(h, state)
    assert restore(h, whole) == OK
    damaged = whole.copy()
    for _ in range(data.draw(st.integers(1, 3))):
        damaged[data.draw(st.integers(0, whole.size - 1))] ^= data.draw(st.integers(1, 255))
    if (damaged != whole).any():
        assert restore(h, damaged) == ERROR
        assert "damaged" in h.log[-1][2]
    assert restore(h, np.zeros_like(whole)) == ERROR
    assert restore(h, whole[:-1]) == ERROR
    assert "bytes for a state" in h.log[-1][2]
    assert h.step(0.1, 0.1) == OK
    h.call("FreeFMUstate", ctypes.byref(state))
    h.free()


def test_a_state_of_another_model_is_refused(host_of: Callable[[str], Host]) -> None:
    h, other = host_of("oscillator"), host_of("building")
    h.setup(), other.setup()
    state = save(other)
    data = serialise(other, state)
    assert restore(h, data) == ERROR
    assert h.call("SetFMUstate", state) == ERROR
    assert "does not belong to Oscillator" in h.log[-1][2]
    other.call("FreeFMUstate", ctypes.byref(state))


def test_a_state_of_the_other_interface_is_refused(host_of: Callable[[str], Host]) -> None:
    h, other = host_of("oscillator"), host_of("oscillator")
    h.setup(CO_SIMULATION), other.setup(MODEL_EXCHANGE)
    state = save(other)
    assert h.call("SetFMUstate", state) == ERROR
    assert "other interface" in h.log[-1][2]
    other.call("FreeFMUstate", ctypes.byref(state))


def test_a_state_from_before_initialisation_keeps_what_was_set(host_of: Callable[[str], Host]) -> None:
    h = host_of("oscillator")
    h.instantiate()
    h.set(("k", 5.0))
    state = save(h)
    h.set(("k", 6.0))
    assert h.call("SetFMUstate", state) == OK
    h.prepare(), h.call("EnterInitializationMode")
    assert h.get("k", "a") == [5.0, -0.001 * 25.0 - 5.0 * 14.0]
    h.call("FreeFMUstate", ctypes.byref(state))


def test_a_state_can_be_saved_into_an_old_one(host_of: Callable[[str], Host]) -> None:
    h = host_of("oscillator")
    h.setup()
    state = save(h)
    place = state.value
    h.step(0.0, 0.5)
    expected = h.get("x", "v")
    assert h.call("GetFMUstate", ctypes.byref(state)) == OK
    assert state.value == place
    h.step(0.5, 0.5)
    assert h.call("SetFMUstate", state) == OK
    assert h.get("x", "v") == expected
    h.call("FreeFMUstate", ctypes.byref(state))


def test_reset_repeats_the_run_bit_for_bit(host_of: Callable[[str], Host]) -> None:
    h = host_of("building")
    path = [(float(g), 0.01) for g in np.random.default_rng(4).normal(size=300)]
    h.setup(stop=10.0)
    _, expected = run(h, 0.0, path)
    for _ in range(2):
        assert h.call("Reset") == OK
        assert h.prepare() == OK
        assert h.call("EnterInitializationMode") == OK
        assert h.call("ExitInitializationMode") == OK
        assert h.get(*OUTPUTS) == [0.0] * 5
        assert run(h, 0.0, path)[1] == expected


def test_reset_forgets_parameters_too(host_of: Callable[[str], Host]) -> None:
    h = host_of("oscillator")
    h.instantiate()
    h.set(("m", 3.0), ("x", 1.0))
    assert h.call("Reset") == OK
    h.prepare(), h.call("EnterInitializationMode")
    assert h.get("m", "x") == [1.0, 14.0]


def test_instances_do_not_know_of_each_other(host_of: Callable[[str], Host]) -> None:
    """Two instances of one library in turns give what each gives alone."""
    alone = []
    paths = [[(g, 0.02)] * 20 for g in (1.0, -2.5)]
    h = host_of("building")
    for path in paths:
        h.setup()
        alone.append(run(h, 0.0, path)[1])
        h.free()
    h.setup()
    other = Host(h.path, h.library)
    other.setup()
    mixed: list[list[list[float]]] = [[], []]
    for k in range(20):
        for i, each in enumerate((h, other)):
            mixed[i] += run(each, k * 0.02, paths[i][k : k + 1])[1]
    other.free()
    assert mixed == alone  # the building does not know of time: bit for bit


def cycle(h: Host, times: int) -> None:
    for _ in range(times):
        h.setup()
        h.step(0.0, 0.01)
        h.get("x[1]")
        state = save(h)
        serialise(h, state)
        h.call("FreeFMUstate", ctypes.byref(state))
        h.call("Terminate")
        h.free()
        h.log.clear()


def memory_and_handles() -> tuple[int, int]:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE"), len(os.listdir("/proc/self/fd"))


@pytest.mark.parametrize("cycles", [1000, pytest.param(10_000, marks=pytest.mark.long)])
def test_cycles_do_not_grow(host_of: Callable[[str], Host], cycles: int) -> None:
    """Instantiate, initialise, step, save, free.

    An instance of the building holds 3 * 957 doubles (23 kB): one lost per cycle would be 23 MB
    in 1000, one lost state 8 MB. The bound of 2 MB is for what Python itself takes and keeps.
    """
    h = host_of("building")
    cycle(h, 200)  # what is allocated once
    memory, handles = memory_and_handles()
    cycle(h, cycles)
    more, handles_after = memory_and_handles()
    assert more - memory < 2_000_000
    assert handles_after == handles
