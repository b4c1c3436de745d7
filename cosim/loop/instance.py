"""The contract of a running instance: a component in one run, with separate memory.

An instance provides the operations that carry it through a step; the couplings put them in
order, and the loop runs them repeatedly. It is used in this order:

1. It is made from its component and a `Setting`. It then has addresses for the floats of the
   ports that the setting names. It refuses, with a remedy, a coupling that it cannot serve.
2. `start` initializes it at t_0. The operations are requested once, before or after that.
3. At a communication point t_k, `read` and `read_texts` bring the outputs up to date: the
   result of the inputs that were held over [t_{k-1}, t_k].
4. On the way to t_{k+1} the inputs are copied to their addresses; then `latch` hands them to
   the instance, and `advance` carries it over the step with these inputs.
   An instance in place of a block (Stepping) does 3 and 4 in one `step` at t_k: its inputs are
   copied before, its outputs are valid after.
   Under stage coupling (Integrated) there is no `advance`. At each stage c, `set_states` takes
   the states at `state_address` to t_k + c h; after `latch`, `derivatives` writes the slopes to
   an address. `complete` ends the step at t_{k+1}, where events are handled.
5. `save` and `restore` return to an earlier point, any number of times; `forget` frees a saved
   state. Iterated coupling undoes and repeats a step with them.
6. `stop` ends it. No call follows.

When an operation fails, `locate`, `failed` and `log` give place and cause.
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

    #: the last strings and binary data that were read, by output
    texts: dict[str, Any]
    #: the source of the string or binary data of an input: instance and output
    text_sources: dict[str, tuple[Any, str]]

    def start(self, t0: float, /) -> None:
        """Initialize at t_0."""

    def stop(self) -> str:
        """End and free the instance; return the description of a crash in doing so, "" if none."""

    # ---------------------------------------------------------------------- operations

    def address(self, port: str, /) -> int:
        """Return the address of the floats of a port."""

    def read(self, fraction: float = 0.0, final: bool = True) -> list[Operation]:
        """Evaluate the outputs; they must be finite unless inputs are still to come (not `final`)."""

    def read_texts(self) -> list[Operation]:
        """Read the strings and binary data that are used."""

    def latch(self) -> list[Operation]:
        """Pass the inputs from their addresses to the instance."""

    def advance(self) -> list[Operation]:
        """Carry the states over the step, inputs held."""

    # -------------------------------------------------------------------------- states

    @property
    def can_save(self) -> bool:
        """Tell whether the instance can save its state and return to it."""

    @property
    def can_serialise(self) -> bool:
        """Tell whether another instance can take over a saved state."""

    @property
    def is_gone(self) -> bool:
        """Tell whether the process of the instance has ended."""

    @property
    def unrepeatable(self) -> str:
        """The reason why a step cannot be undone and repeated; "" if it can."""

    def kind(self) -> tuple[Any, ...]:
        """Return the properties that another instance must share to take over a saved state."""

    def save(self, serialised: bool = True) -> Any:
        """Return the state; without `serialised`, faster and for this instance only."""

    def restore(self, saved: Any, /) -> None:
        """Return to a state that `save` returned, which stays valid."""

    def forget(self, saved: Any, /) -> None:
        """Free a state that `save(serialised=False)` returned."""


@runtime_checkable
class Stepping(Protocol):
    """An instance that can act as a block."""

    def step(self, fraction: float = 0.0) -> list[Operation]:
        """Pass the inputs to the instance, run it, and update the outputs."""


@runtime_checkable
class Integrated(Protocol):
    """An instance whose states stage coupling integrates."""

    n_states: int
    state_address: int

    def set_states(self, fraction: float, /) -> list[Operation]:
        """Set the time t_k + c h and the states."""

    def derivatives(self, target: int, fraction: float, /) -> list[Operation]:
        """Evaluate the derivatives and write them to an address."""

    def complete(self) -> list[Operation]:
        """End the step, and handle the events in it."""

    def feedthrough(self) -> Mapping[str, set[str]]:
        """Return, for every output, the inputs on which it depends directly."""


@runtime_checkable
class MakesInstance(Protocol):
    """A component that makes its own running instance, as an FMU does."""

    def instance(self, name: str, setting: Setting, /) -> Instance:
        """Return an instance; refuse a setting that does not suit it."""


def buffer(n: int) -> Array:
    """Return memory for n floats; never empty, so that it has an address."""
    return np.zeros(max(n, 1))
