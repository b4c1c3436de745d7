"""The result of a run: signals over time, statistics over all communication points."""

from __future__ import annotations

import json
from dataclasses import astuple, dataclass, field
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from .arrays import Array
from .errors import CosimError, RecordError, WiringError, did_you_mean
from .units import Definition, conversion

if TYPE_CHECKING:
    import pandas


#: the fields that .npz keeps besides time, signals and statistics
_SAVED = ("units", "step", "steps", "seconds", "schedule", "interrupted", "ended")


def _values(value: Any) -> Any:
    return np.array(value) if isinstance(value, list) else value


def _as_json(text: Any) -> Any:
    return {"hex": text.hex()} if isinstance(text, bytes) else text


def _from_json(text: Any) -> Any:
    return bytes.fromhex(text["hex"]) if isinstance(text, dict) else text


@dataclass(frozen=True)
class Statistics:
    """Statistics of one port over all communication points 0..n: numbers, or arrays (m,).

    `peak` is the largest magnitude, `norm` the root of the sum of squares.
    """

    minimum: Any
    maximum: Any
    mean: Any
    rms: Any
    norm: Any

    @property
    def peak(self) -> Any:
        """The largest magnitude."""
        return np.maximum(np.abs(self.minimum), np.abs(self.maximum))


@dataclass
class Result:
    """Signals by port name ("plant.x"), their units and statistics.

    time
        (r,) recorded communication points in s
    signals
        port name -> (r,) or (r, m)
    definitions
        port name -> the definition of its unit, where an FMU gives one
    texts
        port name of a String or Binary -> a str or bytes at each recorded point
    interrupted
        True when the run was stopped before its end; the result holds the part that was computed
    ended
        the component that asked to end the run before its stop time, and when; "" if none did
    """

    time: Array
    signals: dict[str, Array]
    units: dict[str, str | None]
    statistics: dict[str, Statistics] = field(default_factory=dict)
    step: float = 0.0
    steps: int = 0
    seconds: float = 0.0
    schedule: str = ""
    interrupted: bool = False
    ended: str = ""
    texts: dict[str, list[Any]] = field(default_factory=dict)
    definitions: dict[str, Definition] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Array:
        if name in self.texts:
            raise WiringError(f"{name} is a String or Binary; use result.texts[{name!r}]")
        if name not in self.signals:
            raise WiringError(f"the result has no signal '{name}'" + did_you_mean(name, self.signals))
        return self.signals[name]

    def in_unit(self, name: str, unit: str) -> Array:
        """Return a signal in another unit, such as `result.in_unit("plant.x", "mm")`."""
        values, own = self[name], self.units.get(name)
        if own is None:
            raise WiringError(f"{name} has no unit, so it cannot be converted to '{unit}'")
        try:
            scale, offset = conversion(own, unit, self.definitions.get(name))
        except WiringError as error:
            raise WiringError(f"{name} in {own}: {error}") from error
        return scale * values + offset

    def __contains__(self, name: object) -> bool:
        return name in self.signals

    def columns(self) -> dict[str, Array]:
        """Return one column for each scalar: "building.accel[3]" -> (r,)."""
        flat: dict[str, Array] = {}
        for name, values in self.signals.items():
            if values.ndim == 1:
                flat[name] = values
            else:
                flat |= {f"{name}[{i + 1}]": values[:, i] for i in range(values.shape[1])}
        return flat

    def save(self, path: str | PathLike[str]) -> None:
        """Write the whole result as .npz (exact), or the signals as .csv (17 digits)."""
        path = Path(path)
        if path.suffix == ".npz":
            kept = {name: getattr(self, name) for name in _SAVED}
            texts = {n: [_as_json(v) for v in values] for n, values in self.texts.items()}
            definitions = {n: [d.exponents, d.factor, d.offset] for n, d in self.definitions.items()}
            statistics = {n: [np.asarray(v).tolist() for v in astuple(s)] for n, s in self.statistics.items()}
            meta = json.dumps(kept | {"statistics": statistics, "texts": texts, "definitions": definitions})
            arrays: dict[str, Any] = {"time": self.time, **self.signals}
            np.savez(path, _meta=np.array(meta), **arrays)
        elif path.suffix == ".csv":
            columns = {"time": self.time, **self.columns()}
            header = ",".join(f'"{n}"' if "," in n else n for n in columns)
            np.savetxt(
                path, np.column_stack(list(columns.values())), "%.17g", ",", header=header, comments=""
            )
        else:
            raise RecordError(f"a result cannot be written as '{path.suffix}'; choose .npz or .csv")

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Result:
        """Read a result that `save` wrote as .npz."""
        try:
            with np.load(path) as data:
                meta = json.loads(str(data["_meta"]))
                signals = {n: data[n] for n in data.files if n not in ("_meta", "time")}
                texts, units = meta.get("texts", {}), meta.get("definitions", {})
                meta["statistics"] = {n: Statistics(*map(_values, s)) for n, s in meta["statistics"].items()}
                meta["texts"] = {n: [_from_json(v) for v in values] for n, values in texts.items()}
                meta["definitions"] = {n: Definition(tuple(p), *rest) for n, (p, *rest) in units.items()}
                return cls(data["time"], signals, **meta)
        except (OSError, EOFError, ValueError, KeyError, TypeError, AttributeError, BadZipFile) as error:
            raise RecordError(f"{path} is not a result saved as .npz: {error}") from error

    def to_pandas(self) -> pandas.DataFrame:
        """Return a DataFrame with the time as index; needs pandas."""
        import pandas

        return pandas.DataFrame(self.columns(), index=pandas.Index(self.time, name="time"))


class SimulationError(CosimError):
    """A run that had to stop; `result` holds the part that was computed."""

    result: Result | None = None


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a run; `result` holds the part that was computed."""

    def __init__(self, result: Result) -> None:
        super().__init__(f"interrupted at t = {result.time[-1] if len(result.time) else 0.0:g} s")
        self.result = result
