"""A Continuous with only an advance: sampled coupling and Co-Simulation, nothing else."""

import pytest

from cosim import Continuous, CosimError, DeclarationError, Input, State, System, simulate
from fmus.export import export


class Implicit(Continuous):
    """x' = u - 3 x by the backward Euler method"""

    u = Input()
    x = State(2.0)

    def advance(self, t: float, h: float) -> None:
        self.x = (self.x + h * self.u) / (1.0 + 3.0 * h)


class Neither(Continuous):
    """A state and no equation."""

    x = State(1.0)


def test_it_runs_under_sampled_coupling():
    result = simulate(System({"p": Implicit(u=0.5)}), step=0.1, stop=2.0)
    expected = 2.0
    for _ in range(20):
        expected = (expected + 0.1 * 0.5) / 1.3
    assert result["p.x"][-1] == pytest.approx(expected, rel=1e-14)  # the same operations


def test_stage_coupling_refuses_it():
    with pytest.raises(CosimError, match="has only an advance"):
        simulate(System({"p": Implicit()}), step=0.1, stop=1.0, coupling="continuous")


def test_it_leaves_as_co_simulation_only(tmp_path):
    from fmpy import read_model_description
    from fmpy.validation import validate_fmu

    for version in ("2.0", "3.0"):
        path = export(Implicit(u=0.5), tmp_path / f"implicit{version[0]}.fmu", fmi_version=version)
        description = read_model_description(path)
        assert description.modelExchange is None
        assert description.coSimulation is not None
        assert [v.name for v in description.modelVariables if v.causality == "output"] == ["x"]
        assert not [v.name for v in description.modelVariables if v.name.startswith("der(")]
        assert validate_fmu(str(path)) == []


def test_one_of_the_two_is_needed():
    with pytest.raises(DeclarationError, match="derivatives"):
        Neither()
