"""A participant as an FMU in one call, exported at most once: the file is kept in a cache.

    plant = as_fmu(Oscillator())

Its key is a hash of its contents: the compiled kernels, the start values, the declarations
(the modelDescription lists their units and meanings), and the exporter. Comments of a plant
are not part of the key.
"""

from __future__ import annotations

import hashlib
import tempfile
from functools import lru_cache
from pathlib import Path

from cosim import FMU, Participant
from cosim.codegen import c_compiler
from cosim.codegen.cache import cached
from cosim.codegen.kernels import kernel_key

from .fmu import export
from .link import warm_up


@lru_cache(maxsize=1)
def _exporter() -> bytes:
    """Return a hash of the source of the exporter and of the module that calls the compiler."""
    here = Path(__file__).parent
    files = [*sorted([*here.glob("*.py"), *here.glob("c/*")]), Path(c_compiler.__file__)]
    return hashlib.sha256(b"".join(f.read_bytes() for f in files)).digest()


def cache_key(participant: Participant) -> str:
    """Return a hash of everything that determines the FMU of a participant."""
    variables = participant.variables.values()
    declared = [(v.name, v.kind, v.shape, v.unit, v.meaning, v.min, v.max, v.fixed) for v in variables]
    rate = getattr(participant, "sample_period", None)  # the default experiment follows from it
    key = hashlib.sha256(_exporter() + kernel_key(participant).encode() + participant.memory.tobytes())
    key.update(repr((type(participant).__name__, declared, rate)).encode())
    return key.hexdigest()[:32]


def as_fmu(participant: Participant) -> FMU:
    """Export a participant with its present values and load the FMU; `FMU.source` is the participant."""
    name = f"{type(participant).__name__}.fmu"

    def exported() -> bytes:
        warm_up()
        with tempfile.TemporaryDirectory() as folder:
            return export(participant, Path(folder) / name).read_bytes()

    fmu = FMU(cached(f"fmus/{cache_key(participant)}/{name}", exported))
    fmu.source = participant
    return fmu
