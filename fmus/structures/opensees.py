"""A model built with OpenSeesPy as a plant: its mass, damping and initial stiffness.

    import openseespy.opensees as ops
    ...                                  # nodes, elements, masses, rayleigh, as usual
    model = opensees_model(ops)
    plant = NonlinearStructure.build(
        model.M, model.C, model.K, model.influence((1, 2)),
        elements=[bilinear(model.row({(7, 1): 1.0, (3, 1): -1.0}), k1, k2, dy)],
        displacements=model.row({(7, 1): 1.0}),
    )

A hysteretic element takes part with its initial tangent in K: put an elastic spring of
that stiffness into the OpenSees model, or add k0 row' row to K. OpenSees hands the
matrices out through its integrator GimmeMCK; constraints are those of the handler
`Transformation`. OpenSeesPy is not a dependency: the module is passed in.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim import Array, CosimError


@dataclass(frozen=True)
class OpenSeesModel:
    """Lumped masses (n), damping and stiffness (n, n), and where each node's freedom is."""

    M: Array
    C: Array
    K: Array
    index: Mapping[tuple[int, int], int]  # (node, direction from 1) -> row; fixed ones are missing

    def row(self, weights: Mapping[tuple[int, int], float]) -> Array:
        """A row over the degrees of freedom; fixed ones are left out."""
        row = np.zeros(len(self.M))
        for (node, direction), weight in weights.items():
            if (node, direction) in self.index:
                row[self.index[node, direction]] += weight
        return row

    def influence(self, directions: Sequence[int]) -> Array:
        """(n, directions): displacements when the ground moves by 1 in each direction."""
        influence = np.zeros((len(self.M), len(directions)))
        for (_, direction), i in self.index.items():
            if direction in directions:
                influence[i, list(directions).index(direction)] = 1.0
        return influence


def opensees_model(ops: Any) -> OpenSeesModel:
    """Read the matrices of the model that the module `ops` (openseespy.opensees) holds."""
    ops.wipeAnalysis()
    ops.constraints("Transformation")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    ops.algorithm("Linear")
    matrices = []
    for m, c, k in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)):
        ops.integrator("GimmeMCK", m, c, k)
        ops.analysis("Transient", "-noWarnings")
        ops.analyze(1, 0.0)
        n = ops.systemSize()
        if not n:
            raise CosimError(
                "the OpenSees model has no free degree of freedom; build nodes and elements first"
            )
        matrices.append(np.array(ops.printA("-ret")).reshape(n, n))
    index = {
        (node, direction + 1): equation
        for node in ops.getNodeTags()
        for direction, equation in enumerate(ops.nodeDOFs(node))
        if equation >= 0
    }
    ops.wipeAnalysis()
    M, C, K = matrices
    if np.abs(M - np.diag(np.diag(M))).max() > 1e-9 * np.abs(M).max():
        raise CosimError("the OpenSees model has a consistent mass matrix; use lumped masses (no -cMass)")
    return OpenSeesModel(np.diag(M).copy(), 0.5 * (C + C.T), 0.5 * (K + K.T), index)
