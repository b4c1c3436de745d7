"""Co-simulation of vibration-controlled structures: blocks, systems, runs, results.

    from cosim import Block, Continuous, FMU, Input, Output, Parameter, State, System, simulate

Everything that a user needs is here, in `cosim.blocks` (sources, sensors, filters, actuators)
and in `cosim.functions` (vectors and matrices in kernels).
"""

from .arrays import Array
from .core.component import Component
from .core.participant import Block, Continuous, LinearContinuous, Participant
from .core.port import Port
from .core.variables import Input, Local, Output, Parameter, State
from .errors import (
    CompilationError,
    CompiledKernelsWarning,
    CosimError,
    DeclarationError,
    FMUError,
    LateEventWarning,
    OptionError,
    RecordError,
    SimulationEndedWarning,
    SnapshotError,
    TimeError,
    WiringError,
    did_you_mean,
)
from .fmi.fmu import FMU
from .fmi.interfaces import CoSimulation, ModelExchange
from .ground_motion import GroundMotion, el_centro, read_at2, read_columns
from .ground_motion.ground_motion import G
from .result import Interrupted, Result, SimulationError, Statistics
from .run.plan import Coupling, Solver
from .run.simulation import Simulation, Snapshot, schedule, simulate
from .ssp.format import SSPError
from .ssp.reader import read_ssp
from .system.system import Connection, System

__version__ = "0.1.0"

__all__ = [
    "FMU",
    "Array",
    "Block",
    "CoSimulation",
    "CompilationError",
    "CompiledKernelsWarning",
    "Component",
    "Connection",
    "Continuous",
    "CosimError",
    "Coupling",
    "DeclarationError",
    "FMUError",
    "G",
    "GroundMotion",
    "Input",
    "Interrupted",
    "LateEventWarning",
    "LinearContinuous",
    "Local",
    "ModelExchange",
    "OptionError",
    "Output",
    "Parameter",
    "Participant",
    "Port",
    "RecordError",
    "Result",
    "SSPError",
    "Simulation",
    "SimulationEndedWarning",
    "SimulationError",
    "Snapshot",
    "SnapshotError",
    "Solver",
    "State",
    "Statistics",
    "System",
    "TimeError",
    "WiringError",
    "__version__",
    "did_you_mean",
    "el_centro",
    "read_at2",
    "read_columns",
    "read_ssp",
    "schedule",
    "simulate",
]
