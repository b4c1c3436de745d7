"""The gain laws of chapter 4: step by step against plain transcriptions, and same bits compiled."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers.laws.algorithm_1 import AlgorithmI
from controllers.laws.algorithm_2 import AlgorithmII
from controllers.laws.constant_gain import ConstantGain
from controllers.laws.equivalent_control import EquivalentControlGain
from controllers.laws.phase_plane_surface import PhasePlaneSurface
from controllers.laws.state_dependent import StateDependentGain
from controllers.laws.switching import HysteresisControl, SaturationControl
from cosim import System, WiringError
from cosim.units import definition
from fmus.plants.oscillator import Oscillator
from tests.cosim.blocks.drive import assert_same_bits, trace

LAWS = {
    "constant": ConstantGain,
    "algorithm 1": AlgorithmI,
    "algorithm 2": AlgorithmII,
    "state dependent": StateDependentGain,
    "equivalent control": EquivalentControlGain,
    "saturation": lambda: SaturationControl(gamma=0.5),
    "saturation, scaled": lambda: SaturationControl(gamma=0.5, scaled=1.0),
    "hysteresis": lambda: HysteresisControl(width=0.5),
}
#: values of s with zeros among them
signs = st.lists(st.sampled_from([-2.0, -0.3, 0.0, 0.3, 2.0]), min_size=1, max_size=40)


@pytest.mark.parametrize("name", LAWS)
def test_interpreted_is_compiled(rng, name):
    law = LAWS[name]()
    inputs = rng.normal(size=(80, law.zones["input"][1]))
    inputs[::7] = 0.0
    assert_same_bits(law, inputs, 0.01)


@pytest.mark.parametrize("name", LAWS)
@settings(max_examples=25)
@given(values=signs)
def test_force_opposes_s_with_the_gain(name, values):
    """(4.4): u has the sign opposite to s and at most the magnitude M; outside layers and loops, M itself."""
    law = LAWS[name]()
    s = np.array(values)
    inputs = s[:, None] if law.zones["input"][1] == 1 else np.column_stack([0.4 * s, 0.2 * s, s])
    u, M, sgn = (trace(law, inputs, 0.01, port)[:, 0] for port in ("u", "M", "sgn"))
    assert np.array_equal(sgn, np.sign(s))
    large = np.abs(s) > 0.5
    assert np.array_equal(u[large], -(M * np.sign(s))[large])
    assert (np.abs(u) <= M).all()


@pytest.mark.parametrize("name", LAWS)
def test_u_and_M_are_forces_unless_a_unit_is_given(name):
    """So a law cannot be wired to an acceleration by mistake; around a model of accelerations it says so."""
    kind = type(LAWS[name]())
    for options, unit in (({}, "N"), ({"unit": "m/s^2"}, "m/s^2")):
        variables = kind(**options).variables
        assert {variables[port].unit for port in ("u", "M")} == {unit}
    with pytest.raises(WiringError, match=r"N.*m/s\^2"):
        System({"law": kind(), "plant": Oscillator()}, [("law.u", "plant.d")])


def test_rates_of_algorithm_2_follow_its_unit():
    variables = AlgorithmII(unit="m/s^2").variables
    assert definition(variables["alpha"].unit) == definition(variables["beta"].unit) == definition("m/s^3")


def switches(s):
    """Indices where the sign is strictly opposite to the last one that was not 0."""
    found, last = [], 0.0
    for i, g in enumerate(np.sign(s)):
        if g * last < 0:
            found.append(i)
        last = g or last
    return found


@given(signs)
def test_algorithm_1(values):
    """M(i) = M(0) / rate^(number of switches), not below the floor; 1e-15 a division."""
    s = np.array(values)
    M = trace(AlgorithmI(M=3.0), s[:, None], 0.01, "M")[:, 0]
    count = np.searchsorted(switches(s), np.arange(len(s)), side="right")
    assert np.allclose(M, np.maximum(3.0 / 1.1**count, 1.0), rtol=1e-14)


@given(signs)
def test_algorithm_2(values):
    """The thesis' steps 1 to 4, with limits that both act."""
    s = np.array(values)
    law = AlgorithmII(M=4.0, M1=3.5, M2=4.5)
    M, h, flips = 4.0, 0.01, set(switches(s))
    expected = []
    for i in range(len(s)):
        M = M + 10.0 * h - (300.0 * h if i in flips else 0.0)
        M = min(max(M, 3.5), 4.5)
        expected.append(M)
    assert np.allclose(trace(law, s[:, None], h, "M")[:, 0], expected, rtol=1e-14)


