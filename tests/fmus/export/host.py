"""A host that calls an FMI 2.0 library as a C program would, and the participants that it is tried on."""

from __future__ import annotations

import ctypes
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import read_model_description

from cosim import Block, Continuous, Input, Output, Parameter, State
from fmus.plants.oscillator import Oscillator
from fmus.plants.shear_building import ShearBuilding

OK, ERROR = 0, 3
MODEL_EXCHANGE, CO_SIMULATION = 0, 1
LOGGER = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p
)


class Callbacks(ctypes.Structure):
    _fields_ = [
        ("logger", LOGGER),
        ("allocate", ctypes.c_void_p),
        ("free", ctypes.c_void_p),
        ("step_finished", ctypes.c_void_p),
        ("environment", ctypes.c_void_p),
    ]


@dataclass
class Host:
    """An FMI 2.0 library and one instance at most; every call returns the status."""

    path: Path
    library: ctypes.CDLL
    log: list[tuple[int, str, str]] = field(default_factory=list)
    component: int | None = None

    def __post_init__(self) -> None:
        self.description = read_model_description(str(self.path))
        self.guid = self.description.guid.encode()
        self.reference = {v.name: v.valueReference for v in self.description.modelVariables}
        self.library.fmi2Instantiate.restype = ctypes.c_void_p
        self.callbacks = Callbacks(LOGGER(self._record))

    def _record(self, _: Any, name: bytes, status: int, category: bytes, message: bytes) -> None:
        self.log.append((status, category.decode(), message.decode()))

    def instantiate(
        self,
        kind: int = CO_SIMULATION,
        *,
        name: bytes | None = b"it",
        guid: bytes | None = b"own",
        logging: int = 1,
    ) -> int | None:
        self.component = self.library.fmi2Instantiate(
            name, kind, self.guid if guid == b"own" else guid, None, ctypes.byref(self.callbacks), 0, logging
        )
        return self.component

    def call(self, name: str, *arguments: Any) -> int:
        """Call fmi2`name`(component, arguments): floats are double, integers int, sequences arrays."""
        function = getattr(self.library, f"fmi2{name}")
        return int(function(ctypes.c_void_p(self.component), *map(convert, arguments)))

    def setup(self, kind: int = CO_SIMULATION, start: float = 0.0, stop: float | None = None) -> None:
        """Instantiate and leave initialization mode."""
        self.instantiate(kind)
        assert self.prepare(start, stop) == OK
        assert self.call("EnterInitializationMode") == OK
        assert self.call("ExitInitializationMode") == OK

    def prepare(self, start: float = 0.0, stop: float | None = None) -> int:
        return self.call("SetupExperiment", 0, 0.0, start, int(stop is not None), stop or 0.0)

    def set(self, *pairs: tuple[str | int, float]) -> int:
        references = [self.reference[k] if isinstance(k, str) else k for k, _ in pairs]
        return self.call(
            "SetReal", np.uint32(references), np.uint64(len(pairs)), np.array([v for _, v in pairs])
        )

    def get(self, *names: str | int) -> list[float]:
        values = np.full(len(names), np.nan)
        assert self.read(names, values) == OK, self.log
        return [float(v) for v in values]

    def read(self, names: Sequence[str | int], values: np.ndarray) -> int:
        references = [self.reference[k] if isinstance(k, str) else k for k in names]
        return self.call("GetReal", np.uint32(references), np.uint64(len(names)), values)

    def step(self, t: float, h: float) -> int:
        return self.call("DoStep", t, h, 1)

    def free(self) -> None:
        if self.component:
            self.library.fmi2FreeInstance(ctypes.c_void_p(self.component))
        self.component = None


def convert(x: Any) -> Any:
    if isinstance(x, np.ndarray):
        return ctypes.c_void_p(x.ctypes.data)
    if isinstance(x, np.uint64):
        return ctypes.c_size_t(int(x))
    return ctypes.c_double(x) if isinstance(x, float) else x


def library(fmu: Path, folder: Path) -> ctypes.CDLL:
    """Unpack an FMU's library into a folder and load it."""
    with zipfile.ZipFile(fmu) as archive:
        name = next(n for n in archive.namelist() if n.startswith("binaries/"))
        return ctypes.CDLL(archive.extract(name, folder))


class Accumulator(Block):
    """s <- s + K u, y = s; discrete memory, array ports, a bound"""

    K = Parameter([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], "gain", shape=("m", "n"), unit="N/m", max=10.0)
    u = Input("displacement", shape="n", unit="m")
    s = State(0.5, "sum", shape="m", unit="N")
    y = Output("sum, as an output", shape="m", unit="N")

    def step(self, t: float, h: float) -> None:
        for i in range(self.s.shape[0]):
            for j in range(self.u.shape[0]):
                self.s[i] += self.K[i, j] * self.u[j]
            self.y[i] = self.s[i]


class Root(Continuous):
    """x' = -x^3 + sin u, y = sqrt(u) x: nonlinear, and not a number for u < 0"""

    u = Input("drive", unit="1", start=1.0)
    x = State(2.0, "state", unit="1")
    y = Output("output", unit="1")

    def derivatives(self, t: float) -> None:
        self.der_x = -(self.x**3) + np.sin(self.u)

    def outputs(self, t: float) -> None:
        self.y = np.sqrt(self.u) * self.x


def building() -> ShearBuilding:
    """Three stories, nothing equal, nothing symmetric, damping by mode."""
    return ShearBuilding.build([3.0, 2.0, 1.5], [3000.0, 2000.0, 1000.0], [0.02, 0.03, 0.05])


PARTICIPANTS: dict[str, Callable[[], Block | Continuous]] = {
    "oscillator": Oscillator,
    "building": building,
    "accumulator": lambda: Accumulator(m=2, n=3),
    "root": Root,
}
