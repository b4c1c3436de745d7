"""The options of a run: checked once, when the plan is made."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from cosim import OptionError, System, TimeError, WiringError
from cosim.run.plan import RunPlan
from tests.cosim.parts import Gain, Mass


def test_numbers_and_names_get_one_type_each():
    plan = RunPlan(
        step=np.float32(0.5), start=2, record=["m.x"], statistics=iter(["m.v"]), decimation=np.int64(3)
    )
    assert (plan.step, plan.start, plan.decimation) == (0.5, 2.0, 3)
    assert [type(v) for v in (plan.step, plan.start, plan.decimation)] == [float, float, int]
    assert (plan.record, plan.statistics) == (("m.x",), ("m.v",))  # an iterator serves a branch too
    assert RunPlan(**vars(plan)) == plan


def test_a_plan_does_not_change():
    with pytest.raises(FrozenInstanceError):
        RunPlan(step=0.1).step = 0.2


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"step": 0.0}, TimeError),
        ({"start": float("inf")}, TimeError),
        ({"coupling": "stage"}, OptionError),
        ({"solver": "rk4"}, OptionError),
        ({"decimation": 0}, OptionError),
        ({"tolerance": 1.0}, OptionError),
        ({"record": "m.x"}, WiringError),
    ],
)
def test_the_error_fits_the_option(options, error):
    with pytest.raises(error, match=next(iter(options)) if error is not WiringError else "give a list"):
        RunPlan(**{"step": 0.1} | options)


def test_the_point_of_a_time_counts_from_the_start():
    plan = RunPlan(step=0.25, start=1.0)
    assert plan.point(2.0) == 4
    with pytest.raises(TimeError, match="is not after start=1 s"):
        plan.point(1.0)


def test_ports_to_record_and_to_watch():
    system = System({"m": Mass(), "g": Gain()}, [("m.x", "g.x"), ("g.u", "m.u")])
    names = [str(p) for p in RunPlan(step=0.1).recorded(system)]
    assert names == [f"m.{n}" for n in system.participants["m"].ports("output")] + ["g.u"]
    assert [str(p) for p in RunPlan(step=0.1).watched(system)] == names
    plan = RunPlan(step=0.1, record=["g.x"], statistics=["m.x"])  # an input: the value that was used
    assert [str(p) for p in plan.recorded(system)] == ["g.x"]
    assert [str(p) for p in plan.watched(system)] == ["m.x"]
