"""The schedule as text: the operations at a communication point, in their order."""

from __future__ import annotations

import pytest

from cosim import Block, Continuous, Input, Output, State, System, WiringError, schedule, simulate
from tests.cosim.parts import Gain, Integrator, Mass, Ramp, Through


class Called(Gain):
    """A block that stays Python."""

    compiled = False


def lines(text: str) -> str:
    return "\n".join(line.strip() for line in text.strip().splitlines())


def check(system: System, wanted: str, **options) -> None:
    assert lines(schedule(system, step=0.01, **options)) == lines(wanted)


def test_sampled_coupling_reads_runs_latches_advances():
    system = System(
        {"plant": Mass(), "control": Gain()}, [("plant.x", "control.x"), ("control.u", "plant.u")]
    )
    check(
        system,
        """sampled coupling
        at t_k:
        plant: outputs
        control.x <- plant.x
        control: step
        to t_k+1:
        plant.u <- control.u
        plant: advance""",
    )


def test_blocks_run_in_the_order_of_their_connections_not_of_their_insertion():
    system = System(
        {"last": Gain(), "middle": Gain(), "first": Ramp()}, [("middle.u", "last.x"), ("first.u", "middle.x")]
    )
    check(
        system,
        """sampled coupling
        at t_k:
        first: step
        middle.x <- first.u
        middle: step
        last.x <- middle.u
        last: step
        to t_k+1:""",
    )


def test_all_inputs_are_latched_before_anything_advances():
    """Two plants in a ring: each holds the other's state at t_k, whichever is named first."""
    system = System({"a": Mass(), "b": Mass()}, [("a.x", "b.u"), ("b.v", "a.u")])
    check(
        system,
        """sampled coupling
        at t_k:
        a: outputs
        b: outputs
        to t_k+1:
        a.u <- b.v
        b.u <- a.x
        a: advance
        b: advance""",
    )


def test_rates_and_callbacks_are_named():
    system = System(
        {"slow": Gain(every=3), "timed": Gain(sample_period=0.05), "python": Called(), "source": Ramp()},
        [("source.u", "slow.x"), ("slow.u", "timed.x"), ("timed.u", "python.x")],
    )
    check(
        system,
        """sampled coupling
        at t_k:
        source: step
        slow.x <- source.u (every 3)
        slow: step (every 3)
        timed.x <- slow.u (every 5)
        timed: step (every 5)
        python.x <- timed.u
        python: step (Python callback)
        to t_k+1:""",
    )


def test_a_delayed_connection_is_kept_at_t_k_and_breaks_the_cycle():
    system = System({"a": Gain(), "b": Gain()}, [("a.u", "b.x")])
    system.connect("b.u", "a.x", initial=4.0)
    check(
        system,
        """sampled coupling
        at t_k:
        a.x <- b.u (one step late)
        a: step
        b.x <- a.u
        b: step
        keep b.u for the next step
        to t_k+1:""",
    )


def test_stage_coupling_runs_blocks_at_every_stage():
    system = System(
        {"plant": Mass(), "control": Gain(), "slow": Gain(every=2)},
        [("plant.x", "control.x"), ("control.u", "plant.u"), ("plant.v", "slow.x")],
    )
    check(
        system,
        """stage coupling, ode2
        at t_k:
        plant: outputs
        control.x <- plant.x
        control: step
        slow.x <- plant.v (every 2)
        slow: step (every 2)
        to t_k+1:
        plant.u <- control.u
        plant: derivatives
        plant: states of stage 2
        plant: outputs
        control.x <- plant.x
        control: step
        plant.u <- control.u
        plant: derivatives
        plant: states at t + h""",
        coupling="continuous",
        solver="ode2",
    )


def test_stage_coupling_reads_a_feedthrough_output_after_its_input():
    """x is read early for the block, y = u + x late, and only then the block that needs y."""
    system = System(
        {"watch": Gain(), "plant": Through(), "control": Gain()},
        [("plant.x", "control.x"), ("control.u", "plant.u"), ("plant.y", "watch.x")],
    )
    check(
        system,
        """stage coupling, ode1
        at t_k:
        plant: outputs
        control.x <- plant.x
        control: step
        plant.u <- control.u
        plant: outputs
        watch.x <- plant.y
        watch: step
        to t_k+1:
        plant.u <- control.u
        plant: derivatives
        plant: states at t + h""",
        coupling="continuous",
        solver="ode1",
    )


class TwoInputs(Through):
    """y = u + x depends on u; z = d on the disturbance."""

    d = Input()
    z = Output()

    def outputs(self, t):
        self.y = self.u + self.x
        self.z = self.d


def test_outputs_of_one_participant_are_ordered_one_by_one():
    """The force follows z = d, and y = u + x follows the force: no algebraic loop, as it might seem."""
    system = System(
        {"plant": TwoInputs(), "source": Ramp(), "control": Gain(), "watch": Gain()},
        [("source.u", "plant.d"), ("plant.z", "control.x"), ("control.u", "plant.u"), ("plant.y", "watch.x")],
    )
    text = schedule(system, step=0.01, coupling="continuous", solver="ode1")
    steps = [line.strip() for line in text.splitlines() if "step" in line]
    assert steps == ["source: step", "control: step", "watch: step"]


def test_feedthrough_in_a_ring_is_an_algebraic_loop_of_stage_coupling_only():
    system = System(
        {"plant": Through(), "control": Gain()}, [("plant.y", "control.x"), ("control.u", "plant.u")]
    )
    assert "control: step" in schedule(system, step=0.01)
    with pytest.raises(
        WiringError, match=r"plant\.y -> control\.x, control\.u -> plant\.u|control\.u -> plant"
    ):
        schedule(system, step=0.01, coupling="continuous")


class Adder(Block):
    """u = a + b"""

    a = Input()
    b = Input()
    u = Output()

    def step(self, t, h):
        self.u = self.a + self.b


def test_statistics_and_records_come_after_the_blocks():
    system = System({"i": Integrator(), "sum": Adder()}, [("i.x", "sum.a"), ("i.y", "sum.b")])
    result = simulate(system, step=0.5, stop=1.0, record=["sum.u"], statistics=["i.x", "sum.u"], decimation=2)
    assert result.schedule.splitlines()[-5:] == [
        "  sum: step",
        "  statistics of i.x, sum.u",
        "  record sum.u (every 2)",
        "to t_k+1:",
        "  i: advance",
    ]


class Quotient(Continuous):
    """x' = -x, y = x / u: not a number before u is set"""

    u = Input()
    x = State(2.0)
    y = Output()

    def derivatives(self, t):
        self.der_x = -self.x

    def outputs(self, t):
        self.y = self.x / self.u


def test_an_output_that_waits_for_its_input_may_be_anything_until_then():
    """x is read for the gain before u is known; 2 / (-2 x) at the start is -0.5."""
    system = System({"q": Quotient(), "g": Gain(K=-2.0)}, [("q.x", "g.x"), ("g.u", "q.u")])
    result = simulate(system, step=0.1, stop=0.3, coupling="continuous", record=["q.y"])
    assert result["q.y"] == pytest.approx([-0.5] * 4)
