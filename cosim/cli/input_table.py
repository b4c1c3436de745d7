"""Inputs of an FMU over time, from a CSV file.

    time,force,"u[2]",mode
    0,1.5,0,1
    1,2.5,0,2

The first column is the time in s; the others are named as inputs or elements of arrays.
Continuous inputs are interpolated linearly between the rows, the others are held; two rows
at one time are a jump. The cell of an array holds its elements, separated by blanks.
Sampled coupling holds every input between communication points; the FMU is initialized
with the values at the start.
"""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path

import numpy as np

from ..blocks.table_source import TableSource
from ..errors import RecordError, did_you_mean
from ..fmi.fmu import FMU
from ..system.system import System

_WORDS = {"true": 1.0, "false": 0.0}


def connect_inputs(system: System, name: str, path: Path) -> None:
    """Connect the inputs of the FMU `name` of a system to the columns of a CSV file."""
    fmu = system.participants[name]
    assert isinstance(fmu, FMU)
    header, lines = _read(path)
    for column, input_name in list(enumerate(header))[1:]:
        if column != header.index(input_name):
            raise RecordError(f"{path}: column {input_name} occurs twice; remove one")
        _check_input(path, fmu, input_name)
    instants = np.array([_number(path, i, "time", cells[0]) for i, cells in lines])
    for (i, _), before, t in zip(lines[1:], instants, instants[1:], strict=False):
        if t < before:
            raise RecordError(f"{path}:{i}: time {t:g} s comes after {before:g} s; sort the rows by time")
    for column, input_name in list(enumerate(header))[1:]:
        rows = [[_number(path, i, input_name, x) for x in cells[column].split()] for i, cells in lines]
        port = system.port(f"{name}.{input_name}", "input")
        wrong = [i for (i, _), row in zip(lines, rows, strict=True) if len(row) != port.count]
        if wrong:
            raise RecordError(
                f"{path}:{wrong[0]}: {input_name} takes {port.count} numbers, separated by blanks"
            )
        continuous = all(v.variability == "continuous" for v in fmu.input_ports[port.name].variables)
        source = TableSource(instants, rows, interpolation="linear" if continuous else "hold", unit=port.unit)
        system.add(f"input_{column}", source)
        system.connect(f"input_{column}.y", f"{name}.{input_name}")


def start_from_inputs(system: System, name: str, t: float) -> None:
    """Start the inputs that a file supplies with their values at t, unless start values are given."""
    fmu = system.participants[name]
    assert isinstance(fmu, FMU)
    values: dict[str, float | list[float]] = {}
    for c in system.connections:
        source = system.participants[c.source.participant]
        variable = f"{c.target.name}{c.target.index}"
        if isinstance(source, TableSource) and (not c.target.index or variable in fmu.variables):
            first = source.fresh()
            assert isinstance(first, TableSource)
            first.step(t, 0.0)
            values[variable] = first.y.tolist() if c.target.count > 1 else float(first.y[0])
    system.participants[name] = fmu.with_start({**values, **fmu.start})


def _read(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Return the header, and the other lines with their line numbers."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise RecordError(f"{path} cannot be read ({error.strerror}); check the path") from error
    except UnicodeDecodeError as error:
        raise RecordError(f"{path} is not text in UTF-8; give a CSV file") from error
    try:
        reader = csv.reader(text.splitlines(), skipinitialspace=True, strict=True)
        lines = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader if cells]
    except csv.Error as error:
        raise RecordError(f"{path} is not a CSV file: {error}") from error
    if len(lines) < 2 or len(lines[0][1]) < 2:
        raise RecordError(f"{path}: give a header, time and names of inputs, and at least one row")
    header = lines[0][1]
    if header[0].lower() not in ("time", "t"):
        raise RecordError(f"{path}: the first column is '{header[0]}'; it must be time, in s")
    for i, cells in lines[1:]:
        if len(cells) != len(header):
            raise RecordError(f"{path}:{i}: the row has {len(cells)} cells, the header has {len(header)}")
    return header, lines[1:]


def _check_input(path: Path, fmu: FMU, name: str) -> None:
    variable = fmu.variables.get(name)
    if variable is not None and variable.causality == "input" and variable.type not in fmu.version.numbers:
        raise RecordError(
            f"{path}: {name} is a {variable.type}, and inputs over time must be numbers; "
            "leave out the column and give a start value"
        )
    if name.partition("[")[0] not in fmu.inputs and name not in fmu.inputs:
        raise RecordError(f"{path}: {fmu.path.name} has no input '{name}'" + did_you_mean(name, fmu.inputs))


def _number(path: Path, line: int, name: str, text: str) -> float:
    try:
        value = _WORDS.get(text.lower())
        value = float(text) if value is None else value
    except ValueError:
        value = math.nan
    if abs(value) >= 2.0**53 and re.fullmatch(r"[+-]?\d+", text) and int(value) != int(text):
        raise RecordError(f"{path}:{line}: {name} is {text}, which a float above 2^53 cannot represent")
    if not math.isfinite(value):
        raise RecordError(f"{path}:{line}: {name} is '{text}', which is not a finite number")
    return value
