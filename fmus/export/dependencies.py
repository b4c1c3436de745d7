"""Dependencies of unknowns on knowns, element by element: the ModelStructure of an FMU.

`cosim.core.dependencies` reads the kernels and answers by variable: a superset, which is
enough to order a run. An exported FMU states the dependencies of each element, so that
answer is refined here by running the model. This is exact where the IR of the kernels
compares no floating-point numbers: the same instructions run for all values, and outputs
are analytic functions of them (sums, products, quotients, functions of libm). An analytic
function that does not depend on an element never changes with it; one that depends on it
changes at almost every point. Points are drawn at random, and taken at zero too, where no
large term hides a small change. Settable parameters are drawn as well, so that a
coefficient that happens to be 0 counts.

Where the IR compares numbers (a saturation, a sign, a hysteresis), the answer by variable is kept.
"""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from cosim import Array, Continuous, Participant
from cosim.codegen.kernels import load
from cosim.core.dependencies import dependencies
from cosim.core.variables import KINDS, Variable

from .link import is_listed, reachable

_DATA_DEPENDENT = re.compile(
    r"\bfcmp\b|\bfpto[su]i\b|llvm\.(min|max|fabs|copysign|floor|ceil|trunc|round|rint)"
)
_PROBES = 3
#: (y - a) + a differs from y in the last digits, and does not depend on a
_ROUNDING = 1e-10
#: more settable parameters than this are not probed
_MOST_PARAMETERS = 200


@dataclass(frozen=True)
class ModelStructure:
    """Dependencies by slot.

    running
        of outputs, states and derivatives on inputs and states
    initial
        of outputs and derivatives on inputs, states and parameters when initialisation ends;
        a missing unknown may depend on all of them
    """

    derivative_of: Mapping[int, int]
    running: Mapping[int, tuple[int, ...]]
    initial: Mapping[int, tuple[int, ...]]


def model_structure(participant: Participant, kernels: str) -> ModelStructure:
    """Return the dependencies of a participant whose kernels have been lowered to `kernels`."""
    variables = participant.variables
    slots = {kind: [s for v in variables.values() if v.kind == kind for s in _slots(v)] for kind in KINDS}
    if not isinstance(participant, Continuous):
        # Outputs of a block are held from its last step: none depends on an input at once.
        held = {slot: () for kind in ("output", "state") for slot in slots[kind]}
        return ModelStructure({}, held, {} if "initialize" in participant.kernels else held)
    with_derivatives = slots["state"] if slots["derivative"] else []  # none: states move by advance alone
    derivative_of = dict(zip(with_derivatives, slots["derivative"], strict=True))
    running: dict[int, tuple[int, ...]] = {}
    for name, known in dependencies(participant).items():
        needed = tuple(s for v in variables.values() if v.name in known for s in _slots(v))
        running |= dict.fromkeys(_slots(variables[name]), needed)
    parameters = [s for v in _settable(participant) for s in _slots(v)]
    unknown = sorted(running)
    initial: dict[int, tuple[int, ...]] = {}
    if not parameters and "initialize" not in participant.kernels:
        initial = dict(running)
    if unknown and not _DATA_DEPENDENT.search(_evaluation(participant, kernels)):
        known_slots = [*slots["input"], *slots["state"]]
        changed = _changes(participant, load(kernels), unknown, known_slots + parameters[:_MOST_PARAMETERS])
        if changed is not None:
            running = {u: tuple(s for s in known_slots if s in changed[u]) for u in unknown}
            if len(parameters) <= _MOST_PARAMETERS:
                initial = {u: tuple(sorted(changed[u])) for u in unknown}
    running |= {slot: (slot,) for slot in slots["state"]}  # a state is known, and an output
    return ModelStructure(derivative_of, running, initial)


def _settable(participant: Participant) -> list[Variable]:
    return [v for v in participant.variables.values() if v.kind == "parameter" and is_listed(v)]


def _slots(v: Variable) -> range:
    return range(v.slot, v.slot + v.size)


def _evaluation(participant: Participant, kernels: str) -> str:
    """Return the IR of an evaluation, which includes `initialize` if a parameter can be set."""
    names = ("derivatives", "outputs", *(["initialize"] if _settable(participant) else []))
    return "".join(body for name in names for body in reachable(kernels, name).values())


def _changes(
    participant: Participant, address: Callable[[str], int], unknown: list[int], known: list[int]
) -> dict[int, set[int]] | None:
    """Return for each unknown slot the known slots that change it in a probe; None if a probe fails."""
    run = _runner(participant, address)
    changed = {slot: set[int]() for slot in unknown}
    slots = np.array(unknown)
    first, size = participant.zones["local"]  # working memory, whose contents do not matter
    ports, rest = slice(0, first), slice(first + size, None)
    generator = np.random.default_rng(1)
    for probe in range(2 * _PROBES):
        base = _point(participant, generator, origin=probe % 2 == 0)
        t = generator.uniform(0.1, 1.0)
        storage = base.copy()
        if not run(storage, t) or not np.isfinite(storage[slots]).all():
            return None
        before = storage[slots]
        for s in known:
            storage[ports], storage[rest] = base[ports], base[rest]
            storage[s] = _moved(base[s], generator)
            if not run(storage, t):
                return None
            # negated, so that NaN is a change
            same = np.abs(storage[slots] - before) <= _ROUNDING * np.abs(before)
            for slot in slots[~same]:
                changed[int(slot)].add(s)
    return changed


def _moved(x: float, generator: np.random.Generator) -> float:
    return float(x * generator.uniform(1.05, 1.1) if x else generator.uniform(0.5, 1.5))


def _point(participant: Participant, generator: np.random.Generator, *, origin: bool) -> Array:
    """Return a storage to probe at: inputs and states at zero or at random, parameters near their values."""
    storage = participant.memory.copy()
    for v in participant.variables.values():
        here = slice(v.slot, v.slot + v.size)
        if v.kind in ("input", "state"):
            storage[here] = 0.0 if origin else generator.normal(size=v.size)
    for v in _settable(participant):
        here = slice(v.slot, v.slot + v.size)
        moved = storage[here] * generator.uniform(0.9, 1.1, v.size)
        moved += np.where(moved == 0.0, generator.uniform(0.1, 1.0, v.size), 0.0)
        storage[here] = np.clip(moved, v.min, v.max)
    return storage


def _runner(participant: Participant, address: Callable[[str], int]) -> Callable[[Array, float], bool]:
    """Return a function that evaluates a storage as the FMU does and returns whether that succeeded."""
    prototype = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_double, ctypes.c_double)
    names = [n for n in ("initialize", "derivatives", "outputs") if n in participant.kernels]
    functions = [prototype(address(f"kernel_{name}")) for name in names]
    return lambda storage, t: not any(f(storage.ctypes.data, t, 0.0) for f in functions)