def test_start_and_zero_are_no_switches():
    """0 to 1 is the start; 1, 0, 1 is none; 1, 0, -1 is one, at the -1."""
    s = np.array([0.0, 1.0, 0.0, 1.0, 0.0, -1.0, -1.0])
    M = trace(AlgorithmI(rate=2.0), s[:, None], 0.01, "M")[:, 0]
    assert M.tolist() == [100, 100, 100, 100, 100, 50, 50]


def test_phase_plane_surface():
    """(4.1): s = x2 + a x1, a on the displacement."""
    assert trace(PhasePlaneSurface(a=3.0), np.array([[2.0, 5.0]]), 0.01, "s")[0, 0] == 11.0


def test_saturation_as_printed_and_continuous():
    s = np.array([[-1.0], [-0.2], [0.1], [0.25], [0.5]])
    printed = trace(SaturationControl(M_0=10.0, gamma=0.25), s, 0.01, "u")[:, 0]
    scaled = trace(SaturationControl(M_0=10.0, gamma=0.25, scaled=1.0), s, 0.01, "u")[:, 0]
    assert printed.tolist() == [10.0, 2.0, -1.0, -10.0, -10.0]
    assert scaled.tolist() == [10.0, 8.0, -4.0, -10.0, -10.0]


def test_hysteresis_keeps_its_side():
    s = np.array([[0.1], [-0.4], [-0.6], [-0.1], [0.5], [0.51], [-0.5]])
    u = trace(HysteresisControl(M_0=1.0, width=0.5), s, 0.01, "u")[:, 0]
    assert u.tolist() == [-1.0, -1.0, 1.0, 1.0, 1.0, -1.0, -1.0]


def test_state_dependent_gain():
    """x = (3, 4): |x| = 5."""
    row = np.array([[3.0, 4.0, -1.0]])
    assert trace(StateDependentGain(M_0=2.0, delta=0.5), row, 0.01, "M")[0, 0] == 11.0
    assert trace(StateDependentGain(M_0=2.0, delta=0.5), row, 0.01, "u")[0, 0] == 11.0


def test_equivalent_control_average():
    """The signs of the calls before, each held for h: tau z' + z = sgn s in closed form.

    One sample's shift would leave z = 1 for one call longer.
    """
    s = np.array([1.0, -1.0, -1.0, 1.0, 1.0])
    law = EquivalentControlGain(M_0=10.0, delta=0.5, tau=0.02)
    z = trace(law, s[:, None], 0.01, "z")[:, 0]
    d = np.exp(-0.5)
    a = 1.0
    expected = [a]
    for g in s[:-1]:
        a = d * a + (1 - d) * g
        expected.append(a)
    assert np.allclose(z, expected, rtol=0, atol=1e-14)  # t_i - t_{i-1} is 0.01 to 1e-17
    M = trace(law, s[:, None], 0.01, "M")[:, 0]
    assert np.allclose(M, 10.0 * (np.abs(expected) + 0.5), rtol=1e-14)


def test_equivalent_control_average_does_not_depend_on_the_rate():
    """A sign that stays: z = 1 - 2 (1 - e^(-t/tau)) after 1 s of -1, at any interval of calls."""
    for h in (0.5, 0.1, 0.01):
        n = round(1.0 / h) + 1
        z = trace(EquivalentControlGain(tau=0.4), np.full((n, 1), -1.0), h, "z")[-1, 0]
        assert z == pytest.approx(1.0 - 2.0 * (1.0 - np.exp(-2.5)), abs=1e-13)
