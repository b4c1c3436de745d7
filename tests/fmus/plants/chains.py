"""A chain of masses with nonlinear elements, and how to shake it: shared by several tests."""

from __future__ import annotations

import numpy as np

from cosim import Block, Output, Parameter, State, System, simulate
from fmus.elements.bilinear import bilinear
from fmus.elements.bouc_wen import bouc_wen
from fmus.elements.friction import friction
from fmus.elements.gap import gap
from fmus.elements.viscous import viscous
from fmus.plants.nonlinear_structure import NonlinearStructure
from fmus.structures.structure import Structure


class Held(Block):
    """Rows of a table, one a communication step."""

    table = Parameter(shape=("n", "m"), fixed=True)
    k = State()
    y = Output(shape="m", unit="m/s^2")

    def step(self, t: float, h: float) -> None:
        for j in range(self.y.shape[0]):
            self.y[j] = self.table[int(self.k), j]
        self.k += 1.0


def shaken(structure, ground, step, record=("plant.y",), jit=True):
    """Run under a ground acceleration given by step, (n, 1). Small ones run interpreted: no compilation."""
    system = System({"plant": structure, "quake": Held(table=ground)}, [("quake.y", "plant.ground")])
    return simulate(system, step=step, stop=(len(ground) - 1) * step, record=list(record), jit=jit)


def chain(n=5, m=2.0, k=900.0, c=1.5):
    """A fixed chain of unequal masses, springs and dashpots."""
    M = m * np.linspace(1.0, 2.0, n)
    K = np.zeros((n, n))
    for i in range(n):
        ki = k * (1.0 + 0.3 * i)
        K[i, i] += ki
        if i:
            K[i - 1, i - 1] += ki
            K[i, i - 1] -= ki
            K[i - 1, i] -= ki
    return np.diag(M), c / k * K + 0.1 * np.diag(M), K


def drift(n, i):
    row = np.zeros(n)
    row[i] = 1.0
    if i:
        row[i - 1] = -1.0
    return row


def yielding_plant(bisections=6, **values):
    n = 3
    M, C, K = chain(n)
    elements = [
        bilinear(drift(n, 0), 900.0, 60.0, 0.01),
        bouc_wen(drift(n, 2), 400.0, 0.1, 0.008),
        viscous(drift(n, 1), 6.0, 0.6, 0.02),
        gap(drift(n, 1), 3000.0, 0.012),
        friction(drift(n, 2), 500.0, 1.5),
    ]
    for e in elements[1:]:  # the bilinear element is the chain's own spring, which K contains already
        K = K + e.k0 * e.rows.T @ e.rows
    structure = Structure(M, C, K, np.ones(n), displacements=np.eye(n), accelerations=np.eye(n))
    return NonlinearStructure.build(structure, elements, bisections=bisections, **values)
