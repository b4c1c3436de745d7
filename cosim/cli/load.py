"""Any scenario that a command names: a Python scenario, an FMU or an SSP."""

from __future__ import annotations

from pathlib import Path

from ..core.participant import Participant
from .fmu_scenario import fmu_scenario
from .python_scenario import python_scenario
from .scenario import Scenario, ScenarioError
from .ssp_scenario import ssp_scenario


def load_scenario(name: str) -> Scenario:
    """Load a scenario by its name, or a user's Python file, FMU or SSP by its path."""
    if name.endswith(".fmu"):
        return fmu_scenario(Path(name))
    if name.endswith(".ssp"):
        return ssp_scenario(Path(name))
    return python_scenario(name)


def find_participant(text: str) -> Participant:
    """Return the Python object behind `scenario:participant`, as the scenario builds it by default."""
    name, colon, wanted = text.rpartition(":")
    if not colon:
        raise ScenarioError(f"'{text}': write scenario:participant, such as chattering:plant")
    return load_scenario(name).participant(wanted)
