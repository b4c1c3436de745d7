"""Any scenario that a command names: a Python scenario, an FMU or an SSP."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

from ..core.participant import Participant
from .fmu_scenario import FMUStudy
from .python_scenario import python_scenario
from .scenario import Scenario, ScenarioError, study_of_file
from .ssp_scenario import SSPStudy

_STUDIES = {".fmu": FMUStudy, ".ssp": SSPStudy}


def load_scenario(name: str) -> Scenario:
    """Load a scenario by its name, or a user's Python file, FMU or SSP by its path."""
    path = Path(name)
    if path.suffix not in _STUDIES:
        return python_scenario(name)
    return Scenario(path.stem, SimpleNamespace(Study=study_of_file(_STUDIES[path.suffix], path)))


def find_participant(text: str) -> Participant:
    """Return the Python object behind `scenario:participant`, as the scenario builds it by default."""
    name, colon, wanted = text.rpartition(":")
    if not colon:
        raise ScenarioError(f"'{text}': write scenario:participant, such as chattering:plant")
    return load_scenario(name).participant(wanted)
