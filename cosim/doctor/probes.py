"""The probes: each examines one property of an FMU and reports its finding.

A probe takes the FMU, whether to use Model Exchange, and `doing`, which it calls with a text before
every action, so that the last action is known if the FMU ends the process. It returns a level
(report.LEVELS) and a text. The first line of its docstring states the sound behaviour. The probes
of misuse are in misuse.py.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import numpy as np

from ..errors import CosimError, WiringError
from ..fmi.fmu import FMU
from ..fmi.ports import unit_definitions
from ..loop.instance import buffer
from ..units import parse
from .memory import handles, memory
from .subject import STEPS, Subject, Values, difference, same

Verdict: TypeAlias = tuple[str, str]
Doing: TypeAlias = Callable[[str], None]
Probe: TypeAlias = Callable[[FMU, bool, Doing], Verdict]

INSTANCES = 1000
#: bytes of growth per instance: below SMALL it is noise, above LARGE a campaign runs out of memory
SMALL, LARGE = 1024, 102_400
#: difference between two step sizes, as a part of the range of an output
ROUNDING, COARSE = 1e-6, 0.1
#: rounding that remains where two terms of an input cancel, as a part of the values of an output
CANCELLED = 1e-10
_NAMED = 4  # number of ports that one line names


def named(names: list[str]) -> str:
    """Return the first few names as a text, and the number of the others."""
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more


# ----------------------------------------------------------------------------- the file


def validity(fmu: FMU, model_exchange: bool, doing: Doing) -> Verdict:
    """The file passes FMPy's validation of schema, names, model structure, start values and units."""
    from fmpy.validation import validate_fmu

    doing("validate")
    problems = [" ".join(p.split())[:200] for p in validate_fmu(str(fmu.path))]
    if problems:
        more = f" ({len(problems)} problems in all)" if len(problems) > 1 else ""
        return "error", f"not valid: {problems[0]}{more}"
    return "ok", f"valid, {len(fmu.variables)} variables"


def units(fmu: FMU, model_exchange: bool, doing: Doing) -> Verdict:
    """Real inputs and outputs have units that can be converted."""
    doing("read the units")
    ports = {**fmu.input_ports, **fmu.output_ports}
    reals = {n: p for n, p in ports.items() if fmu.version.numbers[p.type][1].is_float}
    ends = {n: p for n, p in reals.items() if p.variables[0].causality in ("input", "output")}
    without = [n for n, p in ends.items() if p.unit is None]
    unknown = set()
    for unit in {p.unit for p in ends.values()} - {None} - unit_definitions(fmu.description).keys():
        try:
            parse(str(unit))
        except WiringError:
            unknown.add(str(unit))
    parts = []
    if without:
        parts.append(f"{len(without)} of {len(ends)} inputs and outputs have none: {named(without)}")
    if unknown:
        parts.append(f"not known, so not converted: {named(sorted(unknown))}")
    return ("note", "; ".join(parts)) if parts else ("ok", f"{len(ends)} inputs and outputs have one")


# ------------------------------------------------------------------------- its instances

ONCE: Verdict = ("note", "not tried: only one instance in a process, as declared")


def _interface(fmu: FMU, model_exchange: bool) -> Any:
    return fmu.description.modelExchange if model_exchange else fmu.description.coSimulation


def instance(fmu: FMU, model_exchange: bool, doing: Doing) -> Verdict:
    """The library loads; an instance is made, initialized, moved, terminated and freed."""
    doing("load the library and instantiate")
    subject = Subject(fmu, model_exchange)
    doing("initialize")
    subject.start()
    doing("do steps")
    subject.run(3)
    doing("terminate and free the instance")
    subject.stop()
    length = "" if model_exchange else f" of {subject.h:g} s"
    return "ok", f"loads, initializes, does 3 steps{length}, ends"


def initial_values(fmu: FMU, model_exchange: bool, doing: Doing) -> Verdict:
    """After initialization, outputs, derivatives and event indicators are finite."""
    doing("initialize")
    subject = Subject(fmu, model_exchange)
    subject.start()
    doing("get the outputs")
    values: dict[str, Any] = dict(subject.read())
    text = f"{sum(v.size for v in values.values())} output values finite"
    if model_exchange:
        model = subject.model
        slopes, states, indicators = (buffer(n) for n in (model.n_states, model.n_states, model.n_indicators))
        doing("get derivatives and event indicators")
        if model.n_states:
            model.get_derivatives(slopes.ctypes.data)
        model.get_indicators(indicators.ctypes.data)
        model.get_states(states.ctypes.data)
        values |= {"derivatives": slopes, "event indicators": indicators, "states": states}
        text += f", {model.n_states} derivatives and {model.n_indicators} event indicators"
    bad = [n for n, v in values.items() if not np.isfinite(v.astype(float)).all()]
    subject.stop()
    return ("error", f"not finite: {named(bad)}") if bad else ("ok", text)


