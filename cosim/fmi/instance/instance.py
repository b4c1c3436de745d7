"""A running FMU: its buffers, and the operations that call its functions by address.

All instances share this part; co_simulation.py and model_exchange.py add the operations that advance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Set
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ...errors import CosimError, FMUError, SnapshotError
from ...loop.conversions import FromFloat, ToFloat
from ...loop.numbers import Number
from ...loop.operations import Call, Operation
from ...loop.signals import ctrl_c
from ..ports import FMUPort
from .driver import ERROR, OK, Driver


class VariableGroup:
    """The ports of one FMI type, variability and clock: value references, and a buffer of floats."""

    def __init__(
        self, access: str, number: Number, discrete: bool, clocks: frozenset[int], ports: list[FMUPort]
    ) -> None:
        self.access = access
        #: whether they are set in events, where the FMU has an event mode
        self.discrete = discrete
        #: references of their clocks, at whose ticks alone they can be got and set
        self.clocks = clocks
        self.is_clock = access == "Clock"
        self.number = number
        self.references = np.array([v.valueReference for p in ports for v in p.variables], dtype=np.uint32)
        self.elements = [e for p in ports for e in p.elements()]
        self.values = np.zeros(len(self.elements))
        #: the memory that the FMU reads and writes: the floats themselves if its type is Float64
        self.raw = self.values if number.dtype == "float64" else np.zeros(len(self.elements), number.dtype)
        #: last values sent to the FMU, of discrete inputs; of output clocks, whether they have ticked
        self.last = self.raw.copy()
        self.addresses: dict[str, int] = {}
        offset = int(self.values.ctypes.data)
        for p in ports:
            self.addresses[p.name] = offset
            offset += 8 * p.size


class FMUInstance:
    """One instance of an FMU in a run, with buffers for the ports in `used`."""

    def __init__(self, driver: Driver, used: Set[str]) -> None:
        self.driver, self.api = driver, driver.api
        self.name, self.signals = driver.name, driver.signals
        self.fmu = fmu = driver.file
        #: whether it is initialized and not yet terminated
        self.running = False
        #: states of the FMU that were got and not freed
        self.kept: list[Any] = []
        given = fmu.start_values()
        structural = {n for n in given if fmu.variables[n].causality == "structuralParameter"}
        #: the start values that were given, by variable
        self.start_values = {n: v for n, v in given.items() if n not in structural | fmu.clocks.keys()}
        #: the intervals of clocks that were given
        self.intervals = {n: v for n, v in given.items() if n in fmu.clocks}
        try:
            self.driver.configure({n: given[n] for n in structural})
        except CosimError:
            self.stop()
            raise
        self.inputs = self._groups({n: p for n, p in fmu.input_ports.items() if n in used})
        for x in self.inputs:
            if x.clocks:  # the values until the first tick, at which alone they can be got
                x.values[:] = [s for n in x.addresses for s in fmu.input_ports[n].start_values(given)]
        self.outputs = self._groups({n: p for n, p in fmu.output_ports.items() if n in used})
        #: last strings and binary data: got, by output (None before the first), and sent, by input
        self.texts: dict[str, Any] = {n: None for n in fmu.text_outputs if n in used}
        self.sent_texts: dict[str, Any] = {}
        #: the source of each such input: an instance and its output
        self.text_sources: dict[str, tuple[Any, str]] = {}

    def _groups(self, ports: dict[str, FMUPort]) -> list[VariableGroup]:
        groups: dict[tuple[str, Number, bool, frozenset[int]], list[FMUPort]] = {}
        for port in ports.values():
            discrete = any(v.variability != "continuous" for v in port.variables)
            clocks = frozenset(c.valueReference for v in port.variables for c in v.clocks or ())
            access, number = self.fmu.version.numbers[port.type]
            if access == "Clock":  # a clock that is bound to another one is got and set at any time
                clocks = frozenset()
            groups.setdefault((access, number, discrete, clocks), []).append(port)
        return [VariableGroup(*kind, members) for kind, members in groups.items()]

    # ------------------------------------------------------------- life of an instance

    def start(self, t0: float) -> None:
        """Take the FMU through initialization, with the start values that were given."""
        self.driver.initialize(t0, self._set_start, lambda: self._settle(t0))
        self.running = True
        for x in self.inputs:
            if not (x.is_clock or x.clocks):
                now = self.driver.get(x.access, x.references.tolist(), len(x.elements))
                x.values[:] = x.last[:] = now
                for element, value, held in zip(x.elements, now, x.values.tolist(), strict=True):
                    if value != held and not x.number.is_float:  # NaN differs from itself
                        raise FMUError(
                            f"{self.name}.{element} starts with {value}, which is above 2^53 and does not "
                            "fit a float; do not connect or record it"
                        )

    def _settle(self, t0: float) -> None:
        """Make the calls that belong in initialization mode."""

    def _set_start(self) -> None:
        for name, values in self.start_values.items():
            self.driver.set(self.fmu.variables[name], values)

    def stop(self) -> str:
        """Terminate and free the instance; return how an isolated FMU crashed meanwhile, or ""."""
        before = self.driver.crash()
        with ctrl_c(self.signals):
            self._end()
            after = self.driver.crash()
            self.driver.close()
        return after if after != before else ""

    def _end(self) -> None:
        if not self.driver.takes_calls:
            return
        ends = [partial(self.api.freeFMUState, state) for state in self.kept]
        if self.running and self.driver.status < ERROR:
            ends.append(self.api.terminate)
        for end in ends:
            try:
                end()
            except Exception as error:  # the run is over; an FMU that cannot end is reported, not fatal
                self.driver.messages.append(f"[warning] {error}")
        self.running = False
        self.driver.free()

    @property
    def is_gone(self) -> bool:
        """Whether the process of an isolated FMU has ended."""
        return self.driver.is_gone

    # --------------------------------------------------------------------------- state

    @property
    def can_save(self) -> bool:
        """Whether the FMU can get and set its state."""
        return bool(self.driver.interface.canGetAndSetFMUstate)

    @property
    def can_serialise(self) -> bool:
        """Whether the FMU can serialise its state to bytes."""
        return bool(self.can_save and self.driver.interface.canSerializeFMUstate)

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
        """Return the properties that another instance must share to restore a state of this one."""
        ports = tuple(tuple(x.elements) for x in [*self.inputs, *self.outputs])
        return self.fmu.description.guid, self.driver.model_exchange, self.driver.event_mode, ports

    def save(self, serialised: bool = True) -> tuple[Any, ...]:
        """Return buffers, texts and the FMU's state: as bytes if possible, else kept until `stop`."""
        state = self.driver.attempt("get its state", self.api.getFMUState)
        if serialised and self.can_serialise:
            kept = self.driver.attempt("serialise its state", self.api.serializeFMUState, state)
            self.driver.attempt("free its state", self.api.freeFMUState, state)
        else:
            kept = state
            self.kept.append(state)
        return [array.copy() for array in self.arrays()], kept, (dict(self.texts), dict(self.sent_texts))

    def restore(self, saved: Any) -> None:
        """Return to the state that `save` returned, which stays valid."""
        arrays, kept, texts = saved
        if not self.driver.takes_calls:
            raise SnapshotError(
                f"{self.name} ended with a fatal error and takes no further calls; start a new simulation"
            )
        self.driver.status = OK
        state = kept
        if isinstance(kept, bytes):
            state = self.driver.attempt("read its state", self.api.deserializeFMUState, kept)
        self.driver.attempt("set its state", self.api.setFMUState, state)
        if isinstance(kept, bytes):
            self.driver.attempt("free its state", self.api.freeFMUState, state)
        for array, values in zip(self.arrays(), arrays, strict=True):
            array[:] = values
        self.texts, self.sent_texts = (dict(each) for each in texts)

    def forget(self, saved: Any) -> None:
        """Free a state that was kept."""
        self.kept.remove(saved[1])
        self.driver.attempt("free its state", self.api.freeFMUState, saved[1])

    def arrays(self) -> list[Any]:
        """Return the memory that belongs to the state of this instance."""
        return [array for x in [*self.inputs, *self.outputs] for array in (x.values, x.raw, x.last)]

    # ---------------------------------------------------------------------- operations

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

    def _get_outputs(self, x: VariableGroup, final: bool) -> list[Operation]:
        is_float64 = x.raw is x.values
        got = replace(self._values("Get", x, is_float64 and final), text=f"{self.name}: outputs (FMU)")
        return [got] if is_float64 else [got, self._convert(ToFloat, x, x.raw, x.values)]

    def _values(self, what: str, x: VariableGroup, finite: bool = False) -> Operation:
        return self.fmu.version.values(
            function=self.driver.address(f"{what}{x.access}"),
            component=self._component,
            references=int(x.references.ctypes.data),
            values=int(x.raw.ctypes.data),
            n_references=len(x.references),
            count=len(x.elements),
            finite=finite,
            participant=self.name,
        )

    def _convert(
        self, kind: type[ToFloat | FromFloat], x: VariableGroup, source: Any, target: Any
    ) -> Operation:
        return kind(
            source=int(source.ctypes.data),
            target=int(target.ctypes.data),
            count=len(x.elements),
            number=x.number,
            participant=self.name,
        )

    def _set_inputs(self, x: VariableGroup) -> list[Operation]:
        return [*self._from_floats(x), self._values("Set", x)]

    def _from_floats(self, x: VariableGroup) -> list[Operation]:
        return [] if x.raw is x.values else [self._convert(FromFloat, x, x.values, x.raw)]

    # --------------------------------------------------------- strings and binary data

    def _text_op(self, what: str, function: Callable[[float, float], None]) -> Operation:
        callback = self.signals.callback(self.name, function)
        return Call(text=f"{self.name}: {what} (Python callback)", function=callback, participant=self.name)

    def read_texts(self) -> list[Operation]:
        """Get the strings and binary data that are used."""
        return [self._text_op("text outputs", self._get_texts)] if self.texts else []

    def _latch_texts(self) -> list[Operation]:
        if not self.text_sources:
            return []
        return [self._text_op("text inputs", lambda t, h: self._set_texts(self._new_texts()))]

    def _get_texts(self, t: float, h: float) -> None:
        for name in self.texts:
            v = self.fmu.variables[name]
            empty: Any = "" if v.type == "String" else b""
            self.texts[name] = self.driver.get(v.type, [v.valueReference], 1)[0] or empty

    def _new_texts(self) -> dict[str, Any]:
        """Return the texts, by input, that differ from the last ones sent."""
        coming = {name: source.texts[port] for name, (source, port) in self.text_sources.items()}
        sent = self.sent_texts
        return {name: text for name, text in coming.items() if text not in (None, sent.get(name))}

    def _set_texts(self, texts: Mapping[str, Any]) -> None:
        for name, text in texts.items():
            self.driver.set(self.fmu.variables[name], [text])
        self.sent_texts.update(texts)

    # ----------------------------------------------------------------------- questions

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
        """Return the message of a status that a function of the FMU returned at t."""
        return self.driver.failure(status, t)

    def log(self) -> list[str]:
        """Return the FMU's log at warning level and above."""
        return self.driver.messages
