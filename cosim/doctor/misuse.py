"""The probes of misuse: calls that FMI forbids, which an FMU should answer with an error status."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from typing import Any

from ..fmi.fmu import FMU
from .probes import Doing, Verdict
from .subject import Subject


def _answered(what: str, call: Callable[[], Any], doing: Doing) -> Verdict:
    doing(what)
    try:
        call()
    except Exception as error:  # FMPy raises FMICallException and bare Exception alike
        status = str(error).splitlines()[0][:80]
        return "ok", f"refused ({status})"
    return "warning", f"accepted without an error: {what}"


def step_before_initialization(fmu: FMU, model_exchange: bool, doing: Doing) -> Verdict:
    """A step right after instantiation is refused."""
    doing("instantiate")
    subject = Subject(fmu, model_exchange)
    return _answered(
        "do a step before initialization", lambda: subject.api.doStep(subject.t0, subject.h, False), doing
    )


def negative_step(fmu: FMU, model_exchange: bool, doing: Doing) -> Verdict:
    """A step back in time is refused."""
    subject = Subject(fmu, model_exchange).start()
    subject.run(3)
    h, now = subject.h, subject.t0 + 3 * subject.h
    return _answered(f"do a step of {-h:g} s", lambda: subject.api.doStep(now, -h, False), doing)


def unknown_reference(fmu: FMU, model_exchange: bool, doing: Doing) -> Verdict:
    """Getting a variable that does not exist is refused."""
    subject = Subject(fmu, model_exchange).start()
    known = {v.valueReference for v in fmu.variables.values()}
    reference = next(r for r in count(3_000_000_000) if r not in known)
    access = "Real" if fmu.description.fmiVersion == "2.0" else "Float64"
    getter = getattr(subject.api, f"get{access}")
    return _answered(f"get value reference {reference}", lambda: getter([reference]), doing)
