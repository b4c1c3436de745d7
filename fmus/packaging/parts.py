"""The participants of a system as FMU files, for packages of any kind (SSP, container)."""

from __future__ import annotations

import hashlib
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cosim import FMU, CosimError, Participant, System
from cosim.core.component import Component
from cosim.fmi.file.model_description import read_description
from cosim.fmi.ports import FMUPort, Shape, ports, shape_of

from ..export.fmu import export


@dataclass
class Part:
    """A participant, its FMU file, and the declarations of the file."""

    name: str
    member: Component
    file: bytes
    description: Any
    #: the file's name; participants with the same file share one
    source: str = ""
    ports: dict[str, FMUPort] = field(default_factory=dict)

    def shape(self, variable: Any) -> Shape:
        """Return the shape of a variable of the FMU."""
        return shape_of(variable, self.member.start if isinstance(self.member, FMU) else {})


def fmu_parts(system: System, fmi_version: str, platforms: list[str] | None) -> dict[str, Part]:
    """Export or read every participant's FMU; the same file goes in once."""
    parts: dict[str, Part] = {}
    sources: dict[bytes, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, member in system.participants.items():
            if isinstance(member, FMU):
                file = member.path
            else:
                assert isinstance(member, Participant)
                file = Path(folder) / f"{name}.fmu"
                try:
                    export(member, file, fmi_version=fmi_version, platforms=platforms)
                except CosimError as error:
                    raise type(error)(f"participant {name}: {error}") from error
            part = Part(name, member, file.read_bytes(), read_description(file))
            part.source = sources.setdefault(hashlib.sha256(part.file).digest(), f"{name}.fmu")
            if isinstance(member, FMU):
                part.ports = member.input_ports | member.output_ports
                part.ports |= member.text_inputs | member.text_outputs
            else:
                part.ports = ports(part.description.modelVariables, part.shape)
            parts[name] = part
    return parts
