"""The driver of an FMU alone: failures of calls, in this process and in an isolated one."""

from __future__ import annotations

import ctypes

import pytest

from cosim import FMU, FMUError, SimulationError
from cosim.fmi.instance.continuous_time import ContinuousTime
from cosim.fmi.instance.drivers import load
from cosim.loop.signals import RunSignals
from tests.cosim.fmi.crash import crash
from tests.cosim.fmi.probe import probe


@pytest.fixture
def driver(tmp_path):
    """A driver of the FMU of c/probe2.c."""
    made = load(FMU(probe(tmp_path / "probe.fmu", "2.0")), "p", False, RunSignals())
    yield made
    made.free()
    made.close()


class Answers:
    """A function of a library that answers with a status."""

    restype = ctypes.c_int

    def __init__(self, status: int) -> None:
        self.status = status

    def __call__(self, *arguments: object) -> int:
        return self.status


def test_a_negative_status_is_a_failure(driver):
    """FMPy takes every status up to fmi2Warning for success."""
    driver.api._functions["fmi2SetReal"] = Answers(-1)
    with pytest.raises(FMUError, match=r"failed to set r_in = 2\.0: fmi2SetReal failed with status -1"):
        driver.set(driver.file.variables["r_in"], [2.0])
    assert driver.status == -1
    driver.api._functions["fmi2SetReal"] = Answers(1)
    driver.set(driver.file.variables["r_in"], [2.0])


def test_a_negative_status_of_an_isolated_fmu_is_an_error(tmp_path):
    p = load(crash(tmp_path, "none negative 0"), "p", False, RunSignals(), isolated=True)
    with pytest.raises(FMUError, match=r"failed to set u = 2\.0: fmi2SetReal failed with status 3"):
        p.set(p.file.variables["u"], [2.0])
    p.free()
    p.close()


def test_a_negative_status_in_continuous_time_is_a_failure(driver):
    model = ContinuousTime(driver, 1, 0)
    model._set_time = Answers(-1)
    with pytest.raises(SimulationError, match=r"p failed to set the time at t = 2 s with status -1"):
        model.set_time(2.0)


def test_a_failure_without_a_text_names_its_type(driver):
    """FMPy raises such an exception for a state that is larger than the memory."""

    def fail():
        raise MemoryError

    with pytest.raises(FMUError, match=r"failed to serialise its state: MemoryError without a message$"):
        driver.attempt("serialise its state", fail)


def test_a_string_that_is_null_is_empty(driver):
    driver.api.getString = lambda references: [None]
    assert driver.get("String", [0], 1) == [""]
