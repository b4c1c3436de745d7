"""The process of one probe: python -P -m cosim.doctor.child FMU PROBE INTERFACE ANSWER

ANSWER is a file with lines of JSON: one line before each action, and the verdict as the last line.
The output that the FMU prints is not read.
"""

from __future__ import annotations

import json
import sys

from ..errors import CosimError
from ..fmi.fmu import FMU
from .examination import PROBES


def main(path: str, probe: str, interface: str, answer: str) -> None:
    """Run a probe, and write its actions and its verdict to the file `answer`."""
    with open(answer, "w", encoding="utf-8") as out:

        def write(**line: str) -> None:
            out.write(json.dumps(line) + "\n")
            out.flush()

        write(doing="read the FMU")
        fmu = FMU(path)
        try:
            function = next(p.function for p in PROBES if p.name == probe)
            level, text = function(fmu, interface == "Model Exchange", lambda doing: write(doing=doing))
        except CosimError as error:
            level, text = "error", " | ".join(str(error).splitlines())
        write(level=level, text=text)


if __name__ == "__main__":
    main(*sys.argv[1:])
