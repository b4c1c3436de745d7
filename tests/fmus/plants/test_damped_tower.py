"""The tower with damper: its modes and its step against scipy.linalg.expm, and energy."""

from dataclasses import asdict

import numpy as np
import pytest
import scipy.linalg as la

from controllers.design.design_model import first_order
from cosim import Array, System, simulate
from fmus.export import as_fmu
from fmus.kernels.coupled_modes import coupled_modes
from fmus.loads.wind import FloorLoad
from fmus.plants.damped_tower import DampedTower
from fmus.plants.modal_structure import ModalStructure
from fmus.structures.structure import Structure, modes_of
from scenarios.tall_building.building import Damper, default_building, with_damper
from tests.fmus.plants.towers import small_tower

FLOORS = (1, 30, 50, 76)


def held_step(coupled: Structure, h: float) -> tuple[Array, Array]:
    """A_d, B_d of the dense exponential; the reference."""
    n = coupled.dof
    A = first_order(coupled.M, coupled.C, coupled.K)
    B = np.vstack([np.zeros((n, n)), la.inv(coupled.M)])
    E = la.expm(np.block([[A * h, B * h], [np.zeros((n, 3 * n))]]))
    return E[: 2 * n, : 2 * n], E[: 2 * n, 2 * n :]


@pytest.mark.parametrize(
    "damper",
    [
        Damper(),
        Damper(c=2.0e4),
        Damper(c=2.0e6),
        Damper(m=5e6, c=1e3, k=5.05e6),
        Damper(k=5e3),
        Damper(k=5e8),
    ],
    ids=["benchmark", "lightly damped", "overdamped", "heavy", "soft", "stiff"],
)
@pytest.mark.parametrize("stiffness", [1.0, 1.15, 0.85])
def test_modes_are_complete(damper: Damper, stiffness: float) -> None:
    """sum phi phi' = 0 and sum lambda phi phi' = M^-1 hold for a complete set only, to round-off."""
    structure = default_building()
    modes, n = modes_of(structure), structure.dof
    roots = np.zeros((2 * n + 2, 2))
    re, im = np.zeros((2, 2 * n + 2, n + 1))
    count = coupled_modes(
        stiffness * modes.omega**2,
        modes.damping,
        modes.shapes[-1].copy(),
        damper.m,
        damper.c,
        damper.k,
        roots,
        re,
        im,
    )
    lam = roots[:count, 0] + 1j * roots[:count, 1]
    pairs = np.where(lam.imag > 0, 2.0, 1.0)
    assert pairs.sum() == 2 * (n + 1)
    phi = re[:count] + 1j * im[:count]
    phi = np.hstack([phi[:, :n] @ modes.shapes.T, phi[:, n:]])
    M_inv = la.inv(with_damper(structure, damper, stiffness).M)
    scale = np.abs(M_inv).max()
    assert np.abs(((pairs * phi.T) @ phi).real).max() < 1e-12 * scale
    assert np.abs(((pairs * lam * phi.T) @ phi).real - M_inv).max() < 1e-11 * scale


