"""The recorder of a run: signals, statistics and texts, written by operations of the loop.

Everything is recorded at communication points, after the blocks. The compiled loop writes
rows of floats and the statistics, a callback the strings and binary data. A run that
continues from an evaluated point records that point again, as its first one, by the same
operations (loop.py: `resume`).
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from ..arrays import Array
from ..core.port import Port
from ..errors import RecordError
from ..loop.operations import Call, Operation, Record, Sample
from ..result import Statistics
from .binding import Binding

#: recorded signals above this number of bytes go to a temporary file
MEMORY_LIMIT = 200_000_000


class Recorder:
    """Records ports at every n-th communication point, and keeps statistics of ports at every one."""

    def __init__(self, recorded: Sequence[Port], watched: Sequence[Port], binding: Binding) -> None:
        texts = [port for port in recorded if port.kind != "number"]
        self.recorded, self.watched = [p for p in recorded if p.kind == "number"], watched
        self.decimation = decimation = binding.plan.decimation
        self.texts: dict[str, list[str | bytes]] = {str(port): [] for port in texts}
        self._place = np.zeros(2, dtype=np.int64)  # address of the rows, number of rows so far
        self._first = 0  # the point of the first row, divided by the decimation
        self._recorded, self._watched = (_addresses(ports, binding) for ports in (self.recorded, watched))
        self._rows: Array = np.empty((0, len(self._recorded)))
        self._kept = np.zeros((max(len(self._watched), 1), 4))
        self._points = np.zeros(1, dtype=np.int64)

        def keep_texts(t: float, h: float) -> None:
            for port in texts:
                self.texts[str(port)].append(binding.text(port))

        #: the operations that record a point
        self.operations: list[Operation] = []
        if texts:
            line = f"record {', '.join(self.texts)} (Python callback)"
            keep = binding.signals.callback("record", keep_texts)
            self.operations.append(Call(text=line, function=keep, every=decimation))
        if len(self._watched):
            sample = Sample(
                text=f"statistics of {', '.join(map(str, watched))}",
                sources=int(self._watched.ctypes.data),
                kept=int(self._kept.ctypes.data),
                points=int(self._points.ctypes.data),
                count=len(self._watched),
            )
            self.operations.append(sample)
        if len(self._recorded) or texts:
            record = Record(
                text=f"record {', '.join(map(str, self.recorded))}" if len(self._recorded) else "",
                sources=int(self._recorded.ctypes.data),
                place=int(self._place.ctypes.data),
                count=len(self._recorded),
                every=decimation,
            )
            self.operations.append(record)

    def open(self, k: int, last: int) -> None:
        """Make room for the points k to `last`, and discard the earlier recording."""
        self._first = -(-k // self.decimation)
        self._rows = _room(last // self.decimation - self._first + 1, len(self._recorded))
        self._place[:] = self._rows.ctypes.data, 0
        self._kept[:] = np.inf, -np.inf, 0.0, 0.0
        self._points[0] = 0
        for texts in self.texts.values():
            texts.clear()

    def recording(self, start: float, step: float) -> dict[str, Any]:
        """Return the recording since `open`: time, signals, texts, units and statistics of a Result."""
        n = int(self._place[1])
        points = self._first + np.arange(n, dtype=np.float64)
        signals = {}
        for port, part, is_scalar in _parts(self.recorded):
            columns = self._rows[:n, part]
            signals[str(port)] = columns[:, 0] if is_scalar else columns
        return {
            "time": start + points * self.decimation * step,
            "signals": signals,
            "texts": {name: texts[:n] for name, texts in self.texts.items()},
            "units": {str(p): p.unit for p in [*self.recorded, *self.watched]},
            "definitions": {str(p): p.definition for p in self.recorded if p.definition is not None},
            "statistics": self._statistics(int(self._points[0])),
        }

    def _statistics(self, n: int) -> dict[str, Statistics]:
        found: dict[str, Statistics] = {}
        for port, part, is_scalar in _parts(self.watched) if n else ():
            low, high, total, squares = self._kept[part].T.copy()
            values: list[Any] = [low, high, total / n, np.sqrt(squares / n), np.sqrt(squares)]
            found[str(port)] = Statistics(*([float(v[0]) for v in values] if is_scalar else values))
        return found


def _addresses(ports: Sequence[Port], binding: Binding) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Return the address of every single float of ports."""
    return np.array([binding.address(p) + 8 * i for p in ports for i in range(p.count)], dtype=np.int64)


def _parts(ports: Iterable[Port]) -> Iterator[tuple[Port, slice, bool]]:
    """Return, for each port, the slice of its floats among those of all ports, and whether it is a scalar."""
    first = 0
    for port in ports:
        yield port, slice(first, first + port.count), port.shape == () or port.count == 1
        first += port.count


def _room(rows: int, columns: int) -> Array:
    """Return memory for rows, in a temporary file if they are large."""
    size = rows * columns * 8
    if size <= MEMORY_LIMIT:
        return np.empty((rows, columns))
    folder = tempfile.gettempdir()
    free = shutil.disk_usage(folder).free
    if size > free:
        raise RecordError(
            f"{columns} numbers at {rows} points take {size / 1e9:.3g} GB and {folder} has "
            f"{free / 1e9:.3g} GB free; record fewer ports (record=[...]), or with decimation="
        )
    file = tempfile.TemporaryFile(prefix="structcosim-")  # noqa: SIM115  lives as long as the arrays
    return np.memmap(file, dtype=np.float64, mode="w+", shape=(rows, columns))
