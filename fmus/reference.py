"""Reference result inside an FMU, after the layered standard FMI-LS-REF 1.0.0-alpha.1.

The FMU that was just built is run by FMPy, in Co-Simulation where it has it: the first
steps of its default experiment, every input swinging by 1 (in its unit) about its start
value, each at another frequency. If the model cannot be driven so, inputs are held. In
the archive, under extra/org.fmi-standard.fmi-ls-ref:

    fmi-ls-manifest.xml    roles of the files
    experiments.xml        the experiment
    stimuli.csv            inputs at every communication point (if there are inputs)
    reference.csv          outputs at every communication point
"""

from __future__ import annotations

import hashlib
import io
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from cosim.participant import Participant

from .description import DefaultExperiment, elements
from .link import ExportError

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
_MANIFEST = "http://fmi-standard.org/fmi-ls-manifest"
_STEPS = 100
_ABOUT = (
    "Layered Standard providing information on related files included in an FMU."  # fixed by the standard
)


def reference_files(
    fmu: Path, participant: Participant, experiment: DefaultExperiment, interfaces: Iterable[str]
) -> dict[str, bytes]:
    """Run an FMU and return the files of the layered standard by their place in the archive."""
    steps = max(1, min(_STEPS, math.floor((experiment.stop - experiment.start) / experiment.step + 1e-9)))
    time = experiment.start + np.arange(steps + 1) * experiment.step
    interface = "CoSimulation" if "CoSimulation" in interfaces else "ModelExchange"
    stimuli = _stimuli(participant, time)
    try:
        result = _run(fmu, interface, experiment, time, stimuli)
    except ExportError:
        stimuli = None
        result = _run(fmu, interface, experiment, time, None)
    files = {"reference.csv": _csv(result)}
    if stimuli is not None:
        files["stimuli.csv"] = _csv(stimuli)
    files["experiments.xml"] = _experiments(experiment, time, stimuli is not None)
    files["fmi-ls-manifest.xml"] = _manifest(files)
    return {f"{FOLDER}/{name}": data for name, data in files.items()}


def _stimuli(participant: Participant, time: np.ndarray) -> np.ndarray | None:
    inputs = [e for e in elements(participant, arrays=False) if e.variable.kind == "input"]
    if not inputs:
        return None
    table = np.zeros(time.size, dtype=[("time", "f8"), *((e.name, "f8") for e in inputs)])
    table["time"] = time
    phase = (time - time[0]) / (time[-1] - time[0])
    for i, e in enumerate(inputs):
        table[e.name] = participant.memory[e.slot] + np.sin(2.0 * np.pi * (1 + i % 7) * phase)
    return table


def _run(
    fmu: Path, interface: str, experiment: DefaultExperiment, time: np.ndarray, stimuli: np.ndarray | None
) -> np.ndarray:
    """Simulate by FMPy; what the FMU logs is part of the error if it stops."""
    from fmpy import simulate_fmu

    said: list[str] = []

    def log(*record: Any) -> None:
        said.append(" ".join(x.decode(errors="replace") for x in record if isinstance(x, bytes)))

    try:
        return np.asarray(
            simulate_fmu(
                str(fmu), validate=False, fmi_type=interface, start_time=time[0], stop_time=time[-1],
                output_interval=experiment.step, step_size=experiment.step, solver="Euler",
                input=stimuli, logger=log, debug_logging=True,
            )
        )  # fmt: skip
    except Exception as error:  # FMPy raises Exception itself
        raise ExportError(
            f"the exported {fmu.stem} does not run its default experiment: {' | '.join(said[-3:]) or error}"
        ) from error


def _csv(table: np.ndarray) -> bytes:
    names = table.dtype.names or ()
    text = io.StringIO()
    text.write(",".join(f'"{n}"' if "," in n else n for n in names) + "\n")
    for row in table:
        text.write(",".join(repr(float(x)) for name in names for x in np.ravel(row[name])) + "\n")
    return text.getvalue().encode()


def _experiments(experiment: DefaultExperiment, time: np.ndarray, stimulated: bool) -> bytes:
    root = etree.Element("Experiments")
    element = etree.SubElement(
        root,
        "Experiment",
        name="reference",
        description="first steps of the default experiment" + (", every input a sine" if stimulated else ""),
        startTime=repr(float(time[0])),
        stopTime=repr(float(time[-1])),
        stepSize=repr(float(experiment.step)),
    )
    if stimulated:
        etree.SubElement(element, "Stimuli", type="text/csv", source="stimuli.csv")
    etree.SubElement(element, "References", type="text/csv", source="reference.csv")
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _manifest(files: dict[str, bytes]) -> bytes:
    about = {
        "reference.csv": ("text/csv", "result", "outputs at every communication point"),
        "stimuli.csv": ("text/csv", "testcase", "inputs, held from one communication point to the next"),
        "experiments.xml": ("text/xml", "experiment/smoke-test", "the experiment of the reference result"),
    }
    name = {key: f"{{{_MANIFEST}}}fmi-ls-{key}" for key in ("name", "version", "description")}
    root = etree.Element(
        "fmiReferences",
        {
            name["name"]: "org.fmi-standard.fmi-ls-ref",
            name["version"]: "1.0.0-alpha.1",
            name["description"]: _ABOUT,
        },
        nsmap={"fmi-ls": _MANIFEST},
    )
    for source, data in sorted(files.items()):
        kind, role, description = about[source]
        etree.SubElement(
            root, "Related", type=kind, source=source, role=role, description=description,
            checksum=hashlib.sha3_256(data).hexdigest(), checksumType="SHA3-256",
        )  # fmt: skip
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))
