"""Co-simulation of vibration-controlled structures: blocks, systems, runs, results.

from cosim import Block, Continuous, FMU, Input, Output, Parameter, State, System, simulate
"""

from .core.participant import Block, Continuous, LinearContinuous, Participant
from .core.variables import Array, Input, Local, Output, Parameter, State
from .errors import (
    CompilationError,
    CosimError,
    DeclarationError,
    FMUError,
    OptionError,
    RecordError,
    SimulationEndedWarning,
    SnapshotError,
    TimeError,
    WiringError,
)
from .fmi.fmu import FMU
from .fmi.interfaces import CoSimulation, ModelExchange
from .ground_motion import GroundMotion, el_centro, read_at2, read_columns
from .result import Interrupted, Result, SimulationError, Statistics
from .run.simulation import Simulation, Snapshot, schedule, simulate
from .ssp.reader import read_ssp
from .system.system import System

__version__ = "0.1.0"

__all__ = [
    "FMU",
    "Array",
    "Block",
    "CoSimulation",
    "CompilationError",
    "Continuous",
    "CosimError",
    "DeclarationError",
    "FMUError",
    "GroundMotion",
    "Input",
    "Interrupted",
    "LinearContinuous",
    "Local",
    "ModelExchange",
    "OptionError",
    "Output",
    "Parameter",
    "Participant",
    "RecordError",
    "Result",
    "Simulation",
    "SimulationEndedWarning",
    "SimulationError",
    "Snapshot",
    "SnapshotError",
    "State",
    "Statistics",
    "System",
    "TimeError",
    "WiringError",
    "__version__",
    "el_centro",
    "read_at2",
    "read_columns",
    "read_ssp",
    "schedule",
    "simulate",
]
