"""A model built with OpenSeesPy as a `Structure`: its mass, damping and initial stiffness.

    import openseespy.opensees as ops
    ...                                  # nodes, elements, masses, rayleigh, as usual
    model = opensees_model(ops)
    structure = replace(                 # dataclasses.replace
        model, influence=model.freedoms.rigid_motion((1, 2)), displacements=model.freedoms.row({(7, 1): 1.0})
    )
    bearing = bilinear(model.freedoms.row({(7, 1): 1.0, (3, 1): -1.0}), k1, k2, dy)
    plant = NonlinearStructure.build(structure, [bearing])

K must contain the initial tangent of every nonlinear element: put an elastic spring of that
stiffness into the OpenSees model, or add k0 row' row to K. The matrices come from OpenSees'
integrator GimmeMCK, with the constraint handler `Transformation`. OpenSeesPy is not a
dependency: its module is an argument.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .structure import Freedoms, Structure, StructureError


def opensees_model(ops: Any) -> Structure:
    """Read the matrices of the present model of the module `ops` (openseespy.opensees)."""
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
            raise StructureError(
                "the OpenSees model has no free degree of freedom; build nodes and elements first"
            )
        matrices.append(np.array(ops.printA("-ret")).reshape(n, n))
    freedoms = Freedoms(
        {
            (node, direction + 1): equation
            for node in ops.getNodeTags()
            for direction, equation in enumerate(ops.nodeDOFs(node))
            if equation >= 0
        }
    )
    ops.wipeAnalysis()
    M, C, K = matrices
    if np.abs(M - np.diag(np.diag(M))).max() > 1e-9 * np.abs(M).max():
        raise StructureError("the OpenSees model has a consistent mass matrix; use lumped masses (no -cMass)")
    return Structure(np.diag(np.diag(M)), 0.5 * (C + C.T), 0.5 * (K + K.T), freedoms=freedoms)
