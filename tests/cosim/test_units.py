"""Units: which texts are units, and conversion by names and by the definitions of a file."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import WiringError
from cosim.units import Definition, conversion, definition, parse

FORCE = (1, 1, -2, 0, 0, 0, 0, 0)
MASS = (1, 0, 0, 0, 0, 0, 0, 0)
LENGTH = (0, 1, 0, 0, 0, 0, 0, 0)
PER_SECOND = (0, 0, -1, 0, 0, 0, 0, 0)
RADIANS_PER_SECOND = (0, 0, -1, 0, 0, 0, 0, 1)


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("m/s2", "m/s^2"),
        ("m.s-2", "m/s^2"),
        ("m/s/s", "m/s^2"),
        ("m/s²", "m/s^2"),
        ("m * s**(-2)", "m/s^2"),
        ("kg m s-2", "N"),
        ("kg.m-1.s-2", "Pa"),
        ("N·m", "N*m"),
        ("(m/s)^2/m", "m/s^2"),
        ("((N))/(s)", "N/s"),
        ("g_0", "standard_gravity"),
        ("µm", "micrometer"),
        ("m^0.5", "m^(0.5)"),
        ("°C", "degC"),
        ("-", "1"),
    ],
)
def test_spellings_of_one_unit(text, same):
    assert (parse(text) / parse(same)).dimensionless
    assert conversion(text, same)[0] == pytest.approx(1.0, rel=1e-15)


WRONG = [
    "m,s",
    "m!",
    "~m",
    "m#kg",
    "m=s",
    "m'",
    "2*m",
    "10",
    "m*",
    "/m",
    "(m",
    "m)",
    "m^",
    "m()",
    "m^2^3",
    "m;s",
]
#: each took pint minutes, or all memory
BOMBS = ["m^9^9^9", "9**9**9**9*m", "m" * 100_000, "m*" * 100_000 + "m", "(" * 5_000 + "m" + ")" * 5_000]


@pytest.mark.parametrize("text", WRONG + BOMBS, ids=lambda text: text[:12])
def test_a_text_that_is_not_a_unit_is_refused(text):
    with pytest.raises(
        WiringError, match=r"^unit '.{1,103}' is not known; write it as pint or FMI do"
    ) as error:
        parse(text)
    assert len(str(error.value)) < 250


@given(st.text(alphabet="mskgN^*/.() 12-_%°", max_size=30))
def test_any_text_is_a_unit_or_a_cosim_error(text):
    for other in ("m", text[::-1]):
        try:
            scale, offset = conversion(text, other)
        except WiringError:
            continue
        assert math.isfinite(scale)
        assert math.isfinite(offset)


def test_a_factor_that_no_float_holds_is_refused():
    with pytest.raises(WiringError, match="too large or too small"):
        conversion("km^99*km^99", "m^99*m^99")
    with pytest.raises(WiringError, match="too large or too small"):
        definition("km^99*km^99")


@pytest.mark.parametrize(
    ("unit", "words"),
    [
        ("bit", "unit 'bit' is made of 'bit', for which FMI has no base unit"),
        ("m^0.5", r"unit 'm\^0\.5' has the power 0\.5 of meter; FMI has whole powers only"),
    ],
)
def test_units_that_have_no_definition_in_fmi(unit, words):
    with pytest.raises(WiringError, match=words):
        definition(unit)


@pytest.mark.parametrize(
    ("source", "given_source", "target", "given_target", "wanted"),
    [
        ("force_unit", Definition(FORCE), "N", None, (1.0, 0.0)),
        ("force_unit", Definition(FORCE, 250.0), "kN", None, (0.25, 0.0)),
        ("kN", None, "force_unit", Definition(FORCE, 250.0), (4.0, 0.0)),
        ("ton", Definition(MASS, 1000.0), "kg", None, (1000.0, 0.0)),  # to pint a short ton
        ("mm", Definition(LENGTH), "m", None, (1.0, 0.0)),  # to pint a thousandth
        ("ton", Definition(MASS, 1000.0), "ton", Definition(MASS, 500.0), (2.0, 0.0)),
        ("ton", Definition(MASS, 1000.0), "ton", None, (1.0, 0.0)),  # one name, one unit
        ("chilly", Definition((0, 0, 0, 0, 1, 0, 0, 0), 2.0, 200.0), "K", None, (2.0, 200.0)),
        ("rad/s", Definition(PER_SECOND), "rad/s", Definition(RADIANS_PER_SECOND), (1.0, 0.0)),
    ],
)
def test_definitions_count_more_than_names(source, given_source, target, given_target, wanted):
    assert conversion(source, target, given_source, given_target) == wanted


@pytest.mark.parametrize(
    ("source", "target"),
    [("kN", "N"), ("deg", "rad"), ("degC", "K"), ("1/min", "1/s"), ("t", "kg"), ("mm/s", "m/s")],
)
def test_a_definition_that_says_what_the_name_says_changes_no_bit(source, target):
    by_name = conversion(source, target)
    assert conversion(source, target, definition(source), None) == by_name
    assert conversion(source, target, definition(source), definition(target)) == by_name


@pytest.mark.parametrize(
    ("source", "given_source", "target", "words"),
    [
        (
            "force_unit",
            Definition(FORCE),
            "m",
            r"'force_unit' \(kg m s\^-2\) is not convertible to 'm' \(m\)",
        ),
        ("nil", Definition(FORCE, 0.0), "N", "'nil' is defined with the factor 0.0"),
        ("inf", Definition(FORCE, math.inf), "N", "'inf' is defined with the factor inf"),
        ("Hz", Definition(PER_SECOND), "rad/s", "Hz counts cycles"),
        (
            "beat",
            Definition(PER_SECOND),
            "rad/s",
            r"'beat' \(s\^-1\) is not convertible to 'rad/s' \(s\^-1 rad\)",
        ),
        ("force_unit", Definition(FORCE), "gizmo", "unit 'gizmo' is not known"),
    ],
)
def test_definitions_that_do_not_fit_are_refused(source, given_source, target, words):
    with pytest.raises(WiringError, match=words):
        conversion(source, target, given_source, None)
