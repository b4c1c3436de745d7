"""The report of an examination: the findings of the probes, as text and as JSON."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass

#: levels from good to bad; the exit code of a report whose worst finding has the level
LEVELS: Mapping[str, int] = {"ok": 0, "note": 0, "warning": 1, "error": 2, "crashed": 3}


@dataclass(frozen=True)
class Finding:
    """The finding of one probe, which is one line of the report."""

    probe: str
    #: "Co-Simulation", "Model Exchange", or "" for a property of the file
    interface: str
    level: str
    text: str


@dataclass(frozen=True)
class Report:
    """The findings of all probes of an FMU."""

    fmu: str
    #: version, interfaces, tool
    about: str
    findings: tuple[Finding, ...]

    @property
    def worst(self) -> str:
        """The level of the worst finding."""
        return max((f.level for f in self.findings), key=list(LEVELS).index)

    @property
    def exit_code(self) -> int:
        """0: ok or notes, 1: warnings, 2: errors, 3: something crashed."""
        return LEVELS[self.worst]

    def summary(self) -> str:
        """Return the number of findings of each level, the worst first."""
        counts = Counter(f.level for f in self.findings)
        plural = {"note": "notes", "warning": "warnings", "error": "errors"}
        parts = [
            f"{counts[n]} {plural.get(n, n) if counts[n] > 1 else n}"
            for n in reversed([*LEVELS])
            if counts[n]
        ]
        number = f"{len(self.findings)} probe{'s' if len(self.findings) > 1 else ''}"
        return f"{number}: {', '.join(parts)}"

    def text(self) -> str:
        """Return the report, one line per probe."""
        lines, interface = [f"{self.fmu}: {self.about}", ""], ""
        width = max(len(f.probe) for f in self.findings)
        for f in self.findings:
            if f.interface != interface:
                interface = f.interface
                lines += ["", interface]
            lines.append(f"{f.level:<8} {f.probe:<{width}}  {f.text}")
        return "\n".join([*lines, "", self.summary()])

    def json(self) -> str:
        """Return the report as JSON."""
        data = {"fmu": self.fmu, "about": self.about, "worst": self.worst, "exit_code": self.exit_code}
        return json.dumps(data | {"findings": [asdict(f) for f in self.findings]}, indent=1)
