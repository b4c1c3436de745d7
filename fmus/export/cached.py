"""A participant as an FMU in one call, from the cache where it was exported before.

    plant = as_fmu(Oscillator())

What a scenario uses to step its plant as an FMU. The file is keyed by the compiled
kernels, the start record and the exporter's own source.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path

from cosim import FMU, Participant
from cosim.codegen import c_compiler
from cosim.codegen.kernels import cache_directory, kernel_key

from .fmu import export
from .link import warm_up


@lru_cache(maxsize=1)
def _exporter() -> bytes:
    """Return a hash of the exporter's source, and of how it compiles."""
    here = Path(__file__).parent
    files = [*sorted([*here.glob("*.py"), *here.glob("c/*")]), Path(c_compiler.__file__)]
    return hashlib.sha256(b"".join(f.read_bytes() for f in files)).digest()


def as_fmu(participant: Participant) -> FMU:
    """Export a participant with the values it has now, and load the FMU; `FMU.source` is the participant."""
    digest = hashlib.sha256(_exporter() + kernel_key(participant).encode() + participant.memory.tobytes())
    path = cache_directory() / "fmus" / digest.hexdigest()[:32] / f"{type(participant).__name__}.fmu"
    if not path.exists():
        warm_up()
        export(participant, path)
    fmu = FMU(path)
    fmu.source = participant
    return fmu