def reset(fmu: FMU, model_exchange: bool, doing: Doing) -> Verdict:
    """After reset, a run is the same bit for bit; if it is not, a new instance is compared as well."""
    subject = Subject(fmu, model_exchange)
    doing("initialize")
    subject.start()
    inputs, start = subject.start_inputs, subject.read()
    doing(f"do {STEPS} steps")
    first = [start, *subject.run()]
    doing("reset")
    subject.driver.attempt("reset", subject.api.reset)
    subject.start()
    kept = [n for n, v in inputs.items() if not same(v, subject.start_inputs[n])]
    subject.set({n: inputs[n] for n in kept})
    subject.start_inputs = inputs
    start = subject.read()
    doing(f"do {STEPS} steps after reset")
    second = [start, *subject.run()]
    doing("terminate and free the instance")
    subject.stop()
    changed = difference((first, second), 0)
    if not changed and kept:
        return "warning", f"inputs keep their values: {named(kept)}; set again, the run repeats bit for bit"
    if not changed:
        return "ok", f"repeats {STEPS} steps bit for bit"
    if _interface(fmu, model_exchange).canBeInstantiatedOnlyOncePerProcess:
        return "error", f"the run after reset differs: {changed}"
    doing("repeat the run in a new instance")
    other = Subject(fmu, model_exchange).start()
    fresh = difference((first, [other.read(), *other.run()]), 0)
    how = "a new instance differs, too" if fresh else "a new instance repeats it"
    return "error", f"the run after reset differs: {changed}; {how}"


def state(fmu: FMU, model_exchange: bool, doing: Doing) -> Verdict:
    """A saved state repeats the run when it is set, also from bytes and in another instance."""
    interface = _interface(fmu, model_exchange)
    if not interface.canGetAndSetFMUstate:
        return "note", "not declared: it cannot be saved and returned to"
    subject = Subject(fmu, model_exchange).start()
    half = STEPS // 4  # the inputs change later, so that they have to be restored as well
    subject.run(half)
    doing("get the state")
    saved = subject.save()
    first = [subject.read(), *subject.run(STEPS, half)]
    doing("set the state")
    subject.restore(saved)
    second = [subject.read(), *subject.run(STEPS, half)]
    if changed := difference((first, second), half):
        return "error", f"the run after the state was set differs: {changed}"
    if not interface.canSerializeFMUstate:
        doing("free the state")
        subject.forget(saved)
        subject.stop()
        return "ok", f"repeats {STEPS} steps bit for bit; not as bytes (not declared)"
    doing("serialise the state")
    data = subject.driver.attempt("serialise its state", subject.api.serializeFMUState, saved[0])
    doing("free the state")
    subject.forget(saved)
    if not interface.canBeInstantiatedOnlyOncePerProcess:
        doing("instantiate another one")
        subject = Subject(fmu, model_exchange, "another").start()
    doing("deserialise the state")
    read = subject.driver.attempt("read its state", subject.api.deserializeFMUState, data), saved[1]
    doing("set the deserialised state")
    subject.restore(read)
    third = [subject.read(), *subject.run(STEPS, half)]
    subject.forget(read)
    subject.stop()
    if changed := difference((first, third), half):
        return "error", f"the run after the state was read from bytes differs: {changed}"
    return "ok", f"repeats {STEPS} steps bit for bit, also from {len(data):,} bytes"


def leak(fmu: FMU, model_exchange: bool, doing: Doing) -> Verdict:
    """Memory and handles do not grow over many instances in one process, one after the other."""
    if _interface(fmu, model_exchange).canBeInstantiatedOnlyOncePerProcess:
        return ONCE
    warm = INSTANCES // 5
    subject = Subject(fmu, model_exchange).start()
    before = (0, 0)
    for i in range(INSTANCES):
        doing(f"make instance {i + 1} of {INSTANCES}")
        if i > 0:
            subject.driver.make()
            subject.start()
        subject.step(subject.t0, subject.h)
        subject.stop()
        if i + 1 == warm:
            before = memory(), handles()
    grown = (memory() - before[0]) / (INSTANCES - warm)
    opened = handles() - before[1]
    if opened > 0:
        return "error", f"{INSTANCES} instances leave {opened} handles open"
    if grown >= SMALL:
        level = "warning" if grown < LARGE else "error"
        return level, f"every instance leaves {grown / 1024:.3g} KiB of memory (of {INSTANCES})"
    return "ok", f"{INSTANCES} instances leave no memory and no handles"


def several(fmu: FMU, model_exchange: bool, doing: Doing) -> Verdict:
    """The run of an instance is the same while another one runs in alternation with other inputs."""
    if _interface(fmu, model_exchange).canBeInstantiatedOnlyOncePerProcess:
        return ONCE
    doing("run one instance")
    alone = Subject(fmu, model_exchange, "alone").start()
    first = [alone.read(), *alone.run()]
    alone.stop()
    doing("make two instances")
    one, other = (Subject(fmu, model_exchange, name) for name in ("one", "other"))
    second = [one.start().read()]
    other.start()
    for k in range(STEPS):
        doing(f"do step {k + 1} of two instances")
        other.set(other.excited(0.3 + 0.1 * k))
        other.step(other.t0 + k * other.h, other.h)
        second += one.run(1, k)
    doing("free one of two instances")
    other.stop()
    one.stop()
    changed = difference((first, second), 0)
    if changed:
        return "error", f"an instance changes when another one runs: {changed}"
    return "ok", f"two, step by step in turn, do not change each other in {STEPS} steps"


