"""Declarations that an instance resolves: units by name, default sizes, whole parameters."""

from __future__ import annotations

import pytest

from cosim import Block, Continuous, DeclarationError, Input, Output, Parameter, State
from cosim.blocks import LowPass


class Spring(Continuous):
    """F = k x, with a state that follows the displacement."""

    DEFAULT_SIZES = {"n": 2}

    k = Parameter(1.0, "stiffness", unit="$force/($length)", shape="n")
    x = Input("displacement", unit="$length", shape="n")
    z = State(0.0, "displacement, late", unit="$length", shape="n")
    F = Output("force", unit="$force", shape="n")

    def derivatives(self, t):
        for i in range(self.z.shape[0]):
            self.der_z[i] = self.x[i] - self.z[i]


def units(spring):
    return {name: spring.variables[name].unit for name in ("k", "x", "z", "der_z", "F")}


def test_units_are_resolved_by_keyword():
    given = units(Spring(force="kN", length="mm"))
    assert given == {"k": "kN/(mm)", "x": "mm", "z": "mm", "der_z": "(mm)/s", "F": "kN"}
    assert units(Spring(force="N")) == {"k": None, "x": None, "z": None, "der_z": None, "F": "N"}
    assert set(units(Spring()).values()) == {None}
    assert Spring(force="N").ports("output")["F"].unit == "N"


def test_two_instances_have_units_of_their_own():
    one, other = LowPass(0.1, unit="N"), LowPass(0.1, unit="m/s^2")
    assert (one.variables["y"].unit, other.variables["y"].unit) == ("N", "m/s^2")
    assert one.fresh().variables["der_y"].unit == "(N)/s"


def test_a_default_size_gives_way():
    assert [Spring(**given).x.shape for given in ({}, {"n": 3}, {"n": None}, {"k": [1.0, 2.0, 3.0]})] == [
        (2,),
        (3,),
        (2,),
        (3,),
    ]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"force": 3}, r"Spring: force=3 must be a unit, such as 'N'"),
        ({"forse": "N"}, r"no parameter or variable 'forse'; did you mean 'force'"),
        ({"n": 2.5}, r"Spring: size n=2\.5 must be a whole number, 1 or more"),
        ({"n": 3, "k": [1.0, 2.0]}, r"Spring\.k: shape \(2,\) does not fit \('n',\): n is 3, not 2"),
    ],
)
def test_what_does_not_fit_is_refused(given, words):
    with pytest.raises(DeclarationError, match=words):
        Spring(**given)


def test_a_name_of_a_unit_names_nothing_else():
    with pytest.raises(DeclarationError, match="'u' names a unit and something else"):

        class Wrong(Block):
            u = Input(unit="$u")

            def step(self, t, h):
                pass


def test_a_whole_parameter_stays_whole():
    class Counted(Block):
        """A parameter without fractions."""

        bits = Parameter(8.0, whole=True)

        def step(self, t, h):
            pass

    counted = Counted(bits=12)
    with pytest.raises(DeclarationError, match=r"Counted\.bits = 2\.5 must be a whole number"):
        counted.bits = 2.5
    assert counted.bits == 12.0