@pytest.mark.parametrize("make", [default_building, small_tower], ids=["76 floors", "5 floors"])
@pytest.mark.parametrize("plant", ["python", "fmu"])
def test_step_is_the_matrix_exponential(make, plant: str) -> None:  # type: ignore[no-untyped-def]
    """1e-10 of the peak is asked; forces change at every step, so a shift by one sample shows at once.

    0.2 s only: K spans 16 digits less than omega_max^2/omega_1^2 = 1e9 needs, so omega_1 of either method is
    uncertain by some 1e-9 and the phases part company over seconds.
    """
    structure, h, steps, stiffness = make(), 0.001, 200, 0.85
    n = structure.dof
    floors = [1, n // 2, n]
    rng = np.random.default_rng(1)
    table = 1e5 * rng.normal(size=(steps + 1, n + 1))
    tower = DampedTower.build(structure, floors, stiffness=stiffness, **asdict(Damper()))
    system = System(
        {"load": FloorLoad(table=table[:, :n], dt=h), "force": FloorLoad(table=table[:, n:], dt=h)}
    )
    system.add("tower", as_fmu(tower) if plant == "fmu" else tower)
    system.connect("load.w", "tower.w")
    system.connect("force.w", "tower.u")
    result = simulate(
        system, step=h, stop=steps * h, record=["tower.x", "tower.v", "tower.a", "tower.x_m", "tower.a_m"]
    )

    coupled = with_damper(structure, stiffness=stiffness)
    A_d, B_d = held_step(coupled, h)
    A, M_inv = first_order(coupled.M, coupled.C, coupled.K), la.inv(coupled.M)
    X = np.zeros((steps + 1, 2 * n + 2))
    acceleration = np.zeros((steps + 1, n + 1))
    for k in range(steps):
        X[k + 1] = A_d @ X[k] + B_d @ table[k]
        acceleration[k + 1] = A[n + 1 :] @ X[k + 1] + M_inv @ table[k]  # carries the force of the last step
    rows = np.array(floors) - 1
    for got, wanted in (
        (result["tower.x"], X[:, rows]),
        (result["tower.v"], X[:, n + 1 + rows]),
        (result["tower.a"], acceleration[:, rows]),
        (result["tower.x_m"], X[:, n]),
        (result["tower.a_m"], acceleration[:, n]),
    ):
        assert np.abs(got - wanted).max() < 1e-10 * np.abs(wanted).max()


def test_parameters_are_settable_in_the_fmu() -> None:
    """Stiffness and damper constants set on the FMU give the plant made with them: same kernel, same bits."""
    structure = small_tower()
    made = DampedTower.build(structure, [5], m=3e5, c=1e5, k=4e5, stiffness=1.15)
    fmu = as_fmu(DampedTower.build(structure, [5], m=5e5, c=2e5, k=5e5))
    fmu = fmu.with_start({"stiffness": 1.15, "m": 3e5, "c": 1e5, "k": 4e5})
    results = []
    for plant in (made, fmu):
        system = System(
            {"load": FloorLoad(table=np.full((2, 5), 1e5), dt=10.0), "tower": plant}, [("load.w", "tower.w")]
        )
        results.append(simulate(system, step=0.01, stop=5.0, record=["tower.x", "tower.x_m"]))
    np.testing.assert_allclose(results[0]["tower.x"], results[1]["tower.x"], rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(results[0]["tower.x_m"], results[1]["tower.x_m"], rtol=1e-12, atol=1e-15)


def test_real_modes_are_the_matrix_exponential() -> None:
    """Under-, over- and (mode 4 at this stiffness) critically damped modes in one structure, to 1e-10."""
    structure, h = small_tower(), 0.02
    stiffness = 1.3**2  # zeta_4 = 1.3 becomes 1
    n = structure.dof
    rng = np.random.default_rng(2)
    table = 1e5 * rng.normal(size=(101, n))
    system = System(
        {"load": FloorLoad(table=table, dt=h), "tower": ModalStructure.build(structure, [2, 5], stiffness)},
        [("load.w", "tower.w")],
    )
    result = simulate(system, step=h, stop=100 * h, record=["tower.x", "tower.a"])
    A_d, B_d = held_step(Structure(structure.M, structure.C, stiffness * structure.K), h)
    X = np.zeros((101, 2 * n))
    for k in range(100):
        X[k + 1] = A_d @ X[k] + B_d @ table[k]
    wanted = X[:, [1, 4]]
    assert np.abs(result["tower.x"] - wanted).max() < 1e-10 * np.abs(wanted).max()


def test_energy_balance_of_an_uncontrolled_run_closes() -> None:
    """Work of the load = kinetic + strain + dissipated energy, to 1e-6 of the work.

    The work over a step is exact (held force times displacement). The dissipation is integrated by
    Simpson's rule over the recorded velocities, whose error at 1 ms is below 1e-8 for modes under 10 Hz;
    the load starts gently enough not to excite those above.
    """
    structure, h, steps = default_building(), 0.001, 20000
    rng = np.random.default_rng(5)
    coarse = 1e5 * rng.normal(size=(12, 76)).cumsum(axis=0)
    coarse[0] = 0.0
    table = np.array(
        [np.interp(np.arange(steps + 1) * h, np.arange(12) * 2.0, coarse[:, j]) for j in range(76)]
    ).T
    system = System(
        {"load": FloorLoad(table=table, dt=h), "tower": ModalStructure.build(structure, range(1, 77))},
        [("load.w", "tower.w")],
    )
    result = simulate(system, step=h, stop=steps * h, record=["tower.x", "tower.v"])
    x, v = result["tower.x"], result["tower.v"]
    work = np.einsum("ki,ki->", table[:-1], np.diff(x, axis=0))
    power = np.einsum("ki,ij,kj->k", v, structure.C, v, optimize=True)
    dissipated = h / 3.0 * (power[0] + 4 * power[1:-1:2].sum() + 2 * power[2:-1:2].sum() + power[-1])
    stored = 0.5 * (v[-1] @ structure.M @ v[-1] + x[-1] @ structure.K @ x[-1])
    assert dissipated > 0.01 * work
    assert work == pytest.approx(stored + dissipated, rel=1e-6)
