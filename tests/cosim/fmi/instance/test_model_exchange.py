"""Model Exchange under sampled coupling: solvers, their orders, events at their instants, errors."""

from __future__ import annotations

import numpy as np
import pytest
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp

from cosim import (
    FMU,
    Continuous,
    FMUError,
    Input,
    ModelExchange,
    Parameter,
    Simulation,
    SimulationEndedWarning,
    SimulationError,
    State,
    System,
    WiringError,
    schedule,
    simulate,
)
from cosim.errors import LateEventWarning
from fmus.export import export
from tests.cosim.fmi.ball import ball, height
from tests.cosim.fmi.counter import counter
from tests.cosim.parts import Gain, Ramp

FIXED = ["ode1", "ode2", "ode3", "ode4"]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return ball(tmp_path_factory.mktemp("ball") / "ball.fmu")


class Pole(Continuous):
    """y' = y^2 / (1 + u), y(0) = 1: y = 1 / (1 - t) for u = 0"""

    u = Input()
    y = State(1.0)

    def derivatives(self, t):
        self.der_y = self.y * self.y / (1.0 + self.u)


class Stiff(Continuous):
    """y' = -L (y - u), z' = -z: a fast lag and a slow decay"""

    L = Parameter(1e5)
    u = Input()
    y = State(0.0)
    z = State(1.0)

    def derivatives(self, t):
        self.der_y = -self.L * (self.y - self.u)
        self.der_z = -self.z


@pytest.fixture(scope="module")
def plants(tmp_path_factory):
    """Plants with both interfaces."""
    folder = tmp_path_factory.mktemp("plants")
    classes = (Pole, Stiff, VanDerPol)
    return {plant: export(plant(), folder / f"{plant.__name__}.fmu") for plant in classes}


def exchanged(path, start=None, **options) -> FMU:
    return FMU(path, interface=ModelExchange(**options), start=start)


# ------------------------------------------------------------------------------- solvers


@pytest.mark.parametrize(("solver", "order"), [(s, i + 1) for i, s in enumerate(FIXED)])
def test_order_of_convergence(plants, solver, order):
    """The slope of log(error) over log(h) is the order; the next order changes it by 0.2 at these steps."""
    steps, errors = np.array([10, 20, 40]), []
    for n in steps:
        fmu = exchanged(plants[Pole], solver=solver)
        result = simulate(System({"p": fmu}), step=0.5 / n, stop=0.5)
        errors.append(abs(result["p.y"][-1] - 2.0))
    assert np.polyfit(np.log(0.5 / steps), np.log(errors), 1)[0] == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize("solver", FIXED)
def test_substeps_are_steps(plants, solver):
    """Four substeps of h and a step of h / 4 differ by the rounding of t + c h only."""
    coarse = simulate(System({"p": exchanged(plants[Pole], solver=solver, substeps=4)}), step=0.1, stop=0.5)
    fine = simulate(System({"p": exchanged(plants[Pole], solver=solver)}), step=0.025, stop=0.5)
    assert coarse["p.y"] == pytest.approx(fine["p.y"][::4], rel=1e-14)


class VanDerPol(Continuous):
    """x' = v, v' = (1 - x^2) v - x"""

    x = State(2.0)
    v = State(0.0)

    def derivatives(self, t):
        self.der_x = self.v
        self.der_v = (1.0 - self.x * self.x) * self.v - self.x


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
def test_cvode_keeps_its_tolerance_over_many_restarts(plants, tolerance):
    """CVODE restarts at order one at each of 500 communication points.

    The bound is 30 times the tolerance, because errors grow on the steep parts of the cycle. Internal
    steps controlled to `tolerance` itself would leave an error of 2e-3 at 1e-6.
    """
    fmu = exchanged(plants[VanDerPol], solver="cvode", tolerance=tolerance)
    result = simulate(System({"p": fmu}), step=0.02, stop=10.0)

    def slope(t, y):
        return [y[1], (1.0 - y[0] ** 2) * y[1] - y[0]]

    wanted = solve_ivp(slope, (0.0, 10.0), [2.0, 0.0], "DOP853", rtol=1e-12, atol=1e-13, t_eval=result.time)
    error = np.abs(result["p.x"] - wanted.y[0]).max()
    assert 0.01 * tolerance < error < 30.0 * tolerance


def test_a_stiff_plant_with_held_inputs(plants):
    """h L = 1000: y is u_k-1 at t_k, in closed form to exp(-1000); ode4 is stable for h L < 2.8 only."""
    links = [("r.u", "p.u")]
    system = System({"r": Ramp(), "p": exchanged(plants[Stiff], solver="cvode")}, links)
    result = simulate(system, step=0.01, stop=0.5)
    held = 2.0 + 3.0 * result.time[:-1]
    assert result["p.y"][1:] == pytest.approx(held, abs=1e-7)
    assert result["p.z"] == pytest.approx(np.exp(-result.time), abs=1e-6)
    system = System({"r": Ramp(), "p": exchanged(plants[Stiff], solver="ode4")}, links)
    with pytest.raises(SimulationError, match=r"p\.y|p failed"):
        simulate(system, step=0.01, stop=0.5)


