"""The integrator of nonlinear structures: accuracy, order, energy, failure, a law of one's own."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la
from scipy.integrate import solve_ivp

from cosim import SimulationError, System, simulate
from cosim.codegen.kernels import lower
from fmus.elements.bilinear import bilinear
from fmus.elements.element import Element
from fmus.plants.nonlinear_structure import NonlinearStructure
from fmus.structures.structure import Structure, StructureError
from tests.fmus.plants.chains import Held, chain, drift, shaken, yielding_plant


def smooth(n, h):
    """Step means of a smooth ground acceleration (its integral's differences)."""
    t = np.arange(n + 1) * h
    integral = -4.0 / 5.0 * np.cos(5.0 * t) + 3.0 / 11.0 * np.sin(11.0 * t)
    return np.diff(integral)[:, None] / h


def smooth_at(t):
    return 4.0 * np.sin(5.0 * t) + 3.0 * np.cos(11.0 * t)


def test_linear_structure_is_newmark_one_quarter_one_half():
    """Against the textbook recursion with dense matrices: the same method, so to rounding (1e-10)."""
    n, h = 5, 0.02
    M, C, K = chain(n)
    elements = [bilinear(drift(n, 2), 900.0 * 1.6, 1.0, 1e9)]  # in K, and never yields
    plant = NonlinearStructure.build(Structure(M, C, K, np.ones(n), displacements=np.eye(n)), elements)
    ag = smooth(80, h)
    x, v, got = np.zeros(n), np.zeros(n), [np.zeros(n)]
    K_eff = 4 / h**2 * M + 2 / h * C + K
    for a in ag[:-1, 0]:
        p = -np.diag(M) * a
        dx = la.solve(K_eff, 2 * p + 4 / h * M @ v - 2 * K @ x)
        x, v = x + dx, 2 / h * dx - v
        got.append(x)
    y = shaken(plant, ag, h, jit=False)["plant.y"]
    assert np.abs(y - np.array(got)).max() < 1e-10 * np.abs(y).max()


def reference(t_end, times):
    """The same structure by an adaptive solver with the elements' states as its own."""
    n = 3
    M, C, K = chain(n)
    K = K - 900.0 * np.outer(drift(n, 0), drift(n, 0))
    B = np.array([drift(n, i) for i in range(3)])

    def f(t, X):
        x, v, q, z, g = X[:3], X[3:6], X[6], X[7], X[8]
        d, rate = B @ x, B @ v
        # bilinear and friction: an elastic-plastic slider each
        dq = 840.0 * rate[0] if abs(q) < 8.4 or q * rate[0] < 0 else 0.0
        dg = 500.0 * rate[2] if abs(g) < 1.5 or g * rate[2] < 0 else 0.0
        dz = rate[2] / 0.008 * (1 - abs(z) ** 2 * (0.5 + 0.5 * np.sign(rate[2] * z)))
        forces = np.array([60.0 * d[0] + q, 0.0, 40.0 * d[2] + 360.0 * 0.008 * z + g])
        speed = abs(rate[1])
        forces[1] += rate[1] * 6.0 * 0.02**-0.4 if speed <= 0.02 else np.sign(rate[1]) * 6.0 * speed**0.6
        forces[1] += 3000.0 * max(d[1] - 0.012, 0.0)
        a = -smooth_at(t) - la.solve(M, C @ v + K @ x + B.T @ forces)
        return np.concatenate([v, a, [dq, dz, dg]])

    s = solve_ivp(f, (0, t_end), np.zeros(9), t_eval=times, rtol=1e-8, atol=1e-10, max_step=1e-3)
    return s.y[:3].T


def test_converges_to_an_independent_solution_at_second_order():
    """Errors against an adaptive solver (1e-8) at three steps: halving the step divides the error
    by about 4 (order above 1.7: events within a step disturb the regular 2.0)."""
    times = np.linspace(0.0, 2.0, 101)
    exact = reference(2.0, times)
    errors = []
    for h in (0.01, 0.005, 0.0025):
        y = shaken(yielding_plant(), smooth(round(2.0 / h) + 1, h), h)["plant.y"]
        errors.append(np.abs(y[:: round(0.02 / h)] - exact).max() / np.abs(exact).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] < 2e-3
    assert orders.mean() > 1.7, (errors, orders)


def test_energy_balance_closes():
    """Input = kinetic + strain + damping + hysteretic to 1e-4; Newmark 1/4, 1/2 keeps the linear
    part exactly, and bisection keeps the mean force over a step near the force along the path."""
    result = shaken(yielding_plant(), smooth(801, 0.005), 0.005, ["plant.energy", "plant.dissipated"])
    energy = result["plant.energy"]
    ground, control, stored_and_lost = energy[:, 0], energy[:, 1], energy[:, 2:].sum(axis=1)
    assert np.abs(ground + control - stored_and_lost).max() < 1e-4 * ground[-1]
    assert result["plant.dissipated"][-1].sum() == pytest.approx(energy[-1, 5], rel=1e-12)
    without = shaken(yielding_plant(event_tolerance=1e9), smooth(801, 0.005), 0.005, ["plant.energy"])[
        "plant.energy"
    ]
    gap = np.abs(without[:, 0] - without[:, 2:].sum(axis=1)).max()
    assert gap > np.abs(ground - stored_and_lost).max()  # bisection is what closes it


def test_bilinear_oscillator_from_rest_at_constant_force():
    """Suddenly applied force F on a bilinear oscillator without damping: by energy, the peak solves
    F x = 1/2 k1 dy^2 + k1 dy (x - dy) + 1/2 k2 (x - dy)^2. Newmark with w h = 0.02 and less: 1e-4."""
    m, k1, k2, dy, F = 3.0, 1200.0, 100.0, 0.02, 16.0
    structure = Structure([[m]], [[0.0]], [[k1]], np.ones(1), displacements=np.ones(1))
    plant = NonlinearStructure.build(structure, [bilinear(np.ones(1), k1, k2, dy)])
    h = 1e-3
    y = shaken(plant, np.full((1600, 1), -F / m), h, jit=False)["plant.y"]
    # 1/2 k2 x^2 + ((k1 - k2) dy - F) x - 1/2 (k1 - k2) dy^2 = 0
    peak = np.roots([0.5 * k2, (k1 - k2) * dy - F, -0.5 * (k1 - k2) * dy**2]).max()
    assert y.max() == pytest.approx(peak, rel=1e-4)


def cubic(e, d, d0, rate, h, p, z0, z):
    """f = k d + k3 d^3, as a user writes a law of his own."""
    k, k3 = p[e, 0], p[e, 1]
    return k * d + k3 * d**3, k + 3.0 * k3 * d**2, 0.5 * k * d**2 + 0.25 * k3 * d**4, 0.0


def test_a_law_of_ones_own():
    """Duffing oscillator against an adaptive solver; h = 2 ms leaves (w h)^2/12 = 2e-4 in phase a radian."""
    structure = Structure([[2.0]], [[0.8]], [[300.0]], np.ones(1), displacements=np.ones(1))
    plant = NonlinearStructure.build(
        structure, [Element(cubic, np.ones(1), (300.0, 4e4), k0=300.0, scale=0.05)]
    )
    h = 2e-3
    y = shaken(plant, smooth(1001, h), h, jit=False)["plant.y"].ravel()
    t = np.arange(1001) * h
    s = solve_ivp(
        lambda t, x: [x[1], -smooth_at(t) - (0.8 * x[1] + 300 * x[0] + 4e4 * x[0] ** 3) / 2.0],
        (0, 2.0), [0, 0], t_eval=t, rtol=1e-10, atol=1e-12,
    )  # fmt: skip
    assert np.abs(y - s.y[0]).max() < 5e-3 * np.abs(s.y[0]).max()


def test_a_step_that_does_not_converge_says_element_time_and_residual():
    plant = yielding_plant(most_iterations=1.0, tolerance=1e-15)
    with pytest.raises(SimulationError) as error:
        shaken(plant, smooth(101, 0.005), 0.005, ["plant.y", "plant.failure"])
    assert "plant.y" in str(error.value)
    element, time, residual = error.value.result["plant.failure"][-1]
    assert 0 <= element < 5
    assert 0.0 < time < 4.0
    assert residual > 1e-15


def test_interpreted_and_compiled_agree():
    """The same operations in the same order; contraction to fused multiply-add leaves 1e-9 here."""
    table = smooth(60, 0.01)
    runs = []
    for jit in (True, False):
        system = System(
            {"plant": yielding_plant(), "quake": Held(table=table)}, [("quake.y", "plant.ground")]
        )
        runs.append(simulate(system, step=0.01, stop=0.5, record=["plant.y"], jit=jit)["plant.y"])
    assert np.abs(runs[0] - runs[1]).max() < 1e-9 * np.abs(runs[0]).max()


def test_a_stiffness_without_the_elements_initial_tangent_is_refused():
    """The chain's base spring is the element: K without it lets the chain float, K with it does not."""
    n = 3
    M, C, K = chain(n)
    element = bilinear(drift(n, 0), 900.0, 60.0, 0.01)
    floating = Structure(M, C, K - 900.0 * element.rows.T @ element.rows, np.ones(n))
    with pytest.raises(StructureError, match="K does not contain them; add "):
        NonlinearStructure.build(floating, [element])
    assert NonlinearStructure.build(Structure(M, C, K, np.ones(n)), [element]).k0.tolist() == [900.0]


def test_a_structure_needs_lumped_masses_and_elements_that_fit():
    M, C, K = chain(3)
    M[0, 1] = M[1, 0] = 0.5
    with pytest.raises(StructureError, match="M is not diagonal"):
        NonlinearStructure.build(Structure(M, C, K))
    with pytest.raises(StructureError, match="element 0 has rows of 2 entries, the structure has 3"):
        NonlinearStructure.build(Structure(np.diag(np.diag(M)), C, K), [bilinear(np.ones(2), 2.0, 1.0, 1.0)])


def test_only_the_laws_in_use_are_compiled():
    """The powers of the Bouc-Wen and viscous laws need a power function; bilinear elements do not."""
    M, C, K = chain(2)
    structure = Structure(M, C, K, np.ones(2))
    elements = [bilinear(drift(2, 0), 900.0, 60.0, 0.01), bilinear(drift(2, 1), 900.0, 60.0, 0.01)]
    plant = NonlinearStructure.build(structure, elements)
    assert "llvm.pow" not in lower(plant)
    assert "llvm.pow" in lower(yielding_plant())
    assert type(plant) is type(NonlinearStructure.build(structure, elements[:1]))  # compiled once


def test_a_matrix_that_cannot_be_factored_ends_the_run():
    """Damping so negative that 4/h^2 M + 2/h C + K is not positive definite; it must not yield numbers."""
    M, C, K = chain(3)
    structure = Structure(M, C - 1e4 * np.eye(3), K, np.ones(3), displacements=np.eye(3))
    with pytest.raises(SimulationError, match=r"plant\.y"):
        shaken(NonlinearStructure.build(structure), smooth(5, 0.01), 0.01, jit=False)
