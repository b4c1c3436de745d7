"""Export of a participant as an FMU: `export(participant, "plant.fmu")`.

    kernels (Python) -> LLVM IR -> shared library per platform      cosim/codegen, link.py
    declarations     -> modelDescription.xml                        description.py, dependencies.py
    the FMU itself   -> reference result, FMI-LS-REF                reference.py

The same participant gives the same bytes.
"""

from __future__ import annotations

import os
import struct
import tempfile
import uuid
import zipfile
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from cosim import Block, Continuous, Participant
from cosim.codegen.c_compiler import Platform, host
from cosim.codegen.kernels import lower

from .dependencies import model_structure
from .description import DefaultExperiment, fmi2_description, fmi3_description
from .link import ExportError, build_model, find_platform, link
from .reference import reference_files

INTERFACES = ("ModelExchange", "CoSimulation")
_DESCRIPTIONS = {"2.0": fmi2_description, "3.0": fmi3_description}
FMI_VERSIONS = tuple(_DESCRIPTIONS)


def export(
    participant: Participant,
    path: str | os.PathLike[str],
    *,
    platforms: Iterable[str] | None = None,
    fmi_version: str = "2.0",
    interfaces: Iterable[str] | None = None,
    experiment: DefaultExperiment | None = None,
) -> Path:
    """Write a participant as a native FMU whose start values are its present values.

    platforms
        names in `cosim.codegen.c_compiler.PLATFORMS`; the default is this machine's
    interfaces
        "ModelExchange", "CoSimulation" or both (the default; a Block has Co-Simulation only)
    experiment
        experiment that hosts and the reference result use; by default 1000 steps of the
        block's sample period or of 10 ms
    """
    target = Path(path)
    name = type(participant).__name__
    wanted = [find_platform(p) for p in dict.fromkeys(platforms if platforms is not None else [host()])]
    if not wanted:
        raise ExportError(f"{name}: platforms is empty; name at least one, or leave it out for this machine")
    if fmi_version not in FMI_VERSIONS:
        raise ExportError(
            f"{name}: FMI version '{fmi_version}' is not supported; choose from {', '.join(FMI_VERSIONS)}"
        )
    offered = _interfaces(participant, interfaces)
    _check(participant, name)
    plan = experiment or _default_experiment(participant)
    if not (plan.step > 0.0 and plan.stop > plan.start):
        raise ExportError(f"{name}: {plan}: the step must be above zero and the stop after the start")
    kernels = lower(participant)
    model = build_model(participant, name, fmi_version, kernels)
    describe = _DESCRIPTIONS[fmi_version]
    text = describe(participant, model, model_structure(participant, kernels), offered, plan)
    files = {"modelDescription.xml": text}
    with tempfile.TemporaryDirectory() as folder:
        trial = Path(folder) / f"{name}.fmu"
        here = find_platform(host())
        libraries = {p: link(model, p) for p in {here: None} | dict.fromkeys(wanted)}
        write_archive(trial, files | _binaries(name, {here: libraries[here]}, fmi_version))
        files |= reference_files(trial, participant, plan, offered)
    files |= _binaries(name, {p: libraries[p] for p in wanted}, fmi_version)
    write_archive(target, files)
    return target


def _check(participant: Participant, name: str) -> None:
    if not isinstance(participant, (Block, Continuous)):
        raise ExportError(f"{name} is neither a Block nor a Continuous; only these can be exported")
    if not participant.compiled:
        raise ExportError(
            f"{name} runs as Python (compiled = False), which an FMU cannot contain; "
            "write its kernels in the compilable subset to export it"
        )
    if not (name.isascii() and name.isidentifier()):
        raise ExportError(f"{name}: the name of the class must be a C identifier in FMI; rename the class")
    for v in participant.variables.values():
        if not v.name.isascii():
            raise ExportError(f"{name}.{v.name}: names in an FMU must be ASCII; rename the variable")


def _interfaces(participant: Participant, interfaces: Iterable[str] | None) -> tuple[str, ...]:
    continuous = isinstance(participant, Continuous) and "derivatives" in participant.kernels
    possible = INTERFACES if continuous else ("CoSimulation",)
    chosen = tuple(possible if interfaces is None else dict.fromkeys(interfaces))
    for interface in chosen:
        if interface not in possible:
            raise ExportError(
                f"{type(participant).__name__} has no interface '{interface}'; "
                f"choose from {', '.join(possible)}"
            )
    if not chosen:
        raise ExportError(
            f"{type(participant).__name__}: interfaces is empty; name at least one of {', '.join(possible)}"
        )
    return chosen


def _default_experiment(participant: Participant) -> DefaultExperiment:
    step = getattr(participant, "sample_period", None) or 0.01
    return DefaultExperiment(0.0, 1000 * step, step)


# ------------------------------------------------------------------------ archive


def write_archive(path: Path, files: Mapping[str, bytes], first: str = "modelDescription.xml") -> None:
    """Write a zip archive, and its folder if necessary; the bytes depend on the contents only.

    The archive gets its name when it is complete, so several threads and processes may write to
    one path.
    """
    temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
            for name in [first, *sorted(files.keys() - {first})]:
                entry = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.create_system = 3
                entry.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
                archive.writestr(entry, files[name])
        os.replace(temporary, path)
    except OSError as error:
        raise ExportError(f"{path} cannot be written: {error.strerror}") from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def _binaries(name: str, libraries: Mapping[Platform, bytes], fmi_version: str) -> dict[str, bytes]:
    """Return the libraries by their path in the archive.

    FMI 3.0 has a folder for each architecture. FMI 2.0 has one for each operating system, where
    FMPy looks on ARM as well, so the two libraries for macOS become one universal binary. Linux
    has no such format: linux64 holds x86_64 if that is among the platforms and aarch64
    otherwise, and aarch64-linux always holds the ARM library.
    """
    if fmi_version != "2.0":
        return {f"binaries/{p.name}/{name}{p.suffix}": library for p, library in libraries.items()}
    files: dict[str, bytes] = {}
    for p, library in sorted(libraries.items(), key=lambda item: item[0].name):  # aarch64 before x86_64
        place = f"binaries/{p.fmi2_folder}/{name}{p.suffix}"
        if p.name == "aarch64-linux":
            files[f"binaries/{p.name}/{name}{p.suffix}"] = library
        both = p.fmi2_folder == "darwin64" and place in files
        files[place] = _universal([files[place], library]) if both else library
    return files


def _universal(libraries: list[bytes]) -> bytes:
    """Return the universal Mach-O binary of libraries: a big-endian table of contents, then the files."""
    alignment = 14
    table, body, offset = [], b"", 1 << alignment
    for library in libraries:
        _, cpu, subtype = struct.unpack("<3I", library[:12])
        table.append(struct.pack(">5I", cpu, subtype, offset + len(body), len(library), alignment))
        body += library + bytes(-len(library) % (1 << alignment))
    head = struct.pack(">2I", 0xCAFEBABE, len(libraries)) + b"".join(table)
    return head + bytes(offset - len(head)) + body
