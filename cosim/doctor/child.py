"""One probe in a process of its own: python -m cosim.doctor.child FMU PROBE INTERFACE ANSWER

ANSWER is a file of lines of JSON: what is being done, one line each time, and at the end
the verdict. What the FMU prints is of no interest.
"""

from __future__ import annotations

import json
import sys

from ..errors import CosimError
from ..fmi.fmu import FMU
from .examination import PROBES


def main(path: str, probe: str, interface: str, answer: str) -> None:
    """Run a probe, and write what it does and finds."""
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
