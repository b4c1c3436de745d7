"""Clocks of FMI 3.0 under Co-Simulation: the FMU of c/metronome.c refuses every misplaced access.

A tick at t_k is visible at t_{k+1}, as every effect of an input that is latched at t_k.
"""

from __future__ import annotations

import numpy as np
import pytest

from cosim import (
    FMU,
    Block,
    FMUError,
    Input,
    Output,
    Simulation,
    SimulationError,
    State,
    System,
    TimeError,
    WiringError,
    simulate,
)
from cosim.cli.inspection import inspection
from tests.cosim.fmi.metronome import metronome
from tests.cosim.parts import Ramp

H = 0.25
K = np.arange(21)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return metronome(tmp_path_factory.mktemp("clocks") / "clocks.fmu", clocks=True)


def ticks(every, shift=0):
    """Return the number of ticks at the points 0 .. k - 1."""
    acts = (shift <= K) & ((K - shift) % every == 0)
    return np.concatenate([[0], np.cumsum(acts)[:-1]])


def test_periodic_clocks(path):
    """sample: every 0.5 s from 0.25 s on; tick: every 2/8 s; own: every own_period, half of it late."""
    system = System({"r": Ramp(), "m": FMU(path)}, [("r.u", "m.u")])
    result = simulate(system, step=H, stop=20 * H)
    assert list(result["m.samples"]) == list(ticks(2, 1))
    assert list(result["m.ticks"]) == list(ticks(1))
    assert list(result["m.owns"]) == list(ticks(4, 2))
    last = 2 * ticks(2, 1) - 1  # the point of the last tick
    assert list(result["m.sampled"]) == [result["r.u"][i] if i >= 0 else 0.0 for i in last]
    assert "m: discrete inputs and clocks (Python callback)" in result.schedule
    result = simulate(
        System({"m": FMU(path, start={"tick": "750 ms", "own_period": 2.0})}), step=H, stop=20 * H
    )
    assert list(result["m.ticks"]) == list(ticks(3))
    assert list(result["m.owns"]) == list(ticks(8, 4))
    result = simulate(System({"m": FMU(path)}), step=H, start=10.0, stop=10.0 + 20 * H)
    assert list(result["m.samples"]) == list(ticks(2, 1))


def test_intervals_are_whole_steps(path):
    words = r"m: clock sample: its interval of 0\.5 s is 1\.66667 communication steps of 0\.3 s"
    with pytest.raises(TimeError, match=words):
        simulate(System({"m": FMU(path)}), step=0.3, stop=3.0)
    with pytest.raises(TimeError, match=r"clock own: its interval of 0\.3 s"):
        simulate(System({"m": FMU(path, start={"own_period": 0.3})}), step=H, stop=5.0)
    block = FMU(path, as_block=True, every=2)  # its step is 0.5 s
    with pytest.raises(TimeError, match=r"clock sample: its shift of 0\.25 s is 0\.5 communication steps"):
        simulate(System({"m": block}), step=H, stop=5.0)


@pytest.mark.parametrize("early_return", [True, False])
def test_an_output_clock_reads_1_when_it_has_ticked_since_the_last_point(tmp_path, early_return):
    """x wraps at t = 1, 2, ...; wrapped_at is read while the clock is active, and is the FMU's own time."""
    path = metronome(tmp_path / "c.fmu", clocks=True, early_return=early_return)
    result = simulate(System({"m": FMU(path, start={"rate": 0.8, "beat": 0.0})}), step=H, stop=20 * H)
    wraps = 0.8 * H * K // 1.0
    ticked = np.diff(wraps, prepend=0.0)
    assert list(result["m.wrap"]) == list(ticked)
    assert ticked.sum() == 4.0
    assert list(result["m.wraps"]) == list(wraps)
    at = 1.25 * wraps if early_return else [K[ticked > 0][int(n) - 1] * H if n else 0.0 for n in wraps]
    assert result["m.wrapped_at"] == pytest.approx(at, abs=1e-14)  # 0.8 and 1 / 0.8 are rounded


class Kicker(Block):
    """go = 1, 0, -2 every third time; by = k"""

    k = State(-1.0)
    go = Output()

    def step(self, t, h):
        self.k += 1.0
        self.go = (1.0, 0.0, -2.0)[int(self.k) % 3]


@pytest.mark.parametrize("as_block", [False, True])
def test_a_triggered_input_clock_ticks_when_it_is_not_0(path, as_block):
    """kicked sums the clocked input kick_by over the ticks."""
    system = System({"b": Kicker(), "m": FMU(path, as_block=as_block)})
    system.connect("b.go", "m.kick")
    system.connect("b.k", "m.kick_by")
    result = simulate(system, step=H, stop=20 * H)
    sums = np.cumsum(np.where(K % 3 == 1, 0.0, K))
    assert list(result["m.kicked"]) == list(sums if as_block else [0.0, *sums[:-1]])


def test_recording_a_clocked_input_does_not_set_it(path):
    """Its start value is the given one, recorded or not."""
    system = System({"b": Kicker(), "m": FMU(path, start={"kick_by": 5.0})}, [("b.go", "m.kick")])
    plain = simulate(system, step=H, stop=20 * H, record=["m.kicked"])
    recorded = simulate(system, step=H, stop=20 * H, record=["m.kicked", "m.kick_by"])
    assert list(recorded["m.kicked"]) == list(plain["m.kicked"])
    assert set(recorded["m.kick_by"]) == {5.0}


