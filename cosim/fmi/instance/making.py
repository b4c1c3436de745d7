"""The running instance of an FMU: with Co-Simulation or Model Exchange, as the run needs it."""

from __future__ import annotations

from weakref import WeakValueDictionary

from ...errors import WiringError
from ...loop.instance import Setting
from ..fmu import FMU
from .co_simulation import CoSimulationInstance
from .instance import FMUInstance
from .model_exchange import ModelExchangeInstance

#: instances of FMUs that can be instantiated only once per process, by token
_ALONE: WeakValueDictionary[str, FMUInstance] = WeakValueDictionary()


def instance_of(name: str, fmu: FMU, setting: Setting) -> CoSimulationInstance | ModelExchangeInstance:
    """Return an instance of an FMU; refuse a setting that it does not fit."""
    if setting.is_stage and fmu.as_block and setting.every is None:
        raise WiringError(
            f"{name} ({fmu.path.name}) stands for a block at every stage of the solver, and an FMU "
            "steps at communication points only; give it sample_period= or every=1, "
            'or use coupling="sampled"'
        )
    is_integrated = setting.is_stage and not fmu.as_block
    if is_integrated:
        _check_stage(f"{name} ({fmu.path.name})", fmu)
    model_exchange = is_integrated or fmu.model_exchange
    description = fmu.description
    interface = description.modelExchange if model_exchange else description.coSimulation
    is_alone = interface.canBeInstantiatedOnlyOncePerProcess and not fmu.isolated
    if is_alone:
        _check_alone(name, fmu, setting)
    used, signals = set(setting.used), setting.signals
    made = (
        ModelExchangeInstance(name, fmu, signals, used)
        if model_exchange
        else CoSimulationInstance(name, fmu, signals, used, setting.step)
    )
    if is_alone:
        _ALONE[description.guid] = made
    return made


def _check_stage(where: str, fmu: FMU) -> None:
    if not fmu.has_me:
        raise WiringError(
            f"{where} has no Model Exchange, which stage coupling needs; "
            'use coupling="sampled" or export it with Model Exchange'
        )
    if fmu.clocks:
        raise WiringError(
            f"{where} has clocks, which tick at communication points, and stage coupling has stages "
            'between them; use coupling="sampled"'
        )
    if fmu.interface == "CoSimulation":
        raise WiringError(
            f'{where} is to be used with interface="CoSimulation", and stage coupling needs Model '
            'Exchange; leave interface away, or use coupling="sampled"'
        )
    if fmu.solver is not None or fmu.substeps != 1:
        raise WiringError(
            f"{where} has a solver of its own, and stage coupling integrates all participants "
            "together, by simulate(solver=); leave solver and substeps of the FMU away, "
            'or use coupling="sampled"'
        )


def _check_alone(name: str, fmu: FMU, setting: Setting) -> None:
    other = _ALONE.get(fmu.description.guid)
    if other is None or other.is_ended:
        return
    if other.failures is setting.signals:
        raise WiringError(
            f"{name} and {other.name} are the same FMU, {fmu.path.name}, which can be instantiated only once "
            "per process; run each in a process of its own, FMU(..., isolated=True)"
        )
    raise WiringError(
        f"{name} ({fmu.path.name}) can be instantiated only once per process, and a simulation "
        "that is open has it; close that first, or say FMU(..., isolated=True)"
    )