def test_a_long_step_is_not_a_failure_of_the_solver(plants):
    """A communication step may take more than the 500 internal steps at which CVODE stops by default."""
    fmu = exchanged(plants[Pole], solver="cvode", tolerance=1e-10)
    result = simulate(System({"p": fmu}), step=0.999, stop=0.999)
    assert result["p.y"][-1] == pytest.approx(1000.0, rel=1e-6)  # errors grow by y^2


def test_a_run_can_be_repeated(path):
    """CVODE restarts at every communication point, so earlier runs do not change a bit."""
    runs = [simulate(System({"b": FMU(path)}), step=0.1, stop=1.0 * n)["b.h"] for n in (4, 4, 2)]
    assert list(runs[0]) == list(runs[1])
    assert list(runs[0][:21]) == list(runs[2])


@pytest.mark.parametrize("solver", ["ode2", "cvode"])
def test_a_run_can_be_rolled_back(path, solver):
    """A run over a bounce and a time event is repeated twice with the same bits."""
    fmu = exchanged(path, solver=solver, start={"first_at": 1.37})
    with Simulation(System({"b": fmu}), step=0.1) as simulation:
        simulation.run(1.3)
        there = simulation.snapshot()
        runs = []
        for _ in range(3):
            runs.append(simulation.run(2.5))
            simulation.restore(there)
    for name in ("b.h", "b.v", "b.q", "b.bounces"):
        assert list(runs[0][name]) == list(runs[1][name]) == list(runs[2][name])
    assert runs[0]["b.bounces"][-1] > runs[0]["b.bounces"][0]


# -------------------------------------------------------------------------------- events


def test_the_fmu_of_these_tests_is_valid(path):
    assert validate_fmu(str(path)) == []


def test_a_bouncing_ball_against_its_closed_form(path):
    """Seven bounces, then rest. A bounce at the end of a step would make h wrong by up to 0.03."""
    result = simulate(System({"b": FMU(path)}), step=0.03, stop=6.0)
    wanted = [height(t) for t in result.time]
    assert result["b.h"] == pytest.approx(wanted, abs=2e-6)
    assert result["b.bounces"][-1] == 7.0
    assert result["b.h"][-1] == result["b.v"][-1] == 0.0
    with pytest.warns(
        LateEventWarning, match=r"b has a state event in the step to t = .*, which is handled at its"
    ):
        late = simulate(System({"b": exchanged(path, solver="ode4")}), step=0.03, stop=3.0)
    assert np.abs(late["b.h"] - wanted[: len(late.time)]).max() > 1e-2


@pytest.mark.parametrize("solver", [*FIXED, "cvode"])
@pytest.mark.parametrize(("first", "period"), [(0.37, 0.25), (0.05, 0.01), (0.3, 0.1)])
def test_time_events_are_met_exactly(path, solver, first, period):
    """q' = 1, -1, 1, ...: every method is exact between events, and wrong by h if it passes over one."""
    fmu = exchanged(path, solver=solver, start={"first_at": first, "period": period, "g": 0.0})
    result = simulate(System({"b": fmu}), step=0.1, stop=2.0)
    events = first + period * np.arange(1000)
    knots = np.concatenate([[0.0], events])
    slopes = (-1.0) ** np.arange(1000)
    q = np.concatenate([[0.0], np.cumsum(np.diff(knots) * slopes)])
    assert result["b.q"] == pytest.approx(np.interp(result.time, knots, q), abs=1e-9)
    counts = np.searchsorted(events, result.time + 1e-9)
    assert list(result["b.level"]) == list((-1.0) ** counts)


@pytest.mark.parametrize(
    ("solver", "coupling", "step"),
    [
        *((solver, "sampled", h) for solver in ("ode1", "ode4", "cvode") for h in (0.05, 0.1, 0.2, 0.3)),
        *((None, "continuous", h) for h in (0.05, 0.1)),
    ],
)
def test_time_events_of_an_fmu_without_states(tmp_path, solver, coupling, step):
    """The FMU refuses an event that is wrong by rounding, and all functions of states, as it has no states.

    Its events are at sums of 0.1, the communication points at products: they differ from k = 6 on.
    """
    path = counter(tmp_path / "counter.fmu")
    assert validate_fmu(str(path)) == []
    fmu = exchanged(path, start={"last": 57}, solver=solver)
    with pytest.warns(SimulationEndedWarning, match=r"c asked to end the simulation at t = 5\.7 s"):
        result = simulate(System({"c": fmu}), step=step, stop=6.0, coupling=coupling)
    assert list(result["c.count"]) == list(np.floor(10.0 * result.time + 1e-9))
    assert result["c.count"][-1] == (57.0 if step != 0.2 else 56.0)


