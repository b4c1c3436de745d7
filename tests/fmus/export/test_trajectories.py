"""Exported plants compute what they should, in FMPy, in ecospy and called directly.

Linear plants against scipy.signal's exact discretisation, to 1e-12 of the largest value: both are
exact but for rounding, which grows with the number of steps (here 1000, 1e-16 each).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu
from scipy.linalg import eigh

from fmus.export.fmu import FMI_VERSIONS
from fmus.packaging.other_tools import ecospy
from fmus.plants.oscillator import Oscillator
from fmus.plants.shear_building import ShearBuilding, stiffness_matrix
from tests.fmus.export.host import CO_SIMULATION, MODEL_EXCHANGE, OK, Accumulator, Host, Root
from tests.fmus.export.linear import EXACT, exact, linear_building, linear_oscillator, relative
from tests.others import tool

STEPS, H = 1000, 0.01


def drive(h: Host, inputs: list[str], outputs: list[str], u: np.ndarray) -> np.ndarray:
    """Set, step, get, as a master does."""
    h.instantiate(CO_SIMULATION)
    h.prepare()
    assert h.call("EnterInitializationMode") == OK
    assert h.set(*zip(inputs, map(float, u[0]), strict=True)) == OK
    assert h.call("ExitInitializationMode") == OK
    rows = [h.get(*outputs)]
    for k, held in enumerate(u[:-1]):
        assert h.set(*zip(inputs, map(float, held), strict=True)) == OK
        assert h.step(k * H, H) == OK, h.log
        rows.append(h.get(*outputs))
    return np.array(rows)


def random_input(columns: int) -> np.ndarray:
    return np.random.default_rng(7).normal(size=(STEPS + 1, columns))


def test_oscillator_is_exact(host_of: Callable[[str], Host]) -> None:
    u = random_input(2)
    computed = drive(host_of("oscillator"), ["u", "d"], ["a", "x", "v"], u)
    expected = exact(linear_oscillator(), np.array([14.0, 25.0]), u, H)
    assert relative(computed, expected) < EXACT
    assert relative(computed[1:], expected[:-1]) > 1e-3  # one sample late would show


def test_building_is_exact(host_of: Callable[[str], Host]) -> None:
    u = random_input(4)
    inputs = ["ground_acceleration", "force[1]", "force[2]", "force[3]"]
    outputs = [*(f"acceleration[{i}]" for i in (1, 2, 3)), "base_shear", *(f"x[{i}]" for i in (1, 2, 3))]
    computed = drive(host_of("building"), inputs, outputs, u)
    expected = exact(linear_building(), np.zeros(6), u, H)
    assert relative(computed, expected) < EXACT
    assert relative(computed[1:], expected[:-1]) > 1e-3


def test_steps_of_any_length_are_exact(host_of: Callable[[str], Host]) -> None:
    """Held input over 1.7 s in one step, or in thirteen unequal ones: the same state."""
    h = host_of("oscillator")
    expected = exact(linear_oscillator(), np.array([14.0, 25.0]), np.array([[3.0, -1.0]] * 2), 1.7)[-1]
    for cuts in (0, 12):
        times = np.concatenate([[0.0], np.sort(np.random.default_rng(3).uniform(0.0, 1.7, cuts)), [1.7]])
        h.setup()
        h.set(("u", 3.0), ("d", -1.0))
        for t, following in itertools.pairwise(times):
            assert h.step(float(t), float(following - t)) == OK
        assert relative(np.array([h.get("a", "x", "v")]), expected[None]) < EXACT
        h.free()


def test_parameters_are_used(host_of: Callable[[str], Host]) -> None:
    h = host_of("oscillator")
    h.instantiate()
    assert h.set(("m", 2.0), ("k", 8.0), ("x", 1.0), ("v", -2.0)) == OK
    h.prepare(), h.call("EnterInitializationMode")
    assert h.get("a")[0] == pytest.approx((-0.001 * -2.0 - 8.0) / 2.0, rel=EXACT)  # evaluated on demand
    assert h.set(("c", 0.5)) == OK
    assert h.get("a")[0] == pytest.approx((-0.5 * -2.0 - 8.0) / 2.0, rel=EXACT)  # and again
    h.call("ExitInitializationMode")
    h.step(0.0, 0.3)
    expected = exact(linear_oscillator(2.0, 0.5, 8.0), np.array([1.0, -2.0]), np.zeros((2, 2)), 0.3)[-1]
    assert relative(np.array([h.get("a", "x", "v")]), expected[None]) < EXACT


@pytest.mark.parametrize("name", ["oscillator", "building"])
def test_fmpy_computes_the_same(fmu_of: Callable[..., Path], name: str) -> None:
    system = linear_oscillator() if name == "oscillator" else linear_building()
    x0 = np.array([14.0, 25.0]) if name == "oscillator" else np.zeros(6)
    inputs = (
        ["u", "d"] if name == "oscillator" else ["ground_acceleration", *(f"force[{i}]" for i in (1, 2, 3))]
    )
    u = random_input(len(inputs))
    signals = np.zeros(STEPS + 1, dtype=[(n, "f8") for n in ["time", *inputs]])
    signals["time"] = np.arange(STEPS + 1) * H
    for i, n in enumerate(inputs):
        signals[n] = u[:, i]
    result = simulate_fmu(
        str(fmu_of(name)), fmi_type="CoSimulation", stop_time=STEPS * H, output_interval=H, input=signals,
        output=["x", "v"] if name == "oscillator" else ["x[1]", "x[2]", "x[3]"],
    )  # fmt: skip
    states = np.column_stack([result[n] for n in (result.dtype.names or ())[1:]])
    expected = exact(system, x0, u, H)[:, 1:] if name == "oscillator" else exact(system, x0, u, H)[:, 4:]
    assert relative(states, expected) < EXACT


def test_model_exchange_in_fmpy(fmu_of: Callable[..., Path]) -> None:
    """Forward Euler in FMPy is x + h f(x): the same recursion in NumPy, to rounding."""
    A, B, _, _ = linear_oscillator()
    result = simulate_fmu(
        str(fmu_of("oscillator")), fmi_type="ModelExchange", solver="Euler", step_size=H, output_interval=H,
        stop_time=10.0, start_values={"u": 2.0}, output=["x", "v"],
    )  # fmt: skip
    x = np.array([14.0, 25.0])
    for _ in range(STEPS):
        x = x + H * (A @ x + B @ np.array([2.0, 0.0]))
    assert relative(np.array([[result["x"][-1], result["v"][-1]]]), x[None]) < EXACT


def test_cvode_agrees_with_the_exact_solution(fmu_of: Callable[..., Path]) -> None:
    """CVODE controls the local error; over ten units of time 1e-8 of it add up to some 1e-6."""
    result = simulate_fmu(
        str(fmu_of("oscillator")), fmi_type="ModelExchange", stop_time=10.0, relative_tolerance=1e-8,
        output_interval=0.1, output=["x", "v"],
    )  # fmt: skip
    expected = exact(linear_oscillator(), np.array([14.0, 25.0]), np.zeros((101, 2)), 0.1)[-1, 1:]
    assert relative(np.array([[result["x"][-1], result["v"][-1]]]), expected[None]) < 1e-6


@pytest.mark.parametrize("version", FMI_VERSIONS)
def test_ecos_computes_the_same(fmu_of: Callable[..., Path], version: str) -> None:
    """ecos steps by its own master: input set once, a hundred steps."""
    ecos = tool(ecospy)
    structure = ecos.EcosSimulationStructure()
    structure.add_model("plant", str(fmu_of("oscillator", version)))
    simulation = ecos.EcosSimulation(step_size=H, structure=structure)
    simulation.init(0.0)
    simulation.set_real("plant::u", 2.0)
    simulation.step(100)
    found = [simulation.get_real(f"plant::{n}") for n in ("x", "v")]
    at = simulation.get_time()
    simulation.terminate()
    simulation.free()
    assert at == pytest.approx(1.0)
    u = np.tile([2.0, 0.0], (101, 1))
    held_from_start = exact(linear_oscillator(), np.array([14.0, 25.0]), u, H)[-1, 1:]
    assert relative(np.array([found]), held_from_start[None]) < EXACT


def test_ecos_computes_the_same_building(fmu_of: Callable[..., Path]) -> None:
    """Ground acceleration and a force on the second floor, from rest; FMI 2.0, where arrays are scalars."""
    ecos = tool(ecospy)
    structure = ecos.EcosSimulationStructure()
    structure.add_model("b", str(fmu_of("building", "2.0")))
    simulation = ecos.EcosSimulation(step_size=H, structure=structure)
    simulation.init(0.0)
    simulation.set_real("b::ground_acceleration", 0.7)
    simulation.set_real("b::force[2]", 5.0)
    simulation.step(100)
    names = [*(f"acceleration[{i}]" for i in (1, 2, 3)), "base_shear", *(f"x[{i}]" for i in (1, 2, 3))]
    found = [simulation.get_real(f"b::{n}") for n in names]
    simulation.terminate()
    simulation.free()
    u = np.tile([0.7, 0.0, 5.0, 0.0], (101, 1))
    assert relative(np.array([found]), exact(linear_building(), np.zeros(6), u, H)[-1][None]) < EXACT


def test_a_nonlinear_plant_is_that_of_the_kernels(host_of: Callable[[str], Host]) -> None:
    """Interpreted kernels and FMU over 300 steps: the same operations, but sin and pow may round apart."""
    h, kernel = host_of("root"), Root()
    h.setup()
    for k in range(300):
        kernel.u = 1.0 + np.sin(0.1 * k)
        assert h.set(("u", kernel.u)) == OK
        kernel.advance(k * H, H)
        assert h.step(k * H, H) == OK
        kernel.derivatives((k + 1) * H)
        kernel.outputs((k + 1) * H)
        assert h.get("x", "y") == pytest.approx([kernel.x, kernel.y], rel=EXACT)


def test_a_block_is_that_of_its_kernel(host_of: Callable[[str], Host]) -> None:
    """Discrete memory and matrices, bit for bit: additions and products only, in the same order."""
    h, kernel = host_of("accumulator"), Accumulator(m=2, n=3)
    h.setup()
    for k, u in enumerate(np.random.default_rng(5).normal(size=(200, 3))):
        kernel.u[:] = u
        h.set(("u[1]", u[0]), ("u[2]", u[1]), ("u[3]", u[2]))
        held = h.get("y[1]", "y[2]")
        kernel.step(k * H, H)
        assert h.step(k * H, H) == OK
        assert h.get("y[1]", "y[2]", "s[2]") == [*kernel.y, kernel.s[1]]
        assert h.get("y[1]", "y[2]") != held


def _directional(h: Host, unknown: list[str], known: list[str], seed: np.ndarray) -> np.ndarray:
    result = np.zeros(len(unknown))
    status = h.call(
        "GetDirectionalDerivative",
        np.uint32([h.reference[n] for n in unknown]), np.uint64(len(unknown)),
        np.uint32([h.reference[n] for n in known]), np.uint64(len(known)), seed, result,
    )  # fmt: skip
    assert status == OK, h.log
    return result


@pytest.mark.parametrize("kind", [CO_SIMULATION, MODEL_EXCHANGE])
def test_directional_derivatives_of_a_linear_plant(host_of: Callable[[str], Host], kind: int) -> None:
    """[A B; C D] v, to 1e-9: the difference quotient divides rounding (1e-16) by its width (1e-6)."""
    A, B, C, D = linear_building()
    h = host_of("building")
    h.setup(kind)
    known = [*(f"x[{i}]" for i in (1, 2, 3)), *(f"v[{i}]" for i in (1, 2, 3)), "ground_acceleration",
             *(f"force[{i}]" for i in (1, 2, 3))]  # fmt: skip
    unknown = [*(f"der(v[{i}])" for i in (1, 2, 3)), *(f"acceleration[{i}]" for i in (1, 2, 3)), "x[2]"]
    jacobian = np.vstack([np.hstack([A, B])[3:], np.hstack([C, D])[:3], np.eye(10)[1]])
    before = h.get("acceleration[1]", "x[1]")
    for seed in [*np.eye(10), np.random.default_rng(2).normal(size=10)]:
        found = _directional(h, unknown, known, seed)
        assert np.abs(found - jacobian @ seed).max() < 1e-9 * np.abs(jacobian).max()
    assert h.get("acceleration[1]", "x[1]") == before
    assert not _directional(h, unknown, known, np.zeros(10)).any()


def test_directional_derivatives_of_a_nonlinear_plant(host_of: Callable[[str], Host]) -> None:
    """d(-x^3 + sin u) = -3 x^2 dx + cos u du; extrapolated differences are good to 1e-9."""
    h = host_of("root")
    h.setup(MODEL_EXCHANGE)
    found = _directional(h, ["der(x)", "y"], ["x", "u"], np.array([0.3, -2.0]))
    expected = [-3.0 * 4.0 * 0.3 - 2.0 * np.cos(1.0), 0.3 - 2.0 * 0.5 * 2.0]
    assert found == pytest.approx(expected, rel=1e-9)


def test_directional_derivative_by_a_parameter_while_initialising(host_of: Callable[[str], Host]) -> None:
    h = host_of("oscillator")
    h.instantiate()
    h.prepare(), h.call("EnterInitializationMode")
    found = _directional(h, ["a"], ["k"], np.ones(1))
    assert found[0] == pytest.approx(-14.0, rel=1e-9)  # a = (...- k x) / m


def test_rayleigh_damping_has_its_ratio_at_two_modes() -> None:
    m, k = np.array([3.0, 2.0, 1.5]), np.array([3000.0, 2000.0, 1000.0])
    plant = ShearBuilding.build(m, k, 0.05, rayleigh=(1, 3))
    squares, modes = eigh(stiffness_matrix(k), np.diag(m))
    ratios = np.diag(modes.T @ plant.C @ modes) / (2.0 * np.sqrt(squares))
    assert ratios[[0, 2]] == pytest.approx(0.05, rel=1e-12)
    assert ratios[1] < 0.05


def test_the_oscillator_starts_where_the_thesis_does() -> None:
    plant = Oscillator()
    assert (plant.x, plant.v, plant.m, plant.c, plant.k) == (14.0, 25.0, 1.0, 0.001, 0.01)
