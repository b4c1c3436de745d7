"""A branch that cannot be made leaves nothing behind, and the simulation that it was made of goes on."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from cosim import FMU, Simulation, SimulationError, simulate
from fmus.export import export
from tests.cosim.parts import Chain, closed
from tests.processes import children


@pytest.mark.parametrize(
    "error", [SimulationError("it does not fit"), KeyboardInterrupt()], ids=["error", "Ctrl-C"]
)
def test_a_branch_that_fails_is_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    """An isolated FMU is a process, so that a leftover instance can be counted."""
    system = closed(FMU(export(Chain(), tmp_path / "chain.fmu"), isolated=True))
    whole = simulate(system, step=0.01, stop=1.0, record=["plant.a"])
    restore = Simulation.restore
    running: list[int] = []

    def failing(self: Simulation, snapshot: object) -> None:
        restore(self, snapshot)  # type: ignore[arg-type]
        running.append(len(children(os.getpid())))
        raise error

    with Simulation(system, step=0.01, record=["plant.a"]) as simulation:
        simulation.run(0.5)
        one = children(os.getpid())
        monkeypatch.setattr(Simulation, "restore", failing)
        with pytest.raises(type(error)) as caught:
            simulation.branch()
        assert caught.value is error
        assert running == [len(one) + 1]
        assert children(os.getpid()) == one
        rest = simulation.run(1.0)
    assert np.array_equal(rest["plant.a"], whole["plant.a"][50:])
