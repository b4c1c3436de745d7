"""structcosim's core: blocks, systems, the master, results.

from cosim import Block, Continuous, FMU, Input, Output, Parameter, State, System, simulate
"""

from .errors import CosimError, SimulationEndedWarning
from .fmi.fmu import FMU
from .master import schedule, simulate
from .participant import Block, Continuous, LinearContinuous
from .result import Result
from .simulation import Interrupted, Simulation, Snapshot
from .system import System
from .variables import Array, Input, Local, Output, Parameter, State

__all__ = [
    "FMU",
    "Array",
    "Block",
    "Continuous",
    "CosimError",
    "Input",
    "Interrupted",
    "LinearContinuous",
    "Local",
    "Output",
    "Parameter",
    "Result",
    "Simulation",
    "SimulationEndedWarning",
    "Snapshot",
    "State",
    "System",
    "schedule",
    "simulate",
]
