"""The components of a system as FMU files, for packages of any kind (SSP, container)."""

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
    """A component, its FMU file, and the declarations of the file."""

    name: str
    component: Component
    file: bytes
    description: Any
    #: the name of the file; components with equal files share one
    source: str = ""
    ports: dict[str, FMUPort] = field(default_factory=dict)

    def shape(self, variable: Any) -> Shape:
        """Return the shape of a variable of the FMU."""
        return shape_of(variable, self.component.start if isinstance(self.component, FMU) else {})


def fmu_parts(system: System, fmi_version: str, platforms: list[str] | None) -> dict[str, Part]:
    """Return the parts by name: every participant exported, every FMU read."""
    parts: dict[str, Part] = {}
    sources: dict[bytes, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, component in system.participants.items():
            if isinstance(component, FMU):
                file = component.path
            else:
                assert isinstance(component, Participant)
                file = Path(folder) / f"{name}.fmu"
                try:
                    export(component, file, fmi_version=fmi_version, platforms=platforms)
                except CosimError as error:
                    raise type(error)(f"participant {name}: {error}") from error
            part = Part(name, component, file.read_bytes(), read_description(file))
            part.source = sources.setdefault(hashlib.sha256(part.file).digest(), f"{name}.fmu")
            if isinstance(component, FMU):
                part.ports = component.input_ports | component.output_ports
                part.ports |= component.text_inputs | component.text_outputs
            else:
                part.ports = ports(part.description.modelVariables, part.shape)
            parts[name] = part
    return parts
