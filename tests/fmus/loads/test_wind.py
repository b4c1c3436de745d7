"""The across-wind load against its declared statistics, and the printed uncontrolled figures."""

from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest

from cosim import CosimError, RecordError, System, simulate
from fmus.export import export
from fmus.loads.wind import AcrossWind, FloorLoad, across_wind, coherence_factor, load_forces
from scenarios.tall_building.building import STORY_HEIGHTS

#: eight stories as high as the whole tower: statistics over hours cost a tenth of those of 76 floors
HEIGHTS = np.full(8, STORY_HEIGHTS.sum() / 8)
Z = np.cumsum(HEIGHTS)
TRIBUTARY = 0.5 * (HEIGHTS + np.append(HEIGHTS[1:], 0.0))


def test_same_seed_same_load_another_seed_another() -> None:
    """Bit for bit, since results of several machines are compared by seed."""
    a, b, other = (across_wind(STORY_HEIGHTS, 60.0, seed) for seed in (5, 5, 6))
    assert np.array_equal(a, b)
    assert a.shape == (601, 76)
    assert abs(np.corrcoef(a[:, 70], other[:, 70])[0, 1]) < 0.7  # some 5 cycles of the peak in 60 s


@pytest.mark.parametrize("part", ["shedding", "turbulence"])
def test_each_part_has_its_coefficient_and_its_coherence(part: str) -> None:
    """RMS coefficient and correlation over 40,000 s; some 1000 independent cycles leave 3 % and 0.06."""
    wind = replace(AcrossWind(), **{"shedding": 0.0, "turbulence": 0.0, part: 0.2})
    w = across_wind(HEIGHTS, 40000.0, 3, wind, sample_period=0.5)
    U = wind.speed * (Z / Z[-1]) ** wind.exponent
    unit = 0.5 * wind.density * U**2 * wind.breadth * TRIBUTARY
    # 0.5 s cut off the spectrum at 1 Hz: with it goes the tail of the turbulence
    np.testing.assert_allclose(
        (w.std(axis=0) / unit)[[2, 5, 6]], 0.2, rtol=0.03 if part == "shedding" else 0.08
    )
    gap = Z[6] - Z[5]
    wanted = (
        np.exp(-((gap / (wind.shedding_length * wind.breadth)) ** 2))
        if part == "shedding"
        else np.exp(-gap / wind.turbulence_length)
    )
    assert np.corrcoef(w[:, 6], w[:, 5])[0, 1] == pytest.approx(wanted, abs=0.06)


def test_shedding_peaks_at_the_strouhal_frequency() -> None:
    """Averaged over 20 stretches of 2000 s; the peak is found to one of its 0.0005 Hz lines times a few."""
    wind = replace(AcrossWind(), turbulence=0.0, bandwidth=0.1)
    w = across_wind(HEIGHTS, 40000.0, 4, wind, sample_period=0.5)[:80000, -1].reshape(20, 4000)
    spectrum = (np.abs(np.fft.rfft(w, axis=1)) ** 2).mean(axis=0)
    spectrum = np.convolve(spectrum, np.ones(9) / 9, "same")
    f = np.fft.rfftfreq(4000, 0.5)
    assert f[np.argmax(spectrum)] == pytest.approx(wind.strouhal * wind.speed / wind.breadth, rel=0.05)


def test_coherence_factor_is_the_symmetric_root() -> None:
    R = np.exp(-np.abs(Z[:, None] - Z) / 120.0)
    G = coherence_factor(R)
    np.testing.assert_allclose(G @ G, R, atol=1e-12)
    with pytest.raises(CosimError, match="not positive semidefinite"):
        coherence_factor(np.array([[1.0, 2.0], [2.0, 1.0]]))


def test_load_is_linear_between_its_samples_and_holds_at_the_end() -> None:
    """At 20 ms and samples of 0.1 s; held for 40 ms where it acts every second step. Round-off only."""
    table = np.array([[0.0, 3.0], [10.0, 1.0], [4.0, -5.0]])
    for every in (1, 2):
        system = System({"load": FloorLoad(table=table, dt=0.1, every=every)})
        result = simulate(system, step=0.02, stop=0.3, record=["load.w"])
        acts = np.floor(np.arange(16) / every + 1e-9) * every * 0.02
        for j in range(2):
            wanted = np.interp(acts, [0.0, 0.1, 0.2], table[:, j])
            np.testing.assert_allclose(result["load.w"][:, j], wanted, atol=1e-12)


@pytest.mark.parametrize("t", [-1e6, -1.0, -1e-30, 0.0, 0.3, 1e18, 1e300])
def test_a_load_holds_its_ends_at_any_time(t: float) -> None:
    """The row number is bounded before it is an integer; a table of one sample is that sample."""
    load = FloorLoad(table=np.array([[1.0, 3.0], [10.0, 1.0], [4.0, -5.0]]), dt=0.1)
    load.step(t, 0.02)
    assert load.w.tolist() == ([1.0, 3.0] if t <= 0.0 else [4.0, -5.0])
    one = FloorLoad(table=np.array([[2.0, 7.0]]), dt=0.1)
    one.step(t, 0.02)
    assert one.w.tolist() == [2.0, 7.0]


def test_an_exported_load_may_start_long_before_its_table(tmp_path: Path) -> None:
    """In FMPy, from t = -1e6 s; reading outside the table ended the host's process."""
    path = export(FloorLoad(table=np.array([[1.0, 3.0], [10.0, 1.0]]), dt=0.1), tmp_path / "load.fmu")
    result = fmpy.simulate_fmu(
        str(path), start_time=-1e6, stop_time=-1e6 + 0.05, step_size=0.01, output_interval=0.01
    )
    assert set(result["w[1]"][1:]) == {1.0}  # the first row is from before the first step
    assert set(result["w[2]"][1:]) == {3.0}


def test_user_records(tmp_path: Path) -> None:
    """.npz and .csv with and without titles give the same forces."""
    time, force = np.arange(5) * 0.25, np.arange(15.0).reshape(5, 3) * 1e3
    np.savez(tmp_path / "w.npz", time=time, force=force)
    np.savetxt(tmp_path / "w.csv", np.column_stack([time, force]), delimiter=",")
    titles = {"header": "time,1,2,F", "comments": ""}
    np.savetxt(tmp_path / "titled.csv", np.column_stack([time, force]), delimiter=",", **titles)
    for name in ("w.npz", "w.csv", "titled.csv"):
        got, dt = load_forces(tmp_path / name, 3)
        np.testing.assert_array_equal(got, force)
        assert dt == pytest.approx(0.25)


def test_bad_records_are_refused_with_a_reason(tmp_path: Path) -> None:
    time, force = np.arange(5) * 0.25, np.ones((5, 3))
    cases = {
        "floors": ({"time": time, "force": force[:, :2]}, "needs"),
        "uneven": ({"time": time**2, "force": force}, "not evenly spaced"),
        "nan": ({"time": time, "force": np.where(np.arange(15).reshape(5, 3) == 7, np.nan, force)}, "row 3"),
        "names": ({"t": time, "force": force}, "no array"),
    }
    for name, (arrays, message) in cases.items():
        np.savez(tmp_path / f"{name}.npz", **arrays)
        with pytest.raises(RecordError, match=message):
            load_forces(tmp_path / f"{name}.npz", 3)
    with pytest.raises(RecordError, match="not a record of forces"):
        load_forces(tmp_path / "missing.csv", 3)
    with pytest.raises(CosimError, match="must be"):
        across_wind(STORY_HEIGHTS, 10.0, sample_period=0.0)
