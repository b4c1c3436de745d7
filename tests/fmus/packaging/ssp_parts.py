"""Participants for tests of SSP, their FMUs, and SSP's schemas."""

from __future__ import annotations

import zipfile
from functools import lru_cache
from pathlib import Path

import fmpy
import numpy as np
import pyssp_standard
from lxml import etree

from cosim import Block, Continuous, Input, Output, Parameter, State, System
from cosim.ssp.format import NAMESPACES

_SCHEMAS = {
    "1.0": Path(fmpy.__file__).parent / "ssp" / "schema",
    "2.0": Path(pyssp_standard.__file__).parent / "resources" / "ssp2",
}


class Frame(Continuous):
    """Two stories: x'' = -K x - 0.4 v + F / m in kN and mm, the acceleration with feedthrough."""

    K = Parameter([[60.0, -25.0], [-25.0, 25.0]], "stiffness over mass", shape=(2, 2), unit="1/s^2")
    m = Parameter([2.0, 1.5], "masses", shape=2, unit="Mg")
    F = Input("forces", unit="kN", shape=2)
    x = State([3.0, -7.0], "displacements", unit="mm", shape=2)
    v = State(0.0, "velocities", unit="mm/s", shape=2)
    a = Output("accelerations", unit="mm/s^2", shape=2)

    def derivatives(self, t: float) -> None:
        for i in range(2):
            self.der_x[i] = self.v[i]
            self.der_v[i] = -0.4 * self.v[i] + 1000.0 * self.F[i] / self.m[i]
            for j in range(2):
                self.der_v[i] -= self.K[i, j] * self.x[j]

    def outputs(self, t: float) -> None:
        for i in range(2):
            self.a[i] = self.der_v[i]


class Damper(Block):
    """f = -(C v) - g a, with a memory of the force: nothing symmetric, SI units"""

    C = Parameter([[900.0, 110.0], [70.0, 600.0]], "damping", shape=(2, 2), unit="N*s/m")
    g = Parameter(20.0, "mass", unit="kg")
    v = Input("velocities", unit="m/s", shape=2)
    a = Input("accelerations", unit="m/s^2", shape=2)
    f = Output("forces", unit="N", shape=2)
    work = State(0.0, "sum of |f|", unit="N")

    def step(self, t: float, h: float) -> None:
        for i in range(2):
            self.f[i] = -self.g * self.a[i]
            for j in range(2):
                self.f[i] -= self.C[i, j] * self.v[j]
            self.work += abs(self.f[i])


class Watch(Block):
    """y = 2 p + q, for what is left over: scalars, a delayed input"""

    p = Input("a force", unit="kN")
    q = Input("a displacement", unit="m", start=0.25)
    y = Output("a mixture")

    def step(self, t: float, h: float) -> None:
        self.y = 2.0 * self.p + self.q


def loop() -> System:
    """Frame, damper with a sample period, watch: arrays, slices, units, one late connection."""
    system = System({"frame": Frame(), "damper": Damper(sample_period=0.02), "watch": Watch(every=2)})
    system.connect("frame.v", "damper.v")
    system.connect("frame.a[1]", "damper.a[2]")
    system.connect("frame.a[2]", "damper.a[1]", initial=[0.125])
    system.connect("damper.f", "frame.F")
    system.connect("damper.f[2]", "watch.p", initial=3.0)
    system.connect("frame.x[2]", "watch.q", transformation=(0.1 + 0.2, 1e-3 / 3.0))
    return system


class Brake(Block):
    """u = -b v"""

    b = Parameter(0.8, "damping", unit="N*s/m")
    v = Input("velocity", unit="m/s")
    u = Output("force", unit="N")

    def step(self, t: float, h: float) -> None:
        self.u = -self.b * self.v


class Mass(Continuous):
    """x'' = 2 (u + d) - 3 x: nothing at rest is 1"""

    u = Input("control force", unit="N")
    d = Input("disturbance", unit="N")
    x = State(0.0, "displacement", unit="m")
    v = State(0.0, "velocity", unit="m/s")

    def derivatives(self, t: float) -> None:
        self.der_x = self.v
        self.der_v = 2.0 * (self.u + self.d) - 3.0 * self.x


class Sine(Block):
    """d = 4 sin 3 t: zero at first"""

    d = Output("force", unit="N")

    def step(self, t: float, h: float) -> None:
        self.d = 4.0 * np.sin(3.0 * t)


def at_rest() -> System:
    parts = {"mass": Mass(), "brake": Brake(), "sine": Sine()}
    return System(parts, [("mass.v", "brake.v"), ("brake.u", "mass.u"), ("sine.d", "mass.d")])


def frame() -> System:
    """Arrays, units (kN, mm) and parameters that are not those of the FMUs' class."""
    system = System({"frame": Frame(m=[2.5, 1.25]), "damper": Damper(g=3.0)})
    system.connect("frame.v", "damper.v")
    system.connect("frame.a", "damper.a")
    system.connect("damper.f", "frame.F")
    return system


@lru_cache
def schema(version: str, name: str) -> etree.XMLSchema:
    """Return one of SSP's schemas: those of 1.0 are in FMPy, those of 2.0 in pyssp-standard."""
    return etree.XMLSchema(file=str(_SCHEMAS[version] / f"SystemStructure{name}.xsd"))


def validated(path: Path) -> etree._Element:
    """Return the root of an SSP's SSD, valid by the schemas of its version; so are the sets in it."""
    with zipfile.ZipFile(path) as archive:
        root = etree.fromstring(archive.read("SystemStructure.ssd"))
    version = root.get("version")
    schema(version, "Description").assertValid(root)
    for parameters in root.iterfind(".//ssv:ParameterSet", NAMESPACES):
        alone = etree.fromstring(etree.tostring(parameters))
        schema(version, "ParameterValues").assertValid(alone)
    return root
