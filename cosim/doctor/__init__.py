"""What an FMU really does: `cosim doctor plant.fmu`.

    report = examine("plant.fmu")
    print(report.text())

Its description is validated, then it is probed: does reset repeat a run, does a state come
back, do instances leak or disturb each other, are the declared dependencies those that are
seen. Every probe (probes.py) runs in a process of its own (child.py), which may crash or hang.
"""

from .examination import examine
from .report import Finding, Report

__all__ = ["Finding", "Report", "examine"]
