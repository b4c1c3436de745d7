"""The contract of a running instance: a component with memory of its own, in one run.

An instance gives the operations that move it; the couplings put them in order, and the loop
runs them again and again. It is used in this order:

1. It is made from its component and a `Setting`. It then has addresses for the floats of the
   ports that the setting names. It refuses, with a remedy, a coupling that it cannot serve.
2. `start` initializes it at t_0. The operations are asked for before or after that, once.
3. At a communication point t_k, `read` and `read_texts` bring the outputs up to date: the
   result of the inputs that were held over [t_{k-1}, t_k].
4. On the way to t_{k+1} the inputs are copied to their addresses; then `latch` hands them to
   the instance, and `advance` carries it over the step with these inputs.
   An instance in place of a block (Stepping) does 3 and 4 in one `step` at t_k, which counts
   at t_k: its inputs are copied before, its outputs are valid after.
   Under stage coupling (Integrated) there is no `advance`. At each stage c, `set_states` takes
   the states at `state_address` to t_k + c h; after `latch`, `derivatives` writes the slopes to
   an address. `complete` ends the step at t_{k+1}, where events are handled.
5. `save` and `restore` return to an earlier point, as often as wanted; `forget` frees what
   `save` returned. Under iterated coupling a step is undone and repeated by them.
6. `stop` ends it. No call follows.

When an operation fails, `locate`, `failed` and `log` say where and why.
"""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from ..arrays import Array
from .operations import Operation
from .signals import Failing, RunSignals


@dataclass(frozen=True)
class Setting:
    """The conditions under which an instance runs.

    step
        the time from one action to the next, in s
    every
        a block acts at every n-th communication point; None: at every one, or at every stage
    is_stage
        whether the run has stage coupling
    jit
        whether kernels are compiled
    used
        names of the ports that are connected, recorded or watched
    signals
        where callbacks leave exceptions and requests to end the run
    """

    step: float
    every: int | None
    is_stage: bool
    jit: bool
    used: Set[str]
    signals: RunSignals


class Instance(Failing, Protocol):
    """A component in a run."""

    #: the strings and binary data that were read last, by output
    texts: dict[str, Any]
    #: the instance and output that the string or binary data of an input comes from
    text_sources: dict[str, tuple[Any, str]]

    def start(self, t0: float, /) -> None:
        """Initialize at t_0."""

    def stop(self) -> str:
        """End and free it; return how it crashed while it did so, "" if it did not."""

    # ---------------------------------------------------------------------- operations

    def address(self, port: str, /) -> int:
        """Return the address of the floats of a port."""

    def read(self, fraction: float = 0.0, final: bool = True) -> list[Operation]:
        """Evaluate the outputs; they must be finite unless inputs are still to come (not `final`)."""

    def read_texts(self) -> list[Operation]:
        """Read the strings and binary data that are used."""

    def latch(self) -> list[Operation]:
        """Take the inputs over from their addresses."""

    def advance(self) -> list[Operation]:
        """Carry the states over the step, inputs held."""

    # -------------------------------------------------------------------------- states

    @property
    def can_save(self) -> bool:
        """Tell whether it can save its state and return to it."""

    @property
    def can_serialise(self) -> bool:
        """Tell whether another instance can take over a saved state."""

    @property
    def is_gone(self) -> bool:
        """Tell whether the process that it ran in has ended."""

    @property
    def unrepeatable(self) -> str:
        """Why a step cannot be undone and repeated; "" if it can."""

    def kind(self) -> tuple[Any, ...]:
        """Return the properties that another instance must share to take over a saved state."""

    def save(self, serialised: bool = True) -> Any:
        """Return its state; not `serialised`, it serves this instance only and is faster."""

    def restore(self, saved: Any, /) -> None:
        """Return to a state that `save` returned, which stays valid."""

    def forget(self, saved: Any, /) -> None:
        """Free a state that `save(serialised=False)` returned."""


@runtime_checkable
class Stepping(Protocol):
    """An instance that can act as a block."""

    def step(self, fraction: float = 0.0) -> list[Operation]:
        """Take the inputs over, act, and give the outputs."""


@runtime_checkable
class Integrated(Protocol):
    """An instance whose states stage coupling integrates."""

    n_states: int
    state_address: int

    def set_states(self, fraction: float, /) -> list[Operation]:
        """Take over time and states at t_k + c h."""

    def derivatives(self, target: int, fraction: float, /) -> list[Operation]:
        """Evaluate the derivatives and write them to an address."""

    def complete(self) -> list[Operation]:
        """End the step, and handle the events in it."""

    def feedthrough(self) -> Mapping[str, set[str]]:
        """Return, for every output, the inputs on which it depends directly."""


@runtime_checkable
class MakesInstance(Protocol):
    """A component that makes its running instance itself, as an FMU does."""

    def instance(self, name: str, setting: Setting, /) -> Instance:
        """Return an instance; refuse a setting that it does not fit."""


def buffer(n: int) -> Array:
    """Return memory for n floats; never empty, so that it has an address."""
    return np.zeros(max(n, 1))
