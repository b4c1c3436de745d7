"""A running FMU: its buffers, and the operations that call its functions by address.

What all instances share; co_simulation.py and model_exchange.py add how they advance.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar

import numpy as np

from ...errors import CosimError, FMUError, SnapshotError
from ...loop.conversions import FromFloat, ToFloat
from ...loop.instance import buffer
from ...loop.numbers import Number
from ...loop.operations import Call, Operation
from ...loop.signals import RunSignals, ctrl_c
from ..fmu import FMU
from ..ports import FMUPort


class Exchange:
    """The ports of one FMI type, variability and clock: value references, and a buffer of floats."""

    def __init__(
        self, access: str, number: Number, discrete: bool, clocks: frozenset[int], ports: list[FMUPort]
    ) -> None:
        self.access = access
        #: can change at events only, where there are events
        self.discrete = discrete
        #: references of the clocks at whose ticks alone it can be got and set
        self.clocks = clocks
        self.is_clock = access == "Clock"
        self.number = number
        self.references = np.array([v.valueReference for p in ports for v in p.variables], dtype=np.uint32)
        self.elements = [e for p in ports for e in p.elements()]
        self.values = buffer(len(self.elements))
        #: what the FMU reads and writes; the floats themselves if it does so in Float64
        self.raw = self.values if number.dtype == "float64" else np.zeros(len(self.elements), number.dtype)
        #: what the FMU was told last, of discrete inputs; of output clocks whether they have ticked
        self.told = self.raw.copy()
        self.addresses: dict[str, int] = {}
        offset = int(self.values.ctypes.data)
        for p in ports:
            self.addresses[p.name] = offset
            offset += 8 * p.size


class FMUInstance:
    """One instance of an FMU in a run."""

    is_compiled = True
    model_exchange: ClassVar[bool] = False

    def __init__(self, name: str, fmu: FMU, failures: RunSignals, used: set[str]) -> None:
        self.name = name
        self.fmu = fmu
        self.failures = failures
        self.running = False
        #: states of the FMU that were got and not freed
        self.kept: list[Any] = []
        given = fmu.start_values()
        structural = {n for n in given if fmu.variables[n].causality == "structuralParameter"}
        #: the start values that were given, by variable
        self.start_values = {n: v for n, v in given.items() if n not in structural | fmu.clocks.keys()}
        #: the intervals of clocks that were given
        self.intervals = {n: v for n, v in given.items() if n in fmu.clocks}
        self.fmi = fmu.adapter(fmu, name, self.model_exchange, failures)
        self.api = self.fmi.api
        try:
            self.fmi.configure({n: given[n] for n in structural})
        except CosimError:
            self.stop()
            raise
        self.inputs = self._exchanges({n: p for n, p in fmu.input_ports.items() if n in used})
        for x in self.inputs:
            if x.clocks:  # what it has until the clock ticks, when alone it can be got
                x.values[:] = [s for n in x.addresses for s in fmu.input_ports[n].start_values(given)]
        self.outputs = self._exchanges({n: p for n, p in fmu.output_ports.items() if n in used})
        #: the strings and binary data that were got last, by output (None before), and set last, by input
        self.texts: dict[str, Any] = {n: None for n in fmu.text_outputs if n in used}
        self.told_texts: dict[str, Any] = {}
        #: where those of inputs come from
        self.text_sources: dict[str, tuple[Any, str]] = {}
        self.is_ended = False

    def _exchanges(self, ports: dict[str, FMUPort]) -> list[Exchange]:
        groups: dict[tuple[str, Number, bool, frozenset[int]], list[FMUPort]] = {}
        for port in ports.values():
            discrete = any(v.variability != "continuous" for v in port.variables)
            clocks = frozenset(c.valueReference for v in port.variables for c in v.clocks or ())
            access, number = self.fmi.NUMBERS[port.type]
            if access == "Clock":  # one that is bound to another one is got and set as any
                clocks = frozenset()
            groups.setdefault((access, number, discrete, clocks), []).append(port)
        return [Exchange(*kind, members) for kind, members in groups.items()]

    # ------------------------------------------------------------- life of an instance

    def start(self, t0: float) -> None:
        """Take the FMU through initialization, with the start values that were given."""
        self.fmi.initialize(t0, self._set_start, lambda: self._settle(t0))
        self.running = True
        for x in self.inputs:
            if not (x.is_clock or x.clocks):
                now = self.fmi.get(x.access, x.references.tolist(), len(x.elements))
                x.values[:] = x.told[:] = now
                for element, value, held in zip(x.elements, now, x.values.tolist(), strict=True):
                    if value != held and not x.number.is_float:  # NaN is no number, and differs from itself
                        raise FMUError(
                            f"{self.name}.{element} starts with {value}, which is above 2^53, and a float "
                            "does not hold it; do not connect or record it"
                        )

    def _settle(self, t0: float) -> None:
        """Do what is left to initialization mode."""

    def _set_start(self) -> None:
        for name, values in self.start_values.items():
            self.fmi.set(self.fmu.variables[name], values)

    def stop(self) -> str:
        """Terminate and free the instance; return how it crashed in that, if it is isolated and did."""
        self.is_ended = True
        before = self.fmi.crash()
        with ctrl_c(self.failures):
            self._end()
            after = self.fmi.crash()
            self.fmi.close()
        return after if after != before else ""

    def _end(self) -> None:
        if self.fmi.status == 4 or self.fmi.is_gone:  # after a fatal error it must not be called any more
            return
        ends = [partial(self.api.freeFMUState, state) for state in self.kept]
        if self.running and self.fmi.status < 3:
            ends.append(self.api.terminate)
        for end in ends:
            try:
                end()
            except Exception as error:  # the run is over; an FMU that cannot end is reported, not fatal
                self.fmi.messages.append(f"[warning] {error}")
        self.running = False
        self.api.freeInstance()

    @property
    def can_save(self) -> bool:
        """Tell whether the FMU can get and set its state."""
        return bool(self.fmi.interface.canGetAndSetFMUstate)

    @property
    def can_serialise(self) -> bool:
        """Tell whether the FMU can give its state as bytes."""
        return bool(self.can_save and self.fmi.interface.canSerializeFMUstate)

    @property
    def is_gone(self) -> bool:
        """Tell whether the process that it ran in has ended."""
        return self.fmi.is_gone

    @property
    def unrepeatable(self) -> str:
        """Why a step cannot be undone and repeated; "" if it can."""
        if self.fmu.clocks:
            return "clocks would tick at every repetition of a step"
        if not self.can_save:
            return (
                "it cannot get and set its state (canGetAndSetFMUState), which the repetition of a step "
                "needs; export it with that capability"
            )
        return ""

    def kind(self) -> tuple[Any, ...]:
        """Return what another instance has to share to take back what this one saves."""
        ports = tuple(tuple(x.elements) for x in [*self.inputs, *self.outputs])
        return self.fmu.description.guid, self.model_exchange, self.fmu.event_mode, ports

    def save(self, serialised: bool = True) -> tuple[Any, ...]:
        """Return buffers and texts, and the state of the FMU: as bytes if it can, else kept until `stop`."""
        state = self.fmi.attempt("get its state", self.api.getFMUState)
        if serialised and self.can_serialise:
            serialise = self.api.serializeFMUState
            kept = self.fmi.attempt("serialise its state", lambda: serialise(state))
            self.fmi.attempt("free its state", lambda: self.api.freeFMUState(state))
        else:
            kept = state
            self.kept.append(state)
        return [array.copy() for array in self.arrays()], kept, (dict(self.texts), dict(self.told_texts))

    def restore(self, saved: Any) -> None:
        """Return to what `save` returned, which stays as it is."""
        arrays, kept, texts = saved
        if self.fmi.status == 4 or self.fmi.is_gone:
            raise SnapshotError(
                f"{self.name} ended with a fatal error and takes no calls any more; start anew"
            )
        self.fmi.status = 0
        state = kept
        if isinstance(kept, bytes):
            deserialise = self.api.deserializeFMUState
            state = self.fmi.attempt("read its state", lambda: deserialise(kept))
        self.fmi.attempt("set its state", lambda: self.api.setFMUState(state))
        if isinstance(kept, bytes):
            self.fmi.attempt("free its state", lambda: self.api.freeFMUState(state))
        for array, values in zip(self.arrays(), arrays, strict=True):
            array[:] = values
        self.texts, self.told_texts = (dict(each) for each in texts)

    def forget(self, saved: Any) -> None:
        """Free a state that was kept."""
        self.kept.remove(saved[1])
        self.fmi.attempt("free its state", lambda: self.api.freeFMUState(saved[1]))

    def arrays(self) -> list[Any]:
        """Return the memory that belongs to the state of this instance."""
        return [array for x in [*self.inputs, *self.outputs] for array in (x.values, x.raw, x.told)]

    # ---------------------------------------------------------------------- operations

    def _function(self, name: str) -> int:
        return ctypes.cast(self.fmi.function(name), ctypes.c_void_p).value or 0

    @property
    def _component(self) -> int:
        component = self.api.component
        return int(component if isinstance(component, int) else component.value)

    def address(self, port: str) -> int:
        """Return the address of the floats of a port."""
        return next(x.addresses[port] for x in [*self.inputs, *self.outputs] if port in x.addresses)

    def read(self, fraction: float = 0.0, final: bool = True) -> list[Operation]:
        """Get the outputs that are used; they must be finite unless inputs are still to come."""
        return [op for x in self.outputs for op in self._get_outputs(x, final)]

    def _get_outputs(self, x: Exchange, final: bool) -> list[Operation]:
        is_float64 = x.raw is x.values
        got = replace(self._values("Get", x, is_float64 and final), text=f"{self.name}: outputs (FMU)")
        return [got] if is_float64 else [got, self._convert(ToFloat, x, x.raw, x.values)]

    def _values(self, what: str, x: Exchange, finite: bool = False) -> Operation:
        return self.fmi.VALUES(
            function=self._function(f"{self.fmi.PREFIX}{what}{x.access}"),
            component=self._component,
            references=int(x.references.ctypes.data),
            values=int(x.raw.ctypes.data),
            n_references=len(x.references),
            count=len(x.elements),
            finite=finite,
            participant=self.name,
        )

    def _convert(self, kind: type[ToFloat | FromFloat], x: Exchange, source: Any, target: Any) -> Operation:
        return kind(
            source=int(source.ctypes.data),
            target=int(target.ctypes.data),
            count=len(x.elements),
            number=x.number,
            participant=self.name,
        )

    def latch(self) -> list[Operation]:
        """Set the inputs."""
        numbers = [op for x in self.inputs for op in self._set_inputs(x)]
        return [*numbers, *self._latch_texts()]

    def _set_inputs(self, x: Exchange) -> list[Operation]:
        return [*self._from_floats(x), self._values("Set", x)]

    def _from_floats(self, x: Exchange) -> list[Operation]:
        return [] if x.raw is x.values else [self._convert(FromFloat, x, x.values, x.raw)]

    # --------------------------------------------------------- strings and binary data

    def _text_op(self, what: str, function: Callable[[float, float], None]) -> Operation:
        text = f"{self.name}: {what} (Python callback)"
        return Call(text=text, function=self.failures.callback(self.name, function), participant=self.name)

    def read_texts(self) -> list[Operation]:
        """Get the strings and binary data that are used."""
        return [self._text_op("text outputs", self._get_texts)] if self.texts else []

    def _latch_texts(self) -> list[Operation]:
        if not self.text_sources:
            return []
        return [self._text_op("text inputs", lambda t, h: self._set_texts(self._new_texts()))]

    def _get_texts(self, t: float, h: float) -> None:
        for name in self.texts:
            v = self.fmu.text_outputs[name]
            empty: Any = "" if v.type == "String" else b""
            self.texts[name] = self.fmi.get(v.type, [v.valueReference], 1)[0] or empty

    def _new_texts(self) -> dict[str, Any]:
        """Return the texts of inputs that are others than what was set last."""
        coming = {name: source.texts[port] for name, (source, port) in self.text_sources.items()}
        told = self.told_texts
        return {name: text for name, text in coming.items() if text not in (None, told.get(name))}

    def _set_texts(self, texts: Mapping[str, Any]) -> None:
        for name, text in texts.items():
            self.fmi.set(self.fmu.text_inputs[name], [text])
        self.told_texts.update(texts)

    def feedthrough(self) -> dict[str, set[str]]:
        """Return, for every output, the inputs on which it depends directly."""
        return self.fmu.feedthrough()

    def locate(self, address: int) -> str:
        """Return the name of the variable at an address, for an error message."""
        for x in [*self.inputs, *self.outputs]:
            index = (address - int(x.values.ctypes.data)) // 8
            if 0 <= index < len(x.elements):
                return x.elements[index]
        return "?"

    def failed(self, status: int, t: float) -> str:
        """Return what a status that a function of the FMU returned means."""
        return self.fmi.failure(status, t)

    def log(self) -> list[str]:
        """Return what the FMU logged at warning level and above."""
        return self.fmi.messages
