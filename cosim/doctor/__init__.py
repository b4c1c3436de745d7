"""The examination of an FMU's behaviour: `cosim doctor plant.fmu`.

    report = examine("plant.fmu")
    print(report.text())

The probes (probes.py) validate the description, and check whether reset repeats a run, whether a
state can be restored, whether instances leak or disturb each other, and whether the declared
dependencies are those observed. Every probe runs in a process of its own (child.py), because an FMU
may crash or hang.
"""

from .examination import examine
from .report import Finding, Report

__all__ = ["Finding", "Report", "examine"]