def test_a_clock_may_drive_a_block_and_another_clock(path):
    """wrap of one FMU kicks the other one, by 1 each time; a block counts the same ticks."""

    class Count(Block):
        tick = Input()
        n = Output()

        def step(self, t, h):
            self.n += self.tick

    start = {"kick_by": 1.0}
    system = System({"a": FMU(path), "b": FMU(path, start=start), "c": Count()})
    system.connect("a.wrap", "c.tick")
    system.connect("a.wrap", "b.kick")
    result = simulate(system, step=H, stop=20 * H, record=["c.n", "b.kicked", "a.wraps"])
    assert list(result["c.n"]) == list(result["a.wraps"])
    assert result["c.n"][-1] == 5.0
    assert list(result["b.kicked"][1:]) == list(result["a.wraps"][:-1])


def test_clocks_that_are_refused(path, tmp_path):
    with pytest.raises(WiringError, match="m has no input 'sample'"):
        System({"r": Ramp(), "m": FMU(path)}, [("r.u", "m.sample")])
    for kind in ("countdown", "changing"):
        xml = f'<Clock name="c" valueReference="50" causality="input" intervalVariability="{kind}"/>'
        other = metronome(tmp_path / f"{kind}.fmu", clocks=True, clock=xml)
        with pytest.raises(FMUError, match=f"clock c has a {kind} interval, which is not supported"):
            FMU(other)
    xml = '<Clock name="c" valueReference="50" causality="input" intervalVariability="constant"/>'
    with pytest.raises(FMUError, match="clock c has a constant interval, which the model descr"):
        FMU(metronome(tmp_path / "none.fmu", clocks=True, clock=xml))
    with pytest.raises(FMUError, match=r"clock kick takes no interval \(it is triggered\)"):
        FMU(path, start={"kick": 0.5})
    with pytest.raises(FMUError, match="start value tick = 'fast' must be a number with a unit"):
        FMU(path, start={"tick": "fast"})
    with pytest.raises(FMUError, match=r"own has an interval neither .* give one: start=\{'own': 0\.01\}"):
        simulate(System({"m": FMU(path, start={"own_period": -1.0})}), step=H, stop=5.0)


def test_a_snapshot_holds_clocks_events_and_texts(path):
    """The run after it repeats: ticks, entries into event mode, texts that are not set again."""
    start = {"word": "here", "kick_by": 2.0, "own_period": 0.5}
    system = System({n: FMU(path, start=start) for n in ("a", "b")})
    for source, target in (("wrap", "kick"), ("echo", "word")):
        system.connect(f"a.{source}", f"b.{target}")
    record = ["b.echo", "b.kicked", "b.owns", "b.samples", "b.entries", "a.wrap", "a.beats"]
    with Simulation(system, step=H, record=record) as simulation:
        simulation.run(2.75)
        there = simulation.snapshot()
        one = simulation.run(8.0)
        simulation.restore(there)
        other = simulation.run(8.0)
    whole = simulate(system, step=H, stop=8.0, record=record)
    for name in one.signals:
        assert list(one[name]) == list(other[name]) == list(whole[name][11:]), name
    assert one.texts == other.texts == {"b.echo": ["here!!"] * 22}
    assert one["b.kicked"][-1] == 14.0


def test_clocks_do_not_tick_in_repetitions(path):
    system = System({"a": FMU(path), "b": FMU(path)}, [("a.x", "b.u"), ("b.x", "a.u")])
    with pytest.raises(WiringError, match="a, b cannot be iterated: clocks would tick at every repetition"):
        simulate(system, step=H, stop=1.0, coupling="iterated")


def test_inspection_shows_when_clocks_tick(path):
    rows = {line.split()[0]: line for line in inspection(path).splitlines() if line}
    assert "constant, every 0.5 s from 0.25 s" in rows["sample"]
    assert "fixed, every 0.25 s" in rows["tick"]
    assert "triggered" in rows["wrap"]


def test_a_clocked_output_that_is_not_finite(path):
    """kicked = 1e308 + 1e308 at the second tick."""
    system = System({"r": Ramp(), "m": FMU(path, start={"kick_by": 1e308})}, [("r.u", "m.kick")])
    words = r"m\.kicked is not finite at t = 0\.25 s, at a tick of its clock"
    with pytest.raises(SimulationError, match=words):
        simulate(system, step=H, stop=5.0)


def test_an_isolated_fmu_has_the_same_clocks_events_and_texts(path):
    results = []
    for isolated in (False, True):
        start = {"word": "here", "data": b"\x01\x00", "kick_by": 2.0}
        system = System({n: FMU(path, isolated=isolated, start=start) for n in ("a", "b")})
        for source, target in (("wrap", "kick"), ("echo", "word"), ("reversed", "data")):
            system.connect(f"a.{source}", f"b.{target}")
        record = ["b.echo", "b.reversed", "b.kicked", "b.samples", "b.wrapped_at", "b.wrap"]
        results.append(simulate(system, step=H, stop=20 * H, record=record))
    one, other = results
    assert one.texts == other.texts
    assert one.texts["b.reversed"][-1] == b"\x01\x00"
    assert one["b.wrapped_at"][-1] == 5.0
    for name in one.signals:
        assert list(one[name]) == list(other[name]), name
