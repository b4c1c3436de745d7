"""An FMU of FMI 2.0 through FMPy's own calls, the reference of several benchmarks."""

from __future__ import annotations

from fmpy.fmi2 import FMU2Slave

from cosim import FMU


def initialised(fmu: FMU) -> FMU2Slave:
    """Return an instance for Co-Simulation that has left initialisation; `free` frees it."""
    made = FMU2Slave(
        guid=fmu.description.guid, unzipDirectory=str(fmu.directory), instanceName="plant",
        modelIdentifier=fmu.description.coSimulation.modelIdentifier,
    )  # fmt: skip
    made.instantiate()
    made.setupExperiment(startTime=0.0)
    made.enterInitializationMode()
    made.exitInitializationMode()
    return made


def free(instance: FMU2Slave) -> None:
    instance.terminate()
    instance.freeInstance()