# --------------------------------------------------------------------- inputs and steps


def feedthrough(fmu: FMU, model_exchange: bool, doing: Doing) -> Verdict:
    """The outputs that change at once when an input is changed without a step are declared."""
    subject = Subject(fmu, model_exchange)
    if not subject.inputs:
        return "ok", "no continuous inputs"
    subject.start()
    subject.run(2)
    doing("get the outputs twice")
    base = subject.read()
    if unread := _changed(base, subject.read()):
        return "error", f"getting the outputs changes them: {named(unread)}"
    seen: dict[str, set[str]] = {n: set() for n in subject.outputs}
    held = subject.get(subject.inputs)
    for name in subject.inputs:
        doing(f"change {name} without a step")
        for amount in (0.37, -0.21):
            subject.set({name: subject.moved(name, amount)})
            for output in _changed(base, subject.read()):
                seen[output].add(name)
        subject.set({name: held[name]})
        base = subject.read()
    subject.stop()
    return _judged(fmu, subject, seen)


def _changed(before: Values, after: Values) -> list[str]:
    """Return the ports whose change exceeds the rounding of their own values and of other changes."""
    values = {
        n: (v.astype(float), after[n].astype(float)) for n, v in before.items() if not same(v, after[n])
    }
    with np.errstate(all="ignore"):
        gaps = {n: np.abs(b - a).max() for n, (a, b) in values.items()}
        most = max(filter(np.isfinite, gaps.values()), default=0.0)
        return [n for n, (a, _) in values.items() if not gaps[n] <= CANCELLED * max(most, np.abs(a).max())]


def _judged(fmu: FMU, subject: Subject, seen: Mapping[str, set[str]]) -> Verdict:
    """Return the verdict on the observed dependencies, given those that the model structure declares."""
    declared = fmu.feedthrough()
    numeric = [u for u in fmu.description.outputs if u.variable.type in fmu.version.numbers]
    listed = {fmu.key(u.variable) for u in numeric if u.dependencies is not None}  # aliases share it
    open_ends = [n for n, p in subject.outputs.items() if not {fmu.key(v) for v in p.variables} <= listed]
    hidden = [f"{o} on {i}" for o, inputs in seen.items() for i in sorted(inputs - declared[o])]
    if hidden:
        return "error", f"not declared: {named(hidden)}"
    pairs = [
        (o, i) for o in subject.outputs for i in declared[o] & subject.inputs.keys() if o not in open_ends
    ]
    unseen = [f"{o} on {i}" for o, i in sorted(pairs) if i not in seen[o]]
    count = sum(map(len, seen.values()))
    parts = [f"{count} dependenc{'y' if count == 1 else 'ies'} seen"]
    if open_ends:
        parts.append(f"no dependencies listed, which means all: {named(open_ends)}")
    if unseen:
        parts.append(f"declared and not seen here: {named(unseen)}")
    return ("note" if len(parts) > 1 else "ok"), "; ".join(parts)


def step_size(fmu: FMU, model_exchange: bool, doing: Doing) -> Verdict:
    """A run with h / 2 and held inputs agrees with that with h at their common points."""
    if _interface(fmu, model_exchange).canBeInstantiatedOnlyOncePerProcess:
        return ONCE
    runs: list[list[Values]] = []
    for parts in (1, 2):
        subject = Subject(fmu, model_exchange, f"step{parts}")
        h = subject.h / parts
        doing(f"do steps of {h:g} s")
        subject.start()
        subject.set(subject.excited(0.1))
        try:
            runs.append([subject.read()])
            for k in range(2 * STEPS * parts):
                subject.step(subject.t0 + k * h, h)
                runs[-1].append(subject.read())
        except CosimError:
            if parts == 2 and not fmu.description.coSimulation.canHandleVariableCommunicationStepSize:
                return "note", f"takes no step of {h:g} s; a variable step is not declared"
            raise
        subject.stop()
    relative: dict[str, float] = {}
    for name in subject.outputs:
        coarse, fine = (np.array([v[name] for v in run], dtype=float) for run in (runs[0], runs[1][::2]))
        gap = np.abs(coarse - fine).max()
        if gap > 0.0:
            relative[name] = float(gap / (np.ptp(coarse, axis=0).max() or 1.0))
    if not relative:
        return "ok", "the run is the same with h and h / 2, bit for bit"
    name, most = max(relative.items(), key=lambda item: item[1])
    varies = fmu.description.coSimulation.canHandleVariableCommunicationStepSize
    level = "ok" if most <= ROUNDING else "note" if most <= COARSE or not varies else "warning"
    text = f"with h / 2 the run differs by {most:.2g} of its range ({name}, h = {subject.h:g} s)"
    return level, text + ("" if varies else "; a variable step is not declared")
