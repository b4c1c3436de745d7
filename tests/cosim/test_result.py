"""Results: recorded signals, statistics, files."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import cosim.run.recorder
from cosim import RecordError, Result, Statistics, System, WiringError, simulate
from tests.cosim.parts import Counter, Gain, Mass, Three


def loop() -> System:
    return System(
        {"plant": Mass(), "gain": Gain(), "three": Three()},
        [("plant.x", "gain.x"), ("gain.u", "plant.u"), ("plant.v", "three.x")],
    )


def test_statistics_cover_every_point_whatever_is_recorded():
    """Against numpy on the same run recorded in full; sums of 301 numbers in another order: 1e-12."""
    full = simulate(loop(), step=0.01, stop=3.0)
    thin = simulate(
        loop(), step=0.01, stop=3.0, record=["plant.x"], statistics=["gain.u", "three.y"], decimation=7
    )
    assert set(thin.statistics) == {"gain.u", "three.y"}
    for name, found in thin.statistics.items():
        y = full[name]
        wanted = {
            "minimum": y.min(axis=0),
            "maximum": y.max(axis=0),
            "peak": np.abs(y).max(axis=0),
            "mean": y.mean(axis=0),
            "rms": np.sqrt((y**2).mean(axis=0)),
            "norm": np.linalg.norm(y, axis=0),
        }
        for statistic, value in wanted.items():
            assert getattr(found, statistic) == pytest.approx(value, rel=1e-12, abs=1e-14), (name, statistic)


@pytest.mark.parametrize("decimation", [1, 4, 7, 300, 1000])
def test_decimation_takes_every_nth_point(decimation):
    full = simulate(loop(), step=0.01, stop=3.0)
    thin = simulate(loop(), step=0.01, stop=3.0, decimation=decimation)
    for name in full.signals:
        assert np.array_equal(thin[name], full[name][::decimation])
    assert np.array_equal(thin.time, full.time[::decimation])


def test_inputs_slices_and_everything_can_be_recorded():
    result = simulate(
        loop(), step=0.5, stop=1.0, record=["gain.x", "plant.u", "three.x[2:3]", "three.M[2,1]"]
    )
    full = simulate(loop(), step=0.5, stop=1.0)
    assert np.array_equal(result["gain.x"], full["plant.x"])
    assert np.array_equal(result["plant.u"][1:], full["gain.u"][:-1])  # held over the step before
    assert np.array_equal(result["three.x[2:3]"], np.column_stack([full["plant.v"]] * 2))
    assert result["three.M[2,1]"].tolist() == [4.0] * 3
    assert list(full.signals) == [
        "plant.a",
        "plant.x",
        "plant.v",
        "gain.u",
        "three.y",
        "three.M",
        "three.accel",
    ]
    assert full.units["three.accel"] == "m/s^2"
    with pytest.raises(WiringError, match=r"no signal 'plant.y'; did you mean 'plant\.[axv]'"):
        full["plant.y"]
    with pytest.raises(WiringError, match="no output 'y'"):
        simulate(loop(), step=0.5, stop=1.0, record=["plant.y"])


def test_long_records_spill_to_a_file(monkeypatch):
    wanted = simulate(loop(), step=0.01, stop=3.0)
    monkeypatch.setattr(cosim.run.recorder, "MEMORY_LIMIT", 1000)
    found = simulate(loop(), step=0.01, stop=3.0)
    assert isinstance(found["plant.x"].base, np.memmap)
    for name in wanted.signals:
        assert np.array_equal(found[name], wanted[name])


numbers = st.floats(allow_nan=False, width=64)


@given(data=st.data(), rows=st.integers(0, 5), interrupted=st.booleans(), step=numbers)
def test_npz_keeps_every_bit(data, rows, interrupted, step):
    signals = {
        "a.x": data.draw(hnp.arrays(float, rows, elements=numbers)),
        "b.der(y)[2:3], é": data.draw(hnp.arrays(float, (rows, 2), elements=numbers)),
    }
    five = [data.draw(numbers) for _ in range(5)]
    statistics = {"a.x": Statistics(*five), "c.z": Statistics(*(np.array([f, -f]) for f in five))}
    result = Result(
        np.arange(rows) * 0.1,
        signals,
        {"a.x": "m/s^2", "c.z": None},
        statistics,
        step,
        7,
        1.5,
        "text\nlines",
        interrupted,
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "r.npz"
        result.save(path)
        loaded = Result.load(path)
    assert np.array_equal(loaded.time, result.time)
    assert loaded.signals.keys() == signals.keys()
    for name in signals:
        assert np.array_equal(loaded[name], signals[name])
    for name in ("units", "step", "steps", "seconds", "schedule", "interrupted"):
        assert getattr(loaded, name) == getattr(result, name)
    for port, kept in loaded.statistics.items():
        for field in ("minimum", "maximum", "mean", "rms", "norm"):
            assert np.array_equal(getattr(kept, field), getattr(statistics[port], field))


def test_csv_has_one_column_per_scalar_with_all_digits(tmp_path):
    result = simulate(loop(), step=0.1, stop=0.7, record=["three.y", "plant.x", "three.M[2,1]"])
    result.save(tmp_path / "r.csv")
    header, *rows = (tmp_path / "r.csv").read_text().splitlines()
    assert header == 'time,three.y[1],three.y[2],three.y[3],plant.x,"three.M[2,1]"'
    table = np.array([[float(x) for x in row.split(",")] for row in rows])
    wanted = np.column_stack([result.time, result["three.y"], result["plant.x"], result["three.M[2,1]"]])
    assert np.array_equal(table, wanted)


@pytest.mark.parametrize("content", [b"", b"text", b"PK\x03\x04 broken", None])
def test_a_file_that_is_not_a_result_is_refused(tmp_path, content):
    path = tmp_path / "r.npz"
    if content is None:
        np.savez(path, x=np.ones(3))
    else:
        path.write_bytes(content)
    with pytest.raises(RecordError, match=r"is not a result saved as \.npz"):
        Result.load(path)
    with pytest.raises(RecordError, match="is not a result saved"):
        Result.load(tmp_path / "missing.npz")
    with pytest.raises(RecordError, match=r"choose \.npz or \.csv"):
        simulate(System({"c": Counter()}), step=1.0, stop=1.0).save(tmp_path / "r.xlsx")


def test_to_pandas():
    pandas = pytest.importorskip("pandas")
    result = simulate(loop(), step=0.1, stop=0.7)
    frame = result.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert frame.index.name == "time"
    assert np.array_equal(frame["three.y[3]"].to_numpy(), result["three.y"][:, 2])
