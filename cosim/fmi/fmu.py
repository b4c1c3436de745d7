"""An FMU as a component of a system: FMI 2.0 or 3.0, Co-Simulation or Model Exchange, loaded by FMPy.

    plant = FMU("plant.fmu", start={"m": 2.0})

fmu_file.py reads the file, interfaces.py holds the options of the interfaces, versions.py holds the
differences between the versions of FMI, and the folder instance holds the running FMU.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from os import PathLike
from typing import Any

from ..core.participant import Participant, rate
from ..errors import FMUError, WiringError
from ..loop.instance import Setting
from .fmu_file import FMUFile
from .instance.co_simulation import CoSimulationInstance
from .instance.drivers import load
from .instance.model_exchange import ModelExchangeInstance
from .interfaces import CoSimulation, Interface, InterfaceName, ModelExchange, interface_of


class FMU(FMUFile):
    """An FMU as a component of a system: its file, its start values, and its use in a run.

    path
        the .fmu file
    start
        start values of parameters and variables by name: numbers in the unit of the variable, or
        texts with another unit, such as "2 kN/m"; for a clock, its interval in s. Structural
        parameters (FMI 3.0) change the shapes of the arrays that they size
    interface
        CoSimulation(...) or ModelExchange(...) with their options, or "CoSimulation" or
        "ModelExchange" without options; None uses Co-Simulation if the FMU has it, and Model
        Exchange under stage coupling
    as_block
        whether the FMU acts as a Block does, at communication points in the order of the
        connections: set inputs, doStep from t_k, get outputs at t_k; an exported Block needs it
    every, sample_period
        for a block: it acts at every n-th communication point, or once per period in s
    isolated
        whether every instance runs in a process of its own (isolation): a crash in the FMU's code
        then raises SimulationError with the results until then; it costs a few microseconds per step

    Raises FMUError if the file, a start value or an option is not valid or not supported.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        start: Mapping[str, Any] | None = None,
        interface: Interface | InterfaceName | None = None,
        as_block: bool = False,
        every: int | None = None,
        sample_period: float | None = None,
        isolated: bool = False,
    ) -> None:
        super().__init__(path, start)
        #: the participant that was exported to this file, if it is known
        self.source: Participant | None = None
        #: an object that must live as long as the file, such as its temporary folder
        self.kept: object = None
        name = self.path.name
        #: the given interface with its options, or None
        self.interface: Interface | None = (
            interface
            if isinstance(interface, (CoSimulation, ModelExchange))
            else interface_of(name, interface)
        )
        self.as_block = as_block
        self.isolated = isolated
        self.every, self.sample_period = rate(name, every, sample_period)
        self._check_interface()
        self._check_block()
        #: whether Co-Simulation uses event mode
        self.event_mode = self._event_mode()

    @property
    def model_exchange(self) -> bool:
        """Whether sampled coupling uses Model Exchange."""
        return isinstance(self.interface, ModelExchange) or not self.has_cs

    @property
    def integration(self) -> ModelExchange:
        """The options of Model Exchange, which name the solver of sampled coupling."""
        options = self.interface if isinstance(self.interface, ModelExchange) else ModelExchange()
        return options.resolved(bool(self.description.numberOfEventIndicators))

    def with_start(self, start: Mapping[str, Any]) -> FMU:
        """Return the same FMU with further start values; they replace those of the same name."""
        made = copy.copy(self)
        made._take_start({**self.start, **start})
        return made

    # -------------------------------------------------------------------------- checks

    def _check_interface(self) -> None:
        name = self.path.name
        has = {CoSimulation: self.has_cs, ModelExchange: self.has_me}
        if self.interface is not None and not has[type(self.interface)]:
            asked, other = (kind.__name__ for kind in sorted(has, key=lambda kind: has[kind]))
            raise FMUError(f"{name}: interface={asked} is not available, the FMU has {other} only")
        if self.clocks and self.model_exchange:
            raise FMUError(
                f"{name} has clocks, which are supported with Co-Simulation only, and Model Exchange is "
                "used; " + ("omit interface=" if self.has_cs else "export it with Co-Simulation")
            )
        try:
            _ = self.integration
        except FMUError as error:
            raise FMUError(f"{name}, whose event indicators need cvode by default: {error}") from error

    def _check_block(self) -> None:
        name = self.path.name
        if self.as_block and self.model_exchange:
            why = "it has Model Exchange only" if not self.has_cs else "interface=ModelExchange is given"
            raise FMUError(f"{name}: as_block=True needs Co-Simulation, and {why}")
        if not self.as_block and (self.every, self.sample_period) != (None, None):
            raise FMUError(f"{name}: every and sample_period belong to a block; give as_block=True as well")

    def _event_mode(self) -> bool:
        asked = self.interface.event_mode if isinstance(self.interface, CoSimulation) else None
        clock = next(iter(self.clocks), None)
        if self.model_exchange or not (asked or clock):
            return False
        if not self.description.coSimulation.hasEventMode:
            raise FMUError(
                f"{self.path.name} has no event mode in Co-Simulation, which "
                + (f"its clock {clock} needs" if clock else "event_mode=True requires; omit that option")
            )
        if asked is False:
            raise FMUError(f"{self.path.name}: event_mode=False, but its clock {clock} needs event mode")
        return True

    # ----------------------------------------------------------------------- instances

    def instance(self, name: str, setting: Setting) -> CoSimulationInstance | ModelExchangeInstance:
        """Return a new instance for a run (cosim/loop/instance.py).

        Raises WiringError if the FMU cannot take part in stage coupling.
        """
        if setting.is_stage:
            self.check_stage(name)
        exchange = self.model_exchange or (setting.is_stage and not self.as_block)
        driver = load(self, name, exchange, setting.signals, self.event_mode, self.isolated)
        if exchange:
            return ModelExchangeInstance(driver, setting.used, self.integration)
        return CoSimulationInstance(driver, setting.used, setting.step)

    def check_stage(self, name: str) -> None:
        """Raise WiringError with the reason if the FMU cannot take part in stage coupling."""
        where, remedy = f"{name} ({self.path.name})", 'use coupling="sampled"'
        if self.as_block:
            if (self.every, self.sample_period) == (None, None):
                raise WiringError(
                    f"{where} stands for a block at every stage of the solver, and an FMU "
                    f"steps at communication points only; give it sample_period= or every=1, or {remedy}"
                )
            return
        if not self.has_me:
            raise WiringError(
                f"{where} has no Model Exchange, which stage coupling needs; "
                f"{remedy} or export it with Model Exchange"
            )
        if self.clocks:
            raise WiringError(
                f"{where} has clocks, which tick at communication points, and stage coupling has stages "
                f"between them; {remedy}"
            )
        if isinstance(self.interface, CoSimulation):
            raise WiringError(
                f"{where} has interface=CoSimulation, and stage coupling needs Model Exchange; "
                f"omit interface=, or {remedy}"
            )
        if self.interface is not None and self.interface != ModelExchange():
            raise WiringError(
                f"{where} has its own solver options, and stage coupling integrates all components "
                f"together, by simulate(solver=); omit the options of ModelExchange, or {remedy}"
            )

    def __repr__(self) -> str:
        kinds = " and ".join(
            k for k, has in (("Co-Simulation", self.has_cs), ("Model Exchange", self.has_me)) if has
        )
        return f"FMU({self.path.name}: FMI {self.description.fmiVersion}, {kinds})"
