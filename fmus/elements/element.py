"""An element: a force law, its parameters, and the displacements that deform it.

A law gives the force at the end of a step as a function of the deformation there. It is
compiled, so it may contain numbers, `if`, loops over ranges, abs, min, max, the functions of
math, and functions of the same kind; it must not make an array (as np.interp does), a list,
a dict or text. It needs no registration: a structure compiles the laws of its own elements.

An element of one row has one deformation d = row . x and the law

    force, tangent, stored, lost = law(e, d, d0, rate, h, p, z0, z)

    e        row of the element in p, z0 and z
    d, d0    deformation at the end and at the start of the step        m
    rate     deformation rate at the end, 2 (d - d0)/h - rate0          m/s
    h        length of the step                                         s
    p        parameters, p[e, 0], p[e, 1], ... as the element lists them
    z0, z    memory at the start (read) and at the end of the step (written)
    force    force at the end of the step                               N
    tangent  d force/d d, with the rate given by its formula above      N/m
    stored   recoverable energy at the end of the step                  J
    lost     energy dissipated in the step                              J

An element of two rows e and e + 1 has two deformations and one law for both,

    stored, lost = law(e, d, d0, p, z0, z, force, tangent, coupling)

which writes force[e], force[e + 1], tangent[e], tangent[e + 1] and
coupling[e] = d force[e]/d d[e + 1].

A compiled law does not notice an index outside p or z. Interpreted, it raises an IndexError:
in the tests of the law, in a run with jit=False, and when `NonlinearStructure.build` calls it
once at rest (at_rest.py).

`scale` is the smallest deformation at which the law changes, such as the first corner. A step
may be repeated or divided, so z is the only memory of a law. Two places of z are outputs of
the structure; the places from OWN on belong to the law. Leave `memory` at its default if the
law keeps nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim import Array, DeclarationError

#: places in the memory of a row
YIELDING = 0  # 1 or -1 while the row yields in that direction, otherwise 0
PLASTIC = 1  # plastic deformation
OWN = 2  # first place for the law's own memory

#: force, tangent, stored, lost
Response = tuple[float, float, float, float]
Law = Callable[..., Any]


@dataclass(frozen=True)
class Element:
    """One element of a structure."""

    law: Law  # force law of one or of two rows
    rows: Array  # (1, n) or (2, n): deformation for unit displacements
    parameters: tuple[float, ...]
    k0: float  # tangent at rest in a long step; the stiffness matrix of the structure contains it
    scale: float  # smallest deformation at which the law changes; convergence is relative to it
    k0_coupling: float = 0.0  # initial tangent between the two rows
    memory: int = 1  # number of places from OWN on

    def __post_init__(self) -> None:
        object.__setattr__(self, "rows", np.atleast_2d(np.asarray(self.rows, float)))
        name = self.law.__module__.rpartition(".")[2]
        if len(self.rows) not in (1, 2):
            raise DeclarationError(f"element {name}: {len(self.rows)} rows; an element has one or two")
        numbers = (*self.parameters, self.k0, self.k0_coupling, self.scale)
        if not (np.isfinite(numbers).all() and np.isfinite(self.rows).all()):
            raise DeclarationError(f"element {name}: its rows and parameters must be finite numbers")
        if not self.scale > 0.0:
            raise DeclarationError(f"element {name}: scale = {self.scale:g}; it must be above zero")
