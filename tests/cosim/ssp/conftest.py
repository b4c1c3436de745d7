"""A package of SSP that contains the FMUs of the tests."""

from __future__ import annotations

import zipfile

import pytest
from lxml import etree

from fmus.export import export
from tests.cosim.fmi.probe import probe
from tests.cosim.parts import Gain, Integrator
from tests.cosim.ssp.packages import SPACES
from tests.fmus.packaging.ssp_parts import Damper, Watch, schema


@pytest.fixture(scope="package")
def fmus(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmus")
    made = {kind.__name__: export(kind(), folder / f"{kind.__name__}.fmu") for kind in (Gain, Integrator)}
    made |= {kind.__name__: export(kind(), folder / f"{kind.__name__}.fmu") for kind in (Damper, Watch)}
    made["probe"] = probe(folder / "probe.fmu", "3.0")
    return made


@pytest.fixture
def package(tmp_path, fmus):
    """Return a function that writes an SSP, which the schema validates unless valid=False."""

    def write(body, after="", files=None, version="1.0", valid=True):
        text = (
            f'<ssd:SystemStructureDescription {SPACES} version="{version}" name="it">{body}{after}'
            "</ssd:SystemStructureDescription>"
        )
        if valid:
            schema(version, "Description").assertValid(etree.fromstring(text))
        path = tmp_path / "it.ssp"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("SystemStructure.ssd", text)
            for name, data in (files or {}).items():
                archive.writestr(name, data)
            for name, fmu in fmus.items():
                archive.write(fmu, f"resources/{name}.fmu")
        return path

    return write
