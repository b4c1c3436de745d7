"""A state that overflows in Model Exchange is named, with its element, in both versions of FMI."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim import FMU, Input, LinearContinuous, Output, SimulationError, State, System, simulate
from fmus.export import export


class Drift(LinearContinuous):
    """w' = 1, x_i' = u_i: the inputs are summed in x; the output is w."""

    u = Input(shape=3)
    w = State(0.0)
    x = State([1.0, 2.0, 3.0], shape=3)
    y = Output()

    def derivatives(self, t: float) -> None:
        self.der_w = 1.0
        for i in range(3):
            self.der_x[i] = self.u[i]

    def outputs(self, t: float) -> None:
        self.y = self.w


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("coupling", ["sampled", "continuous"])
def test_the_state_is_named(tmp_path: Path, version: str, coupling: str) -> None:
    """x[2] = 2 + 1e308 t exceeds the largest double, 1.8e308, in the step from t = 1 s, as the only state."""
    path = export(Drift(), tmp_path / "drift.fmu", fmi_version=version, interfaces=["ModelExchange"])
    plant = FMU(path, start={"u": [0.0, 1e308, 0.0]})
    options = {"coupling": coupling} | ({"solver": "ode1"} if coupling == "continuous" else {})
    with pytest.raises(SimulationError, match=r"plant\.x\[2\] is not finite .*t = 1 s \(step 1\)") as caught:
        simulate(System({"plant": plant}), step=1.0, stop=9.0, record=["plant.y"], **options)
    assert caught.value.result["plant.y"].tolist() == pytest.approx([0.0, 1.0])  # until then
