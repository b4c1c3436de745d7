"""What a run works on: a participant with memory of its own, and the operations that move it.

An instance answers, for its participant, what the master asks at a communication point:
`read` the outputs, `latch` the inputs, `advance` over the step, and for stage coupling
set states and get derivatives. KernelInstance does so for blocks and continuous systems
in the loop; FMUInstance (fmi/instance.py, fmi/model_exchange.py) for FMUs.
"""

from __future__ import annotations

import ctypes
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from ..codegen.kernels import kernel_addresses
from ..core.dependencies import dependencies
from ..core.participant import KERNEL_TIMES, Continuous, LinearContinuous, Participant
from ..core.variables import Array
from ..errors import CompilationError, CompiledKernelsWarning, DeclarationError
from ..loop.operations import CALL, COPY, Op
from ..loop.signals import KERNEL, Failures
from ..result import SimulationError


class KernelInstance:
    """A Block or Continuous in the loop, compiled or called back."""

    def __init__(self, name: str, participant: Participant, jit: bool, failures: Failures) -> None:
        self.name = name
        self.failures = failures
        self.participant = participant.fresh()
        self.base = self.participant.memory.ctypes.data
        self.callbacks: list[Any] = []
        self.is_compiled = jit and participant.compiled
        self._addresses: dict[str, int] = {}
        if self.is_compiled:
            try:
                self._addresses = kernel_addresses(participant)
            except CompilationError as error:
                warnings.warn(
                    f"{name} runs as a Python callback, about 50 times slower: {error}. "
                    f"Set compiled = False in {type(participant).__name__} to accept that silently",
                    CompiledKernelsWarning,
                    stacklevel=4,
                )
                self.is_compiled = False
        if not self.is_compiled:
            for kernel in participant.kernels:
                callback = failures.guard(name, self._interpreted(kernel))
                self.callbacks.append(callback)
                self._addresses[kernel] = ctypes.cast(callback, ctypes.c_void_p).value or 0
        states = self.participant.zones["state"]
        self.n_states = states[1] if isinstance(participant, Continuous) else 0
        self.state_address = self.base + 8 * states[0]
        self.derivative_address = self.base + 8 * self.participant.zones["derivative"][0]
        outputs = self.participant.zones["output"]
        self._outputs = (self.base + 8 * outputs[0], outputs[1] + states[1])  # the two zones adjoin
        self.has_outputs = outputs[1] > 0

    def _interpreted(self, kernel: str) -> Callable[[float, float], None]:
        method = getattr(self.participant, kernel)
        times = KERNEL_TIMES[kernel]
        return lambda t, h: method(*(t, h)[:times])

    def start(self, t0: float) -> None:
        """Run `initialize`, interpreted or compiled like everything else."""
        if "initialize" in self._addresses:
            function = KERNEL(self._addresses["initialize"])
            if function(self.base, t0, 0.0) != 0 and self.failures.exception is None:
                again = self.failures.guard(self.name, self._interpreted("initialize"))  # for its exception
                if again(self.base, t0, 0.0) == 0:
                    raise SimulationError(f"{self.name} failed in initialize(self); check its parameters")
        if isinstance(self.participant, LinearContinuous) and self.failures.exception is None:
            self._check_linear(t0)

    def _check_linear(self, t0: float) -> None:
        """Refuse derivatives whose response to states and inputs is no sum, or depends on t."""
        p, saved = self.participant, self.participant.memory.copy()
        derivatives = KERNEL(self._addresses["derivatives"])
        random = np.random.default_rng(1)
        x, u = (random.uniform(-1.0, 1.0, (2, v.size)) for v in (p.state_vector, p.input_vector))

        def response(t: float, i: float, j: float) -> Array:
            p.memory[:] = saved
            p.state_vector[:] = i * x[0] + j * x[1]
            p.input_vector[:] = i * u[0] + j * u[1]
            derivatives(self.base, t, 0.0)
            first, size = p.zones["derivative"]
            return p.memory[first : first + size].copy()

        none, one, two, both = (response(t0, *ij) for ij in ((0, 0), (1, 0), (0, 1), (3, -2)))
        later = response(t0 + 1.7, 3, -2)
        p.memory[:] = saved
        bound = 1e-9 * (np.abs(none) + np.abs(one) + np.abs(two) + np.abs(both)).max(initial=1e-300)
        if self.failures.exception is not None:
            return
        finite = np.isfinite([none, one, two, both, later]).all()
        off = np.abs([none + 3 * (one - none) - 2 * (two - none) - both, later - both])
        if finite and (off > bound).any():
            raise DeclarationError(
                f"{self.name}: {type(p).__name__}.derivatives is not linear in states and inputs with "
                "constant coefficients, which LinearContinuous needs; derive it from Continuous"
            )

    def stop(self) -> str:
        """Nothing to release, nothing that could crash."""
        return ""

    #: Python can be copied, and so can the record
    can_save = can_serialise = True

    def kind(self) -> tuple[Any, ...]:
        """Return what another instance has to share to take back what this one saves."""
        made = type(self.participant)
        return made.__module__, made.__qualname__, self.is_compiled, self.participant.memory.size

    def save(self, serialised: bool = True) -> tuple[Array, dict[str, Any]]:
        """Return a copy of the record, and of what a block in Python keeps beside it."""
        attributes = {} if self.is_compiled else self.participant.own_attributes()
        return self.participant.memory.copy(), attributes

    def restore(self, saved: Any) -> None:
        """Take back what `save` returned, which stays as it is."""
        memory, attributes = saved
        self.participant.memory[:] = memory
        if not self.is_compiled:
            self.participant.take_attributes(attributes)

    def forget(self, saved: Any) -> None:
        """Nothing to free."""

    def address(self, port: str) -> int:
        """Return the address of a variable."""
        return self.base + 8 * self.participant.variables[port].slot

    def _call(self, kernel: str, text: str, fraction: float, check: tuple[int, int] = (0, 0)) -> Op:
        how = "" if self.is_compiled else " (Python callback)"
        return Op(
            f"{self.name}: {text}{how}" if text else "",
            CALL,
            self._addresses[kernel],
            self.base,
            check[0],
            n=check[1],
            fraction=fraction,
            participant=self.name,
        )

    def step(self, fraction: float = 0.0) -> list[Op]:
        """Run a block."""
        return [self._call("step", "step", fraction, self._outputs)]

    def read(self, fraction: float = 0.0, final: bool = True) -> list[Op]:
        """Evaluate derivatives and outputs; they must be finite unless inputs are still to come."""
        ops = [self._call("derivatives", "", fraction)] if "derivatives" in self._addresses else []
        if "outputs" in self._addresses:
            ops.append(self._call("outputs", "outputs", fraction, self._outputs if final else (0, 0)))
        return ops

    def latch(self) -> list[Op]:
        """Inputs are read where they lie."""
        return []

    def advance(self) -> list[Op]:
        """Carry the states over the step."""
        return [self._call("advance", "advance", 0.0, (self.state_address, self.n_states))]

    def set_states(self, fraction: float) -> list[Op]:
        """States are combined where they lie."""
        return []

    def derivatives(self, target: int, fraction: float) -> list[Op]:
        """Evaluate the derivatives and copy them to `target`."""
        if not self.n_states:
            return []
        copy = Op("", COPY, a=self.derivative_address, b=target, n=self.n_states, weights=(1.0, 0.0))
        return [self._call("derivatives", "derivatives", fraction), copy]

    def complete(self) -> list[Op]:
        """Nothing happens between steps."""
        return []

    def feedthrough(self) -> dict[str, set[str]]:
        """Return, for every output, the inputs on which it depends directly."""
        inputs = {n for n, v in self.participant.variables.items() if v.kind == "input"}
        kinds = {n: v.kind for n, v in self.participant.variables.items()}
        found = {n: d & inputs for n, d in dependencies(self.participant).items() if kinds[n] == "output"}
        return found | {n: set() for n, kind in kinds.items() if kind == "state"}

    def locate(self, slot_address: int) -> str:
        """Return the name of the variable at an address, for an error message."""
        slot = (slot_address - self.base) // 8
        for name, v in self.participant.variables.items():
            if v.slot <= slot < v.slot + v.size:
                return name if not v.shape else f"{name}[{slot - v.slot + 1}]"
        return "?"

    def failed(self, status: int, t: float) -> str:
        """Return what it means that a kernel failed."""
        return f"{self.name} failed with an exception in its kernel (jit=False shows where) at t = {t:g} s"

    def log(self) -> list[str]:
        """Kernels do not log."""
        return []


def buffer(n: int) -> Array:
    """Return memory for n floats; never empty, so that it has an address."""
    return np.zeros(max(n, 1))
