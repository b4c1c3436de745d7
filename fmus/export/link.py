"""From kernels in LLVM IR to a shared library.

A library is linked from the kernels of a participant (`cosim.codegen.kernels.lower`), the
C front end in export/c and one generated C file, the table of the model, for any platform of
`cosim.codegen.c_compiler`. It is cached by a hash of all its sources.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
import tempfile
import threading
import uuid
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from cosim import CosimError, Participant
from cosim.codegen.c_compiler import (
    LIBRARY_FLAGS,
    PLATFORMS,
    Platform,
    cached_library,
    complaint,
    fmi_headers,
    host,
    zig_cc,
)
from cosim.codegen.cache import cache_directory
from cosim.core.variables import KINDS, Variable

KERNELS = ("initialize", "derivatives", "outputs", "advance", "step")
_FRONT_END = Path(__file__).parent / "c"
_SHARED_SOURCES = ("core.c", "snapshot.c", "sensitivity.c")
_FLAGS = (*LIBRARY_FLAGS, "-Wno-override-module")


class ExportError(CosimError):
    """A participant cannot be exported as an FMU, or a library cannot be linked."""


def find_platform(name: str) -> Platform:
    """Return the platform with this name; raise ExportError for an unknown one."""
    if name not in PLATFORMS:
        raise ExportError(f"platform '{name}' is not known; choose from {', '.join(PLATFORMS)}")
    return PLATFORMS[name]


@dataclass(frozen=True)
class Model:
    """All that determines a library, except its platform and the front end."""

    identifier: str
    fmi_version: str
    kernels: str
    table: str
    start: bytes
    token: str = field(init=False)

    def __post_init__(self) -> None:
        parts = (self.identifier, self.fmi_version, self.kernels, self.table, front_end(self.fmi_version))
        digest = hashlib.sha256(self.start + "\0".join(parts).encode()).digest()
        object.__setattr__(self, "token", str(uuid.UUID(bytes=digest[:16], version=5)))


def front_end(fmi_version: str) -> str:
    """Return the text of the front end, on which the token of an FMU depends."""
    return "".join(p.name + p.read_text() for p in [*_sources(fmi_version), *sorted(_FRONT_END.glob("*.h"))])


def _sources(fmi_version: str) -> list[Path]:
    return [_FRONT_END / name for name in (*_SHARED_SOURCES, f"fmi{fmi_version[0]}.c")]


def build_model(participant: Participant, identifier: str, fmi_version: str, kernels: str) -> Model:
    """Return the model of a participant whose kernels have been lowered to `kernels`."""
    start = participant.memory.astype("<f8")
    for name in participant.CACHE_KEYS:
        start[participant.variables[name].slot] = 0.0  # matrices of an earlier step are not exported
    return Model(identifier, fmi_version, kernels, _table(participant, identifier), start.tobytes())


def reachable(ir: str, kernel: str) -> dict[str, str]:
    """Return a kernel and all functions that it calls, directly or indirectly, with their IR."""
    bodies = {m[1]: m[0] for m in re.finditer(r'^define\b[^@\n]*@"?([^"(\s]+)"?\(.*?^}', ir, re.M | re.S)}
    reached: dict[str, str] = {}
    waiting = [f"kernel_{kernel}"]
    while waiting:
        name = waiting.pop()
        reached[name] = bodies.get(name, "")
        waiting += {n for n in re.findall(r'@"?([^"(\s,)]+)"?', reached[name]) if n not in reached}
    return reached


def _hidden(ir: str) -> str:
    """Keep the kernels out of the library's symbol table, and the build machine's CPU out of its code."""
    hidden = re.sub(
        r'^define (dso_local )?(?=[^@\n]*@"?kernel_)', r"define \1hidden ", ir, flags=re.MULTILINE
    )
    return re.sub(r' ?"(target-cpu|target-features|tune-cpu)"="[^"]*"', "", hidden)


# -------------------------------------------------------------------------- table


def _table(participant: Participant, identifier: str) -> str:
    """Return the C file that defines `model`, without its token."""
    variables = list(participant.variables.values())
    shapes, rows = [], []
    for i, v in enumerate(variables):
        shape = ", ".join(str(n) for n in v.shape)
        if shape:
            shapes.append(f"static const uint32_t shape_{i}[] = {{{shape}}};")
        fields = [json.dumps(fmi_name(v)), f"shape_{i}" if shape else "NULL", len(v.shape), v.slot, v.size]
        fields += [v.kind.upper(), "true" if is_listed(v) else "false", _number(v.min), _number(v.max)]
        rows.append(f"    {{{', '.join(map(str, fields))}}},")
    have = [name for name in KERNELS if name in participant.kernels]
    zones = [participant.zones[kind][0] for kind in KINDS] + [sum(participant.zones[KINDS[-1]])]
    return "\n".join(
        [
            '#include "model.h"\n\n#include <math.h>\n',
            *(f"extern model_kernel kernel_{name};" for name in have),
            'static const unsigned char model_start[] = {\n#embed "start.bin"\n};',
            *shapes,
            "static const struct variable model_variables[] = {",
            *rows,
            "};\nconst struct model model = {",
            f"    .identifier = {json.dumps(identifier)},\n    .token = MODEL_TOKEN,",
            f"    .n_slots = {participant.memory.size},\n    .zone = {{{', '.join(map(str, zones))}}},",
            f"    .variables = model_variables,\n    .n_variables = {len(variables)},",
            "    .start = model_start,",
            *(f"    .{name} = kernel_{name}," for name in have),
            "};\n",
        ]
    )


def _number(x: float) -> str:
    if math.isinf(x):
        return "INFINITY" if x > 0 else "-INFINITY"
    return float(x).hex()


def is_listed(v: Variable) -> bool:
    """Return whether the modelDescription lists a variable."""
    return v.kind != "local" and not v.fixed


def fmi_name(v: Variable) -> str:
    """Return the name in the modelDescription, without indices; der_x is der(x) there."""
    return f"der({v.name.removeprefix('der_')})" if v.kind == "derivative" else v.name


# --------------------------------------------------------------------------- link


def link(model: Model, platform: Platform) -> bytes:
    """Return the shared library of a model for a platform, from the cache if possible."""
    headers = fmi_headers()
    ir = _hidden(model.kernels)
    parts: list[str] = [platform.target, *_FLAGS, model.token, ir]
    parts += [p.read_text() for p in sorted(headers.glob(f"fmi{model.fmi_version[0]}*.h"))]
    build = partial(_compile, model, platform, ir, headers)
    return cached_library(parts, platform.suffix, build).read_bytes()


def _compile(model: Model, platform: Platform, ir: str, headers: Path) -> bytes:
    cache = cache_directory()
    with tempfile.TemporaryDirectory(dir=cache) as name:
        folder = Path(name)
        (folder / "kernels.ll").write_text(ir)
        (folder / "start.bin").write_bytes(model.start)
        (folder / "model.c").write_text(_unit(model))
        library = folder / f"{model.identifier}{platform.suffix}"
        arguments: list[str | Path] = ["-target", platform.target, *_FLAGS]
        arguments += [f"-I{headers}", f"-I{_FRONT_END}", f"--embed-dir={folder}"]
        arguments += [] if platform.suffix == ".dll" else ["-lm"]
        arguments += [folder / "model.c", folder / "kernels.ll", "-o", library]
        done = zig_cc(arguments, folder)
        if done.returncode or not library.exists():
            said = complaint(done.stderr)
            raise ExportError(f"{model.identifier} cannot be linked for {platform.name}: {said}")
        return library.read_bytes()


def warm_up() -> None:
    """Let the compiler build its runtime for this machine in the background, unless the cache has it.

    This takes most of the time of a first link, and runs while kernels are compiled.
    """

    def link_nothing() -> None:
        with tempfile.TemporaryDirectory(dir=cache_directory()) as name:
            source = Path(name) / "nothing.c"
            source.write_text("double sin(double); double f(double x) { return sin(x); }\n")
            arguments: list[str | Path] = ["-target", PLATFORMS[host()].target, *_FLAGS, source, "-lm"]
            zig_cc([*arguments, "-o", Path(name) / "nothing"], Path(name))

    if not (cache_directory() / "zig").exists() and host() in PLATFORMS:
        threading.Thread(target=link_nothing, daemon=True).start()


def _unit(model: Model) -> str:
    """Return all C code as one unit; zones and kernels are constants then, and a step is 1.4 times faster."""
    front = [f'#include "{source.name}"' for source in _sources(model.fmi_version)]
    return "\n".join([f'#define MODEL_TOKEN "{model.token}"', model.table, *front, ""])
