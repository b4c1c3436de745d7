"""One interpreted call of an element's law at rest, before the law is compiled.

At rest d = d0 = 0, rate = 0 and z0 = 0; the tangent must be the element's k0. The step is so
long that terms of the rate, such as 2/h in the tangent of a damper, vanish. The arrays have
the size of the element's own rows, so an index outside them is noticed.
"""

from __future__ import annotations

import math
import traceback
from typing import Any

import numpy as np

from cosim import DeclarationError

from .element import OWN, Element

LONG_STEP = 1e30  # s
TANGENT_TOLERANCE = 1e-6  # relative to k0
NEGLIGIBLE = 1e-9  # N/m, or N*m; a stiffness below this is zero
#: errors that a wrongly written law raises
LAW_ERRORS = (ArithmeticError, AttributeError, LookupError, NameError, TypeError, ValueError)
RETURNED = {1: ("force", "tangent", "stored", "lost"), 2: ("stored", "lost")}  # by number of rows


def check_at_rest(element: Element, where: str) -> None:
    """Refuse an element whose law fails at rest, or whose tangent there differs from k0."""
    law: Any = element.law
    rows = len(element.rows)
    where = f"{where} ({law.__module__}.{law.__name__})"
    place = f"{law.__code__.co_filename}, line {law.__code__.co_firstlineno}"
    p = np.tile(element.parameters, (rows, 1))
    z0, z = np.zeros((2, rows, OWN + element.memory))
    d, d0, force, tangent, coupling = np.zeros((5, rows))
    try:
        with np.errstate(all="ignore"):  # a tangent that is not a number is refused below
            if rows == 1:
                returned = law(0, 0.0, 0.0, 0.0, LONG_STEP, p, z0, z)
            else:
                returned = law(0, d, d0, p, z0, z, force, tangent, coupling)
    except LAW_ERRORS as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        if last.filename != __file__:
            place = f"{last.filename}, line {last.lineno}"
        raise DeclarationError(
            f"{where}: {type(error).__name__}: {error}; {_remedy(error, element)}; see {place}"
        ) from error
    count = len(returned) if isinstance(returned, tuple) else 1
    if count != len(RETURNED[rows]):
        raise DeclarationError(
            f"{where}: the law must return {', '.join(RETURNED[rows])}, but the number of values "
            f"that it returns is {count}; see {place}"
        )
    if rows == 1:
        tangent[0] = returned[1]
    declared = {"k0": (element.k0, *tangent)}
    if rows == 2:
        declared["k0_coupling"] = (element.k0_coupling, coupling[0])
    for name, (k0, *values) in declared.items():
        for value in values:
            if not math.isclose(value, k0, rel_tol=TANGENT_TOLERANCE, abs_tol=NEGLIGIBLE):
                raise DeclarationError(
                    f"{where}: {name} = {k0:.9g}, but the law has the tangent {value:.9g} at rest (d = 0); "
                    f"correct {name} in the function that makes the element, or the law; see {place}"
                )


def _remedy(error: Exception, element: Element) -> str:
    """Return how to mend a law that raises this error at rest."""
    if isinstance(error, NameError):
        return "define the name in the law or at the top of its file"
    if isinstance(error, IndexError):
        return (
            f"a row of p has {len(element.parameters)} places, one for each parameter, and a row of z has "
            f"{OWN + element.memory}, the first {OWN} and memory = {element.memory} of the law's own; "
            "correct the index, parameters or memory"
        )
    return "the law must be defined at rest (d = 0)"
