"""Reference result inside an FMU, after the layered standard FMI-LS-REF 1.0.0-alpha.1.

FMPy runs the new FMU over the first steps of its default experiment, in Co-Simulation if
it has this interface, otherwise in Model Exchange by forward Euler. Every input swings by
1 (in its unit) about its start value, each at a frequency of its own; if the model fails
under these inputs, they are held. The files, under extra/org.fmi-standard.fmi-ls-ref:

    fmi-ls-manifest.xml    roles of the files
    experiments.xml        the experiment
    stimuli.csv            inputs at every communication point, if the model has any
    reference.csv          outputs at every communication point
"""

from __future__ import annotations

import csv
import ctypes
import hashlib
import io
import math
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import extract, read_model_description
from fmpy.simulation import instantiate_fmu
from lxml import etree

from cosim import Array, Participant
from cosim.fmi.instance.fmi2_log import callbacks

from .description import DefaultExperiment, Element, elements, xml_text
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
    """Run an FMU and return the files of the layered standard by their path in the archive."""
    steps = max(1, min(_STEPS, math.floor((experiment.stop - experiment.start) / experiment.step + 1e-9)))
    time: Array = experiment.start + np.arange(steps + 1, dtype=np.float64) * experiment.step
    interface = "CoSimulation" if "CoSimulation" in interfaces else "ModelExchange"
    listed = elements(participant, arrays=False)
    inputs = [e for e in listed if e.variable.kind == "input"]
    outputs = [e for e in listed if e.role.causality == "output"]
    held = np.tile([participant.memory[e.slot] for e in inputs], (time.size, 1))
    swing = np.outer((time - time[0]) / (time[-1] - time[0]), 1 + np.arange(len(inputs)) % 7)
    stimuli = held + np.sin(2.0 * np.pi * swing)
    try:
        result = _run(fmu, interface, participant, time, experiment.step, stimuli)
    except ExportError:
        stimuli = held
        result = _run(fmu, interface, participant, time, experiment.step, stimuli)
    files = {"reference.csv": _csv(outputs, time, result)}
    if inputs:
        files["stimuli.csv"] = _csv(inputs, time, stimuli)
    files["experiments.xml"] = _experiments(experiment, time, bool(inputs))
    files["fmi-ls-manifest.xml"] = _manifest(files)
    return {f"{FOLDER}/{name}": data for name, data in files.items()}


def _run(fmu: Path, interface: str, participant: Participant, time: Array, h: float, stimuli: Array) -> Array:
    """Return the outputs at `time`; if the FMU fails, the error quotes its log."""
    said: list[str] = []

    def log(*entry: Any) -> None:
        said.append(" ".join(x.decode(errors="replace") for x in entry if isinstance(x, bytes)))

    with tempfile.TemporaryDirectory() as folder:
        description = read_model_description(str(fmu), validate=False)
        extract(str(fmu), folder)
        instance: Any = None
        try:
            instance = instantiate_fmu(folder, description, interface, debug_logging=True, logger=log)
            return _simulate(instance, interface, participant, time, h, stimuli)
        except Exception as error:  # FMPy raises Exception itself
            why = " | ".join(said[-3:]) or str(error)
            raise ExportError(
                f"the exported FMU {fmu.stem} fails in its default experiment: {why}"
            ) from error
        finally:
            if instance is not None:
                instance.freeInstance()
            callbacks()  # otherwise FMPy would call `log` for other FMUs later


def _simulate(
    instance: Any, interface: str, participant: Participant, time: Array, h: float, stimuli: Array
) -> Array:
    """Set inputs, step and get outputs; return the outputs by row."""
    old = hasattr(instance, "setupExperiment")  # FMI 2.0
    listed = elements(participant, arrays=not old)
    inputs = [e.slot for e in listed if e.variable.kind == "input"]
    outputs = [e for e in listed if e.role.causality == "output"]
    references, size = [e.slot for e in outputs], sum(e.size for e in outputs)
    set_values = instance.setReal if old else instance.setFloat64

    def get_outputs() -> list[float]:
        values = instance.getReal(references) if old else instance.getFloat64(references, size)
        return [float(x) for x in values]

    if old:
        instance.setupExperiment(startTime=time[0])
        instance.enterInitializationMode()
    else:
        instance.enterInitializationMode(startTime=time[0])
    set_values(inputs, stimuli[0])
    instance.exitInitializationMode()
    rows = [get_outputs()]
    advance = instance.doStep if interface == "CoSimulation" else _euler(instance, participant, old)
    for t, u in zip(time[:-1], stimuli[:-1], strict=True):
        set_values(inputs, u)
        advance(t, h)
        rows.append(get_outputs())
    instance.terminate()
    return np.array(rows)


def _euler(instance: Any, participant: Participant, old: bool) -> Callable[[float, float], None]:
    """Return x <- x + h x' for an instance of Model Exchange that has been initialised."""
    (instance.newDiscreteStates if old else instance.updateDiscreteStates)()
    instance.enterContinuousTimeMode()
    n = participant.zones["state"][1]
    x, dx = (ctypes.c_double * n)(), (ctypes.c_double * n)()
    derivatives = instance.getDerivatives if old else instance.getContinuousStateDerivatives

    def advance(t: float, h: float) -> None:
        instance.getContinuousStates(x, n)
        derivatives(dx, n)
        instance.setTime(t + h)
        x[:] = [a + h * b for a, b in zip(x, dx, strict=True)]
        instance.setContinuousStates(x, n)

    return advance


def _csv(columns: list[Element], time: Array, table: Array) -> bytes:
    """Return a table with time in the first column, each number with all its digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["time", *(e.name for e in columns)])
    writer.writerows([repr(float(x)) for x in (t, *row)] for t, row in zip(time, table, strict=True))
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
    return xml_text(root)


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
    return xml_text(root)
