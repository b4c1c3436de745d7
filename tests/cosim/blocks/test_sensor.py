"""Sensor dynamics are exact for held inputs: SciPy's zero-order hold is the reference."""

import numpy as np
import pytest
from scipy import signal

from cosim import DeclarationError
from cosim.blocks import SensorDynamics, StateSpace, StrictlyProper, transfer_function
from cosim.core.dependencies import dependencies
from tests.cosim.blocks.drive import trace

#: Both sides are exact but for rounding: 300 steps of some ten operations at 1.1e-16, and
#: the matrix exponentials of either side, stay below 1e-12 of the largest output. An input
#: shifted by one sample is off by the size of the output itself.
EXACT = 1e-12


def held(A, B, C, D, u, h):
    """Return y_k of the system whose input u_j is held over [t_j, t_{j+1}], from rest."""
    Ad, Bd, *_ = signal.cont2discrete((A, B, C, D), h, "zoh")
    x = np.zeros(len(A))
    y = []
    for k in range(len(u)):
        before = u[k - 1] if k else np.zeros(u.shape[1])
        y.append(C @ x + D @ before)
        x = Ad @ x + Bd @ u[k]
    return np.array(y)


@pytest.mark.parametrize("h", [1e-4, 0.01, 0.3])
def test_sensor_dynamics(rng, h):
    """1/(mu s + 1)^2 in closed form; y is a state, advanced over the step, so y_0 = 0 comes first."""
    mu, u = 0.008, rng.normal(size=(300, 1))
    A, B = np.array([[0.0, 1.0], [-1 / mu**2, -2 / mu]]), np.array([[0.0], [1 / mu**2]])
    expected = held(A, B, np.array([[1.0, 0.0]]), np.zeros((1, 1)), u, h)
    y = np.vstack([[[0.0]], trace(SensorDynamics(mu), u, h, "y")[:-1]])
    assert np.abs(y - expected).max() < EXACT * np.abs(expected).max()


def test_sensor_dynamics_step_response():
    """y(t) = 1 - (1 + t/mu) e^(-t/mu), one step of any length; 1e-15 is a few roundings of 1."""
    for t in (0.001, 0.008, 0.05):
        y = trace(SensorDynamics(0.008), np.ones((1, 1)), t, "y")[0, 0]
        assert abs(y - (1 - (1 + t / 0.008) * np.exp(-t / 0.008))) < 1e-15


def test_sensor_channels_are_independent(rng):
    """Each channel gives the bits of a single sensor."""
    u = rng.normal(size=(50, 3))
    three = trace(SensorDynamics(n=3), u, 0.01, "y")
    for i in range(3):
        assert np.array_equal(three[:, i : i + 1], trace(SensorDynamics(n=1), u[:, i : i + 1], 0.01, "y"))


MODELS = {
    "third order": ([2.0, 1.0], [0.001, 0.08, 1.3, 4.0]),
    "accelerometer": ([(2 * np.pi * 50) ** 2], [1.0, 0.7 * 2 * np.pi * 50, (2 * np.pi * 50) ** 2]),
    "lead": ([3.0, 0.0, 1.0], [1.0, 2.0, 5.0]),
}


@pytest.mark.parametrize("name", MODELS)
def test_transfer_function(rng, name):
    numerator, denominator = MODELS[name]
    u = rng.normal(size=(300, 1))
    sensor = transfer_function((numerator, denominator))
    matrices = signal.tf2ss(numerator, denominator)
    y, expected = trace(sensor, u, 0.01, "y"), held(*matrices, u, 0.01)
    D = matrices[3]
    expected = expected + (u - np.vstack([np.zeros((1, 1)), u[:-1]])) @ D.T  # driven with u_k at t_k
    assert np.abs(y - expected).max() < EXACT * np.abs(expected).max()


def test_against_lsim(rng):
    """SciPy's own simulation of the thesis' sensor with held inputs (interp=False)."""
    u, h = rng.normal(size=(200, 1)), 0.01
    model = signal.TransferFunction([1.0], [0.008**2, 0.016, 1.0])
    _, expected, _ = signal.lsim(model, u[:, 0], np.arange(200) * h, interp=False)
    y = trace(transfer_function(model), u, h, "y")[:, 0]
    assert np.abs(y - expected).max() < EXACT * np.abs(expected).max()


def test_takes_a_model_of_control(rng):
    import control

    pair = ([2.0, 1.0], [0.001, 0.08, 1.3, 4.0])
    model = control.tf(*pair)
    u = rng.normal(size=(40, 1))
    assert np.array_equal(
        trace(transfer_function(model), u, 0.01, "y"), trace(transfer_function(pair), u, 0.01, "y")
    )
    x = trace(transfer_function(control.ss(model)), u, 0.01, "y")
    assert np.allclose(x, trace(transfer_function(pair), u, 0.01, "y"), rtol=0, atol=1e-12)
    with pytest.raises(DeclarationError, match="discrete"):
        transfer_function(control.tf(*pair, 0.01))
    with pytest.raises(DeclarationError, match="one input and one output"):
        transfer_function(control.append(model, model))


def test_control_is_not_imported_for_it():
    """It takes three seconds."""
    import subprocess
    import sys

    code = "import cosim.blocks, sys; sys.exit('control' in sys.modules or 'scipy.signal' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_state_space_of_any_size(rng):
    """Two inputs, three outputs, four states: a transposed matrix would not fit."""
    A, B, C, D = (rng.normal(size=s) for s in ((4, 4), (4, 2), (3, 4), (3, 2)))
    A -= 3.0 * np.eye(4)
    u = rng.normal(size=(200, 2))
    expected = held(A, B, C, D, u, 0.02) + (u - np.vstack([np.zeros((1, 2)), u[:-1]])) @ D.T
    assert (
        np.abs(trace(StateSpace(A, B, C, D), u, 0.02, "y") - expected).max() < EXACT * np.abs(expected).max()
    )


def test_strictly_proper_has_no_direct_path():
    """So that a loop through it is not algebraic under stage coupling."""
    proper = transfer_function(([1.0], [1.0, 2.0, 1.0]))
    assert isinstance(proper, StrictlyProper)
    assert dependencies(proper)["y"] == {"x"}
    direct = transfer_function(([1.0, 0.0], [1.0, 2.0]))
    assert isinstance(direct, StateSpace)
    assert dependencies(direct)["y"] == {"x", "u"}


@pytest.mark.parametrize(
    ("model", "text"),
    [
        (([1.0, 0.0, 0.0], [1.0, 1.0]), "degree 2 is above the denominator's 1"),
        (([1.0], [0.0]), "denominator is zero"),
        (([2.0], [4.0]), "constant factor"),
        (([1.0, np.inf], [1.0, 1.0, 1.0]), "finite coefficients"),
        (([[1.0], [2.0, 3.0]], [1.0, 1.0]), "one input and one output"),
    ],
)
def test_refuses(model, text):
    with pytest.raises(DeclarationError, match=text):
        transfer_function(model)
