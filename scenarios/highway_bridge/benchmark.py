"""The 430-degree-of-freedom model of the 91/5 overcrossing, from a user's benchmark data.

Agrawal, Tan, Nagarajaiah and Zhang (2009), phase I. The project does not contain the
model; `phase1_430dof.npz` is read from a folder given by the user. It holds M_diag, K,
C (initial tangent), I1 (influence), bearing_rows, k1, k2, y_yield, col_local_rows,
col_k_A1, EI, EI1, MP. The outputs are those of the reduced model (bridge.py): elements are
16 bearings, then the columns' segments; y is the midspan in x and y, a the absolute
acceleration there and at the deck's two ends.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fmus.elements.bilinear import bilinear
from fmus.elements.column_segment import column_segment
from fmus.elements.element import Element
from fmus.plants.nonlinear_structure import NonlinearStructure
from fmus.structures.structure import Structure

#: degrees of freedom of the deck over the bent, x and y: found by comparison with the midspan
#: histories of the benchmark
MIDSPAN = (89, 90)
#: degrees of freedom of the deck's ends, x and y, to which the bearings are attached
ENDS = (0, 1, 179, 180)


def benchmark_bridge(
    folder: Path | str, *, late_events: bool = False, bisections: int = 5
) -> NonlinearStructure:
    """Return the model; with `late_events` columns yield a step late, as in the benchmark's code."""
    data = np.load(Path(folder) / "phase1_430dof.npz")
    M, C, K = data["M_diag"], data["C"], data["K"]
    bearings = data["bearing_rows"]
    elements: list[Element] = [
        bilinear(row, k1, k2, dy)
        for row, k1, k2, dy in zip(bearings, data["k1"], data["k2"], data["y_yield"], strict=True)
    ]
    k11, k12 = data["col_k_A1"][4, 4], data["col_k_A1"][4, 10]
    flexibility = np.linalg.inv([[k11, k12], [k12, k11]])
    for moments in data["col_local_rows"]:
        for ends in ((0, 2), (1, 3)):  # M5 and M11, M6 and M12
            rotations = flexibility @ moments[list(ends)]
            rotations[np.abs(rotations) < 1e-9 * np.abs(rotations).max()] = 0.0
            elements.append(
                column_segment(
                    rotations, k11, k12, float(data["EI"]), float(data["EI1"]), float(data["MP"]), late_events
                )
            )
    at = np.eye(len(M))
    displacements, accelerations = at[list(MIDSPAN)], at[[*MIDSPAN, *ENDS]]
    structure = Structure(np.diag(M), C, K, data["I1"], bearings, displacements, accelerations)
    return NonlinearStructure.build(structure, elements, bisections=bisections)
