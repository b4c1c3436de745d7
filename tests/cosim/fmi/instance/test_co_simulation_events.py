"""Early return and event mode of Co-Simulation (FMI 3.0): the FMU of c/metronome.c, which is strict.

x runs from 0 to 1 at `rate` and goes back; all times and states are binary fractions, so exact.
"""

from __future__ import annotations

import numpy as np
import pytest
from fmpy.validation import validate_fmu

from cosim import FMU, Block, CoSimulation, FMUError, Output, SimulationError, System, simulate
from tests.cosim.fmi.metronome import metronome

H = 5 / 16
K = np.arange(33)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return metronome(tmp_path_factory.mktemp("metronome") / "metronome.fmu")


def test_the_fmu_is_valid(path, tmp_path):
    assert validate_fmu(str(path)) == []
    assert validate_fmu(str(metronome(tmp_path / "clocks.fmu", clocks=True))) == []


@pytest.mark.parametrize("early_return", [True, False])
@pytest.mark.parametrize("event_mode", [True, False, None])
def test_events_inside_steps(tmp_path, early_return, event_mode):
    """x = t mod 1 for every handling of events: in the step, at their instants, at the end of the step."""
    path = metronome(tmp_path / "m.fmu", early_return=early_return)
    fmu = FMU(path, interface=CoSimulation(event_mode))
    result = simulate(System({"m": fmu}), step=H, stop=32 * H)
    t = K * H
    assert list(result["m.x"]) == list(t % 1.0)
    assert list(result["m.wraps"]) == list(t // 1.0)
    assert list(result["m.beats"]) == list(t // 0.75)
    entered = np.zeros(33)
    if event_mode and early_return:  # one entry for every instant with an event
        instants = np.union1d(np.arange(1.0, 11.0), 0.75 * np.arange(1.0, 14.0))
        entered = np.searchsorted(instants, t, side="right")
    elif event_mode:  # wraps are handled at the next point, or with a beat before it
        assert result["m.entries"][-1] > 0
        return
    assert list(result["m.entries"]) == list(entered)


class Doubling(Block):
    """rate = 1 before t = 2.5 s, 2 from then on"""

    rate = Output()

    def step(self, t, h):
        self.rate = 1.0 if t < 2.5 else 2.0


@pytest.mark.parametrize("event_mode", [True, False])
@pytest.mark.parametrize("as_block", [False, True])
def test_discrete_inputs_are_set_when_they_change(path, event_mode, as_block):
    """The FMU refuses them in step mode, when it has an event mode; a block steps before it is read."""
    fmu = FMU(path, interface=CoSimulation(event_mode), as_block=as_block)
    result = simulate(System({"d": Doubling(), "m": fmu}, [("d.rate", "m.rate")]), step=H, stop=32 * H)
    t = K * H + (H if as_block else 0.0)
    moved = np.where(t < 2.5, t, 2.5 + 2.0 * (t - 2.5))
    assert list(result["m.x"]) == list(moved % 1.0)
    assert list(result["m.wraps"]) == list(moved // 1.0)


def test_a_step_over_several_events(path, tmp_path):
    """With four periods of x in a step, the events are handled one by one, or together at its end."""
    for early_return in (True, False):
        fmu = FMU(
            metronome(tmp_path / "m.fmu", early_return=early_return),
            interface=CoSimulation(event_mode=True),
            start={"rate": 4.0, "beat": 0.0},
        )
        result = simulate(System({"m": fmu}), step=1.125, stop=9.0)
        t = np.arange(9) * 1.125
        assert list(result["m.x"]) == list(4.0 * t % 1.0)
        assert list(result["m.wraps"]) == list(4.0 * t // 1.0)
        entries = 4.0 * t // 1.0 if early_return else np.arange(9.0)
        assert list(result["m.entries"]) == list(entries)


def test_steps_that_are_not_binary_fractions(path):
    """Time events at 0.9 j fall on the points t_3j = 0.3 k to rounding, before or after: each is met."""
    fmu = FMU(path, interface=CoSimulation(event_mode=True), start={"beat": 0.9, "rate": 1e-9})
    result = simulate(System({"m": fmu}), step=0.3, stop=300.0)
    k = np.arange(1001)
    assert (0.3 * k[::3] < 0.9 * (k[::3] // 3)).sum() > 50  # the points that are before
    assert list(result["m.beats"]) == list(k // 3)


def test_a_step_without_progress(path):
    for event_mode in (True, False):
        fmu = FMU(path, interface=CoSimulation(event_mode), start={"stuck": 1.0})
        words = r"m failed .*: m returns early from its step at t = 1 s without making progress"
        with pytest.raises(SimulationError, match=words) as caught:
            simulate(System({"m": fmu}), step=0.25, stop=9.0)
        assert list(caught.value.result.time) == [0.0, 0.25, 0.5, 0.75, 1.0]


def test_event_mode_must_be_available(tmp_path):
    path = metronome(tmp_path / "m.fmu", event_mode=False)
    with pytest.raises(
        FMUError, match=r"m\.fmu has no event mode in Co-Simulation, which event_mode=True requires"
    ):
        FMU(path, interface=CoSimulation(event_mode=True))
    assert not FMU(path).event_mode
    path = metronome(tmp_path / "c.fmu", event_mode=False, clocks=True)
    with pytest.raises(FMUError, match="no event mode in Co-Simulation, which its clock wrap needs"):
        FMU(path)
    path = metronome(tmp_path / "c.fmu", clocks=True)
    with pytest.raises(FMUError, match="event_mode=False, but its clock wrap needs event mode"):
        FMU(path, interface=CoSimulation(event_mode=False))
