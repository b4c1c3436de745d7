"""OpenSees as an independent implementation: uniaxial materials, and a frame that becomes a plant.

Where openseespy cannot be imported, the module is skipped with the reason.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cosim import System, simulate
from fmus.elements.bilinear import bilinear
from fmus.elements.bouc_wen import bouc_wen
from fmus.packaging.other_tools import opensees
from fmus.plants.nonlinear_structure import NonlinearStructure
from fmus.structures.opensees import opensees_model
from tests.fmus.elements.paths import drive
from tests.fmus.plants.chains import Held
from tests.others import tool

ops = tool(opensees)

PATH = 0.08 * np.sin(np.linspace(0.0, 14.0, 2001)) * np.linspace(0.1, 1.0, 2001)


def material(kind, arguments):
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    ops.uniaxialMaterial(kind, 1, *arguments)
    ops.testUniaxialMaterial(1)
    stress = []
    for d in PATH:
        ops.setStrain(float(d))
        stress.append(ops.getStress())
    return np.array(stress)


def test_bilinear_is_steel01():
    """Both are exact on a given path: to rounding (1e-10)."""
    k1, k2, dy = 4.8e6, 6.0e5, 0.015
    ours = drive(bilinear(np.ones(1), k1, k2, dy), PATH)[:, 0]
    assert np.abs(ours - material("Steel01", (k1 * dy, k1, k2 / k1))).max() < 1e-10 * np.abs(ours).max()


def test_bouc_wen_is_boucwen():
    """OpenSees integrates z by backward Euler, we by the midpoint rule: first order apart, with
    steps up to 4 % of dy; 2 % of the largest force."""
    k1, alpha, dy, n, beta, gamma = 4.8e6, 0.1, 0.015, 1.5, 0.6, 0.4
    ours = drive(bouc_wen(np.ones(1), k1, alpha, dy, n, beta, gamma), PATH)[:, 0]
    theirs = material(
        "BoucWen", (alpha, k1, n, gamma / dy**n, beta / dy**n, 1.0, 0.0, 0.0, 0.0)
    )  # z there is a deformation
    assert np.abs(ours - theirs).max() < 0.02 * np.abs(ours).max()


def portal(yielding):
    """A portal frame; its beam's far end is tied to a spring of stiffness 3e4 N/m along x."""
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 3)
    for tag, x, y in ((1, 0.0, 0.0), (2, 0.0, 3.0), (3, 4.0, 3.0), (4, 4.0, 0.0), (5, 4.0, 3.0)):
        ops.node(tag, x, y)
    for tag in (1, 4, 5):
        ops.fix(tag, 1, 1, 1)
    ops.mass(2, 400.0, 400.0, 10.0)
    ops.mass(3, 700.0, 700.0, 20.0)
    ops.geomTransf("Linear", 1)
    for tag, (a, b) in enumerate(((1, 2), (2, 3), (3, 4)), start=1):
        ops.element("elasticBeamColumn", tag, a, b, 0.01, 2e10, 2e-6, 1)
    if yielding:
        ops.uniaxialMaterial("Steel01", 1, 300.0, 3e4, 0.1)
    else:
        ops.uniaxialMaterial("Elastic", 1, 3e4)
    ops.element("zeroLength", 4, 5, 3, "-mat", 1, "-dir", 1)


def test_frame_of_opensees_moves_as_in_opensees():
    """Newmark 1/4, 1/2 in both, a spring that yields at 10 mm; OpenSees iterates to 1e-10, events are
    not bisected: 1e-6 of the largest displacement."""
    h, n = 0.005, 801
    t = np.arange(n + 1) * h
    ground = 3.0 * np.sin(9.0 * t) * np.minimum(t, 1.0)
    portal(yielding=False)
    model = opensees_model(ops)
    tip = model.freedoms.row({(3, 1): 1.0})
    structure = replace(model, influence=model.freedoms.rigid_motion((1,)), displacements=tip)
    plant = NonlinearStructure.build(structure, [bilinear(tip, 3e4, 3e3, 0.01)], event_tolerance=1e9)
    means = 0.5 * (ground[:-1] + ground[1:])[:, None]
    system = System({"plant": plant, "quake": Held(table=means)}, [("quake.y", "plant.ground")])
    ours = simulate(system, step=h, stop=(n - 1) * h, record=["plant.y"], jit=False)["plant.y"].ravel()

    portal(yielding=True)
    ops.timeSeries("Path", 1, "-dt", h, "-values", *ground.tolist())
    ops.pattern("UniformExcitation", 1, 1, "-accel", 1)
    ops.constraints("Transformation")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    ops.test("NormDispIncr", 1e-12, 30)
    ops.algorithm("Newton")
    ops.integrator("Newmark", 0.5, 0.25)
    ops.analysis("Transient")
    theirs = [0.0]
    for _ in range(n - 1):
        assert ops.analyze(1, h) == 0
        theirs.append(ops.nodeDisp(3, 1))
    assert np.abs(ours).max() > 0.02  # it yields
    assert np.abs(ours - theirs).max() < 1e-6 * np.abs(theirs).max()
