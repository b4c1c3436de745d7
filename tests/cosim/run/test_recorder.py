"""The recorded values and points; a run that continues begins with its first point."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import Block, Output, RecordError, Simulation, State, System, simulate
from cosim.run import recorder


class Ledger(Block):
    """n counts the points; y = (n, -n)"""

    n = State(-1.0)
    y = Output(shape=2)

    def step(self, t, h):
        self.n += 1.0
        self.y[0] = self.n
        self.y[1] = -self.n


def test_rows_at_every_nth_point_and_statistics_at_every_one():
    result = simulate(System({"b": Ledger()}), step=0.5, stop=5.0, decimation=4, record=["b.y[2]", "b.y"])
    assert result.time.tolist() == [0.0, 2.0, 4.0]
    assert result["b.y[2]"].tolist() == [0.0, -4.0, -8.0]
    assert result["b.y"].tolist() == [[0, 0], [4, -4], [8, -8]]
    statistics = result.statistics["b.y"]
    assert statistics.minimum.tolist() == [0, -10]
    assert statistics.maximum.tolist() == [10, 0]
    assert statistics.mean.tolist() == [5, -5]
    assert statistics.norm == pytest.approx([np.sqrt(385.0)] * 2, rel=1e-15)  # a root of an exact sum


@pytest.mark.parametrize(("until", "first"), [(2.0, [4.0, 8.0]), (2.5, [8.0])])
def test_a_run_that_goes_on_records_its_first_point_without_evaluating_it_again(until, first):
    """n would be one too high; at 2.5 s, k = 5, the decimation leaves the point out."""
    with Simulation(System({"b": Ledger()}), step=0.5, decimation=4) as simulation:
        simulation.run(until)
        result = simulation.run(4.0)
    assert result["b.n"].tolist() == first
    assert result.time.tolist() == [n / 2.0 for n in first]
    assert result.statistics["b.n"].minimum == 2.0 * until
    assert result.statistics["b.n"].mean == (2.0 * until + 8.0) / 2.0


def test_a_recording_beyond_the_free_space_is_refused_before_it_begins(monkeypatch):
    monkeypatch.setattr(recorder, "MEMORY_LIMIT", 0)
    monkeypatch.setattr(recorder.shutil, "disk_usage", lambda folder: type("Usage", (), {"free": 100}))
    with pytest.raises(RecordError, match=r"3 numbers at 101 points take .* record fewer ports"):
        simulate(System({"b": Ledger()}), step=0.01, stop=1.0)


def test_a_large_recording_lies_in_a_temporary_file(monkeypatch):
    wanted = simulate(System({"b": Ledger()}), step=0.01, stop=1.0)["b.y"]
    monkeypatch.setattr(recorder, "MEMORY_LIMIT", 0)
    found = simulate(System({"b": Ledger()}), step=0.01, stop=1.0)["b.y"]
    assert isinstance(found, np.memmap)
    assert np.array_equal(found, wanted)