def test_an_input_that_jumps_over_an_indicator_is_an_event_at_once(path):
    """The gust is 0.40, 0.46, 0.52, ...: it passes 0.5 at t_2, which the output shows at t_3."""
    system = System({"r": Ramp(), "g": Gain(K=0.2), "b": FMU(path)}, [("r.u", "g.x"), ("g.u", "b.gust")])
    result = simulate(system, step=0.1, stop=0.5)
    assert list(result["b.gusts"]) == [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]


@pytest.mark.parametrize(
    ("solver", "coupling", "last", "when"),
    [
        ("cvode", "sampled", 1.25, r"1\.414\d*"),
        ("ode4", "sampled", 1.5, r"1\.5"),
        (None, "continuous", 1.5, r"1\.5"),
    ],
)
def test_a_request_to_end_in_an_event(path, solver, coupling, last, when):
    """A bounce at sqrt(2) s: cvode leaves the step there, fixed-step methods find it at the end of theirs."""
    fmu = exchanged(path, start={"end_at_bounce": 1}, solver=solver)
    with pytest.warns(SimulationEndedWarning, match=rf"b asked to end the simulation at t = {when} s"):
        result = simulate(System({"b": fmu}), step=0.25, stop=5.0, coupling=coupling)
    assert result.time[-1] == last
    fmu = FMU(path, start={"end_at_bounce": 0, "h": 0.0, "v": -1.0})
    with pytest.raises(SimulationError, match=r"b asked to end the simulation at its start, t = 0 s"):
        simulate(System({"b": fmu}), step=0.25, stop=5.0)


def test_stage_coupling_warns_of_a_time_event_inside_a_step(path):
    fmu = FMU(path, start={"first_at": 0.25, "g": 0.0})
    words = r"b has a time event at t = 0\.25 s, inside the step to t = 0\.3 s"
    with pytest.warns(LateEventWarning, match=words):
        simulate(System({"b": fmu}), step=0.1, stop=0.5, coupling="continuous")


def test_the_text_of_the_schedule(path):
    cvode = "  b: cvode, tolerance 1e-06, from event to event (FMU, Python callback)"
    assert cvode in schedule(System({"b": FMU(path)}), step=0.1).splitlines()
    fixed = "  b: ode2, 3 substeps, split at time events (FMU)"
    assert fixed in schedule(System({"b": exchanged(path, solver="ode2", substeps=3)}), step=0.1).splitlines()


# -------------------------------------------------------------------------------- errors


@pytest.mark.parametrize("solver", ["ode3", "cvode"])
def test_an_fmu_that_fails_in_a_step(path, solver):
    fmu = exchanged(path, solver=solver, start={"fails_at": 0.55})
    with pytest.raises(SimulationError, match=r"b failed.* at t = 0\.5\d* s with fmi2Error") as caught:
        simulate(System({"b": fmu}), step=0.1, stop=1.0)
    assert len(caught.value.result.time) == 6


def test_derivatives_that_are_discarded(path):
    """cvode tries smaller steps, and fails because the ball does not bounce above the hole."""
    start = {"hole": -0.5}
    with pytest.raises(SimulationError, match=r"b does not get past t = 0\.9999\d* s"):
        simulate(System({"b": FMU(path, start=start)}), step=0.1, stop=2.0)
    with pytest.raises(SimulationError, match=r"b failed at t = .* with fmi2Discard"):
        simulate(System({"b": exchanged(path, start=start, solver="ode4")}), step=0.1, stop=2.0)


def test_events_without_end_are_an_error(path):
    with pytest.raises(SimulationError, match=r"b does not get past t = 0\.05\d* s .*events accumulate"):
        simulate(System({"b": FMU(path, start={"first_at": 0.05, "period": 1e-15})}), step=0.1, stop=0.1)


def test_interfaces_that_an_fmu_does_not_support(path, plants):
    both = plants[Pole]
    for where, options, words in [
        (both, {"interface": "modelexchange"}, "did you mean 'ModelExchange'"),
        (path, {"interface": "CoSimulation"}, "interface=CoSimulation is not available, the FMU has ModelE"),
        (path, {"interface": ModelExchange(substeps=2)}, r"ball\.fmu, whose event indicators need cvode"),
        (both, {"interface": ModelExchange(tolerance=1e-3)}, "tolerance belongs to"),
        (both, {"interface": "ModelExchange", "as_block": True}, "interface=ModelExchange is given"),
    ]:
        with pytest.raises(FMUError, match=words):
            FMU(where, **options)
    for options, words in [
        ({"interface": "CoSimulation"}, "stage coupling needs Model Exchange; omit interface="),
        ({"interface": ModelExchange("ode4")}, "omit the options of ModelExchange"),
    ]:
        with pytest.raises(WiringError, match=words):
            simulate(System({"p": FMU(both, **options)}), step=0.1, stop=0.1, coupling="continuous")
