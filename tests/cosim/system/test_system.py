"""Connections: names, shapes, units, slices, cycles; and random wirings against plain Python."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import Block, CosimError, Input, Output, Parameter, System, WiringError, schedule, simulate
from tests.cosim.parts import Gain, Mass, Ramp, Three


def value_of(system: System, port: str):
    result = simulate(system, step=1.0, stop=1.0, record=[port])
    return result[port][0].tolist()


def test_elements_and_slices_count_from_one():
    system = System({"a": Three(), "b": Three(), "g": Gain(K=1.0)})
    system.connect("a.y[3]", "b.x[1]")
    system.connect("a.y[1:2]", "b.x[2:3]")
    system.connect("a.M[2,1]", "g.x")
    assert value_of(system, "b.y") == [301.0, 21.0, 320.0]
    assert value_of(system, "g.u") == 4.0
    assert value_of(system, "a.y[2:3]") == [20.0, 300.0]
    assert value_of(system, "a.M") == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]


def test_a_scalar_feeds_every_element_an_array_only_its_like():
    system = System({"ramp": Ramp(), "b": Three()}, [("ramp.u", "b.x")])
    assert value_of(system, "b.y") == [3.0, 22.0, 302.0]
    with pytest.raises(WiringError, match=r"a\.y has shape \(3,\), b\.x\[1:2\] has shape \(2,\)"):
        System({"a": Three(), "b": Three()}, [("a.y", "b.x[1:2]")])


WRONG = [
    ("plnt.x", "g.x", r"the system has no component 'plnt'; did you mean 'plant'"),
    ("plant.xx", "g.x", r"plant has no output 'xx'.*available: a, x, v"),
    ("a.acel", "g.x", r"a has no output 'acel'; did you mean 'accel'"),
    (None, "g.x", r"None must be a port, written as text: 'component\.port'"),
    ("plant.x", 1, r"1 must be a port"),
    ("plant", "g.x", r"'plant' is not a port; write component.port"),
    ("plant.u", "g.x", r"plant.u is an input, not an output"),
    ("plant.x", "g.u", r"g.u is an output, not an input"),
    ("plant.m", "g.x", r"plant has no output 'm'"),
    ("a.y[0]", "g.x", r"elements count from 1"),
    ("a.y[4]", "g.x", r"outside shape \(3,\)"),
    ("a.y[3:2]", "g.x", r"outside shape"),
    ("a.y[1,1]", "g.x", r"cannot index shape \(3,\)"),
    ("a.M[2]", "g.x", r"cannot index shape \(2, 3\)"),
    ("a.M[3,1]", "g.x", r"outside shape"),
    ("a.y[-1]", "g.x", r"cannot index"),
    ("a.y[1", "g.x", r"cannot index"),
    ("plant.x[1]", "g.x", r"cannot index shape \(\)"),
    ("a.y", "g.x", r"a.y has shape \(3,\), g.x has shape \(\)"),
]


@pytest.mark.parametrize(("source", "target", "words"), WRONG)
def test_wrong_connections_say_where_what_and_the_remedy(source, target, words):
    system = System({"plant": Mass(), "a": Three(), "g": Gain()})
    with pytest.raises(WiringError, match=words):
        system.connect(source, target)
    assert system.connections == []


def test_a_system_that_is_not_one_is_refused():
    with pytest.raises(WiringError, match=r"'plant\.fmu' must be a System"):
        simulate("plant.fmu", step=0.1, stop=1.0)
    with pytest.raises(WiringError, match="must be a System"):
        schedule(None, step=0.1)
    with pytest.raises(WiringError, match="must be a dictionary of components"):
        System([Mass()])
    with pytest.raises(WiringError, match=r"\('m\.x',\) must be a connection, such as"):
        System({"m": Mass()}, [("m.x",)])
    with pytest.raises(WiringError, match=r"transformation=3 must be two numbers, \(factor, offset\)"):
        System({"m": Mass(), "g": Gain()}).connect("m.x", "g.x", transformation=3)


def test_an_input_has_one_source():
    system = System({"a": Three(), "b": Three(), "ramp": Ramp()}, [("a.y[1:2]", "b.x[2:3]")])
    with pytest.raises(WiringError, match=r"b\.x is already connected to a\.y\[1:2\]"):
        system.connect("ramp.u", "b.x")
    with pytest.raises(WiringError, match=r"b\.x\[3\] is already connected"):
        system.connect("ramp.u", "b.x[3]")
    system.connect("ramp.u", "b.x[1]")


def test_a_cycle_of_blocks_is_a_path_and_the_system_stays_as_it_was():
    system = System({"a": Gain(), "b": Gain(), "c": Gain()}, [("a.u", "b.x"), ("b.u", "c.x")])
    with pytest.raises(WiringError, match=r"algebraic cycle: .*a\.u -> b\.x, b\.u -> c\.x.*initial="):
        system.connect("c.u", "a.x")
    system.connect("c.u", "a.x", initial=1.5)
    result = simulate(system, step=1.0, stop=2.0)
    assert result["a.u"].tolist() == [-3.0, 24.0, -192.0]  # times -2, then (-2)^3 a step
    with pytest.raises(WiringError, match=r"a\.u -> a\.x"):
        System({"a": Gain()}, [("a.u", "a.x")])


@pytest.mark.parametrize("value", [[1.0, 2.0], math.nan, "text", [[1.0, 2.0], [3.0]]])
def test_an_initial_value_that_does_not_fit_is_refused(value):
    system = System({"a": Three(), "b": Three()})
    with pytest.raises(WiringError, match=r"does not fit a\.y: give 3 finite"):
        system.connect("a.y", "b.x", initial=value)


def wire(unit_out: str | None, unit_in: str | None) -> float:
    class Source(Block):
        y = Output(unit=unit_out)

        def step(self, t, h):
            self.y = 2.5

    class Sink(Block):
        x = Input(unit=unit_in)
        y = Output()

        def step(self, t, h):
            self.y = self.x

    return value_of(System({"a": Source(), "b": Sink()}, [("a.y", "b.x")]), "b.y")


@pytest.mark.parametrize(
    ("source", "target", "wanted"),
    [
        ("kN", "N", 2500.0),
        ("N", "kN", 0.0025),
        ("g_0", "m/s^2", 2.5 * 9.80665),
        ("m/s2", "g_0", 2.5 / 9.80665),
        ("deg", "rad", math.radians(2.5)),
        ("degC", "K", 275.65),
        ("degF", "degC", (2.5 - 32.0) / 1.8),
        ("N.m", "kN*m", 0.0025),
        ("kN*s/m", "N.s/m", 2500.0),
        ("kg.m-1.s-2", "Pa", 2.5),
        ("mm", None, 2.5),
        (None, "mm", 2.5),
        ("1", "%", 250.0),
    ],
)
def test_units_are_converted(source, target, wanted):
    assert wire(source, target) == pytest.approx(wanted, rel=1e-13)  # a few roundings of factors and offsets


@pytest.mark.parametrize(
    ("source", "target", "words"),
    [
        ("N", "m", r"a\.y \[N\] -> b\.x \[m\]: 'N' .* is not convertible to 'm'"),
        ("g", "m/s^2", "not convertible"),  # the gram
        ("rad/s", "Hz", "Hz counts cycles"),
        ("Newton-ish", "N", "unit 'Newton-ish' is not known"),
    ],
)
def test_units_that_do_not_fit_are_refused(source, target, words):
    with pytest.raises(WiringError, match=words):
        wire(source, target)


@given(text=st.text(alphabet="ab.xyM[]:,0123 -é", max_size=14))
def test_any_text_is_a_port_or_a_cosim_error(text):
    system = System({"a": Three(), "b": Gain()})
    for direction in ("input", "output"):
        try:
            port = system.port(text, direction)
        except WiringError:
            continue
        assert str(port) == text
        assert 1 <= port.count <= math.prod(port.shape)
        assert 0 <= port.first <= math.prod(port.shape) - port.count


@given(a=st.integers(1, 3), b=st.integers(1, 3), shape=st.sampled_from(["y", "M"]))
def test_an_index_names_the_same_elements_as_numpy(a, b, shape):
    system = System({"a": Three()})
    if shape == "y" and a <= b:
        port = system.port(f"a.y[{a}:{b}]", "output")
        assert list(range(port.first, port.first + port.count)) == list(range(3))[a - 1 : b]
    elif shape == "M" and a <= 2:
        port = system.port(f"a.M[{a},{b}]", "output")
        assert np.arange(6).reshape(2, 3)[a - 1, b - 1] == port.first
        assert port.count == 1


class Node(Block):
    """y = c + 0.5 a - 0.25 b: exact in binary for few levels."""

    c = Parameter(0.0)
    a = Input(start=1.0)
    b = Input(start=-3.0)
    y = Output()

    def step(self, t, h):
        self.y = self.c + 0.5 * self.a - 0.25 * self.b + t


@settings(max_examples=40)
@given(data=st.data(), n=st.integers(1, 6))
def test_random_wirings_equal_a_plain_evaluation(data, n):
    """Any connections without a cycle, some one step late, in any order of insertion."""
    order = data.draw(st.permutations(range(n)))
    system = System({f"n{i}": Node(c=float(i + 1)) for i in order})
    sources: dict[tuple[int, str], tuple[int, bool]] = {}
    for i in range(n):
        for port in "ab":
            source = data.draw(st.none() | st.integers(0, n - 1))
            if source is None:
                continue
            late = source >= i or data.draw(st.booleans())
            sources[i, port] = (source, late)
            system.connect(f"n{source}.y", f"n{i}.{port}", initial=0.75 if late else None)
    result = simulate(system, step=0.5, stop=1.5)
    before = [0.75] * n
    for k in range(4):
        y = [0.0] * n
        for i in range(n):
            a, b = (
                start if (i, port) not in sources else (before if late else y)[source]
                for port, start in (("a", 1.0), ("b", -3.0))
                for source, late in [sources.get((i, port), (0, False))]
            )
            y[i] = (i + 1.0) + 0.5 * a - 0.25 * b + 0.5 * k
        before = y
        assert [result[f"n{i}.y"][k] for i in range(n)] == y


@pytest.mark.parametrize("name", ["", "a b", "1a", "a.b", None])
def test_component_names(name):
    with pytest.raises(CosimError, match="letters, digits and underscores"):
        System({name: Gain()})


def test_a_component_takes_part_once():
    gain = Gain()
    with pytest.raises(WiringError, match="'b' is the same object"):
        System({"a": gain, "b": gain})
    with pytest.raises(WiringError, match="already has a component 'a'"):
        System({"a": gain}).add("a", Gain())
