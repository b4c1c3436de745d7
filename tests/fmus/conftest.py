"""FMUs to test with, each exported once a session."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fmus.export import export
from tests.fmus.export.host import PARTICIPANTS, Host, library


@pytest.fixture(scope="session")
def fmu_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Export by name, each FMU once."""
    folder = tmp_path_factory.mktemp("exported")
    made: dict[tuple[str, str], Path] = {}

    def give(name: str, fmi_version: str = "2.0") -> Path:
        if (name, fmi_version) not in made:
            path = folder / f"{name}-{fmi_version}.fmu"
            made[name, fmi_version] = export(PARTICIPANTS[name](), path, fmi_version=fmi_version)
        return made[name, fmi_version]

    return give


@pytest.fixture
def host_of(fmu_of: Callable[..., Path], tmp_path: Path) -> Iterator[Callable[[str], Host]]:
    """Load the library of a named FMU; instances are freed at the end."""
    hosts: list[Host] = []

    def give(name: str) -> Host:
        path = fmu_of(name)
        hosts.append(Host(path, library(path, tmp_path / str(len(hosts)))))
        return hosts[-1]

    yield give
    for h in hosts:
        h.free()
