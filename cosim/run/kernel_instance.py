"""The running instance of a block or continuous system: its kernels and a copy of its storage.

Kernels are compiled, or called back as Python where Numba cannot compile them. They read
inputs and states in place, so an instance has nothing to latch or to set.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from ..arrays import Array
from ..codegen.kernels import kernel_addresses
from ..core.dependencies import dependencies
from ..core.participant import KERNEL_TIMES, Continuous, LinearContinuous, Participant
from ..errors import CompilationError, CompiledKernelsWarning, DeclarationError, WiringError
from ..loop.instance import Setting
from ..loop.operations import Call, Copy, Operation
from ..loop.signals import KERNEL
from ..result import SimulationError


class KernelInstance:
    """A Block or Continuous in the loop, compiled or called back."""

    def __init__(self, name: str, participant: Participant, setting: Setting) -> None:
        is_continuous = isinstance(participant, Continuous)
        if setting.is_stage and is_continuous and "derivatives" not in participant.kernels:
            raise WiringError(
                f"{name} ({type(participant).__name__}) has only an advance and no derivatives, "
                'which stage coupling needs; use coupling="sampled"'
            )
        self.name = name
        self.signals = setting.signals
        self.texts: dict[str, Any] = {}  # kernels know numbers only
        self.text_sources: dict[str, tuple[Any, str]] = {}
        self.participant = participant.fresh()
        self.base = self.participant.memory.ctypes.data
        self.is_compiled = setting.jit and participant.compiled
        self._addresses: dict[str, int] = {}
        if self.is_compiled:
            try:
                self._addresses = kernel_addresses(participant)
            except CompilationError as error:
                warnings.warn(
                    f"{name} runs as a Python callback, about 50 times slower: {error}. "
                    f"Set compiled = False in {type(participant).__name__} to accept that",
                    CompiledKernelsWarning,
                    stacklevel=4,
                )
                self.is_compiled = False
        if not self.is_compiled:
            for kernel in participant.kernels:
                when = "in the step from" if kernel == "advance" else "at"
                self._addresses[kernel] = self.signals.callback(name, self._interpreted(kernel), when)
        states = self.participant.zones["state"]
        self.n_states = states[1] if is_continuous else 0
        self.state_address = self.base + 8 * states[0]
        self.derivative_address = self.base + 8 * self.participant.zones["derivative"][0]
        outputs = self.participant.zones["output"]
        self._outputs = (self.base + 8 * outputs[0], outputs[1] + states[1])  # the two zones adjoin
        self._has_outputs = outputs[1] > 0

    def _interpreted(self, kernel: str) -> Callable[[float, float], None]:
        method = getattr(self.participant, kernel)
        times = KERNEL_TIMES[kernel]
        return lambda t, h: method(*(t, h)[:times])

    def start(self, t0: float) -> None:
        """Run `initialize`, interpreted or compiled like everything else."""
        if "initialize" in self._addresses:
            before = self.participant.memory.copy()
            function = KERNEL(self._addresses["initialize"])
            if function(self.base, t0, 0.0) != 0 and self.signals.exception is None:
                self.participant.memory[:] = before  # compiled code does not name the exception
                again = KERNEL(self.signals.callback(self.name, self._interpreted("initialize")))
                if again(self.base, t0, 0.0) == 0:
                    raise SimulationError(f"{self.name} failed in initialize(self); check its parameters")
        if isinstance(self.participant, LinearContinuous) and self.signals.exception is None:
            self._check_linear(t0)

    def _check_linear(self, t0: float) -> None:
        """Refuse derivatives that are not linear in states and inputs, or depend on t."""
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
        if self.signals.exception is not None:
            return
        finite = np.isfinite([none, one, two, both, later]).all()
        off = np.abs([none + 3 * (one - none) - 2 * (two - none) - both, later - both])
        if finite and (off > bound).any():
            raise DeclarationError(
                f"{self.name}: {type(p).__name__}.derivatives is not linear in states and inputs with "
                "constant coefficients, which LinearContinuous needs; derive it from Continuous"
            )

    def stop(self) -> str:
        """Return "": the memory is freed with the instance, without a crash."""
        return ""

    #: Python attributes and the storage can be copied
    can_save = can_serialise = True
    is_gone = False
    unrepeatable = ""

    def kind(self) -> tuple[Any, ...]:
        """Return the properties that another instance must share to take over a saved state."""
        made = type(self.participant)
        return made.__module__, made.__qualname__, self.is_compiled, self.participant.memory.size

    def save(self, serialised: bool = True) -> tuple[Array, dict[str, Any]]:
        """Return a copy of the storage, and of the Python attributes of a block that runs in Python."""
        attributes = {} if self.is_compiled else self.participant.own_attributes()
        return self.participant.memory.copy(), attributes

    def restore(self, saved: Any) -> None:
        """Return to a state that `save` returned, which stays valid."""
        memory, attributes = saved
        self.participant.memory[:] = memory
        if not self.is_compiled:
            self.participant.take_attributes(attributes)

    def forget(self, saved: Any) -> None:
        """Nothing to free."""

    def address(self, port: str) -> int:
        """Return the address of a variable."""
        return self.base + 8 * self.participant.variables[port].slot

    def _call(self, kernel: str, text: str, fraction: float, check: tuple[int, int] = (0, 0)) -> Operation:
        how = "" if self.is_compiled else " (Python callback)"
        return Call(
            text=f"{self.name}: {text}{how}" if text else "",
            function=self._addresses[kernel],
            storage=self.base,
            results=check[0],
            count=check[1],
            fraction=fraction,
            participant=self.name,
        )

    def step(self, fraction: float = 0.0) -> list[Operation]:
        """Run a block."""
        return [self._call("step", "step", fraction, self._outputs)]

    def read(self, fraction: float = 0.0, final: bool = True) -> list[Operation]:
        """Evaluate derivatives and outputs; they must be finite unless inputs are still to come."""
        if not self._has_outputs:
            return []
        ops = [self._call("derivatives", "", fraction)] if "derivatives" in self._addresses else []
        if "outputs" in self._addresses:
            ops.append(self._call("outputs", "outputs", fraction, self._outputs if final else (0, 0)))
        return ops

    def _nothing(self, fraction: float = 0.0) -> list[Operation]:
        """Return no operations: a kernel has no texts and reads inputs and states in place."""
        return []

    read_texts = latch = set_states = complete = _nothing

    def advance(self) -> list[Operation]:
        """Carry the states over the step."""
        return [self._call("advance", "advance", 0.0, (self.state_address, self.n_states))]

    def derivatives(self, target: int, fraction: float) -> list[Operation]:
        """Evaluate the derivatives and copy them to `target`."""
        if not self.n_states:
            return []
        copy = Copy(source=self.derivative_address, target=target, count=self.n_states)
        return [self._call("derivatives", "derivatives", fraction), copy]

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
        """Return the message for a kernel that failed when it was called at t."""
        where = "(jit=False shows where), called at"
        return f"{self.name} failed with an exception in its kernel {where} t = {t:g} s"

    def log(self) -> list[str]:
        """Kernels do not log."""
        return []
