"""Mistakes in a law that its compiled form would not report are refused before it runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim import DeclarationError
from fmus.elements.at_rest import check_at_rest
from fmus.elements.column_segment import column_segment
from fmus.elements.element import OWN, Element
from fmus.elements.viscous import viscous
from fmus.plants.nonlinear_structure import NonlinearStructure
from fmus.structures.structure import Structure

SEGMENT = column_segment(np.eye(2), 3.4e4, -2.3e4, 2.1e4, 420.0, 50.0)


def spring(e, d, d0, rate, h, p, z0, z):
    return p[e, 0] * d, p[e, 0], 0.5 * p[e, 0] * d**2, 0.0


def three_values(e, d, d0, rate, h, p, z0, z):
    return p[e, 0] * d, p[e, 0], 0.0


def one_value(e, d, d0, rate, h, p, z0, z):
    return p[e, 0] * d


def fifth_parameter(e, d, d0, rate, h, p, z0, z):
    return p[e, 0] * d, p[e, 4], 0.0, 0.0


def forgotten_memory(e, d, d0, rate, h, p, z0, z):
    z[e, OWN + 1] = d
    return p[e, 0] * d, p[e, 0], 0.0, 0.0


def undefined_name(e, d, d0, rate, h, p, z0, z):
    force = stiffness * d  # noqa: F821
    return force, p[e, 0], 0.0, 0.0


def divided_by_zero(e, d, d0, rate, h, p, z0, z):
    return p[e, 0] * d, 1.0 / d, 0.0, 0.0


def not_a_number(e, d, d0, rate, h, p, z0, z):
    force = p[e, 0] * d
    return force, force / d, 0.0, 0.0


def too_few_arguments(e, d, d0, p, z0, z):
    return p[e, 0] * d, p[e, 0], 0.0, 0.0


def pair_of_four(e, d, d0, p, z0, z, force, tangent, coupling):
    tangent[:], coupling[e] = p[e, 0], p[e, 1]
    return force, tangent, 0.0, 0.0


def stiff_second_row(*arguments):
    energies = SEGMENT.law(*arguments)
    arguments[-2][1] += 1.0  # the tangent
    return energies


def line_of(law, offset):
    return rf"test_at_rest.py, line {law.__code__.co_firstlineno + offset}$"


@pytest.mark.parametrize(
    ("law", "message", "line"),
    [
        (three_values, "must return force, tangent, stored, lost, .* is 3; see", 0),
        (one_value, "must return force, tangent, stored, lost, .* is 1; see", 0),
        (fifth_parameter, "IndexError: index 4 .* p has 1 places.* correct the index, parameters or", 1),
        (forgotten_memory, "IndexError: index 3 .* z has 3, the first 2 and memory = 1 ", 1),
        (undefined_name, "NameError: name 'stiffness' is not defined; define the name in the law", 1),
        (divided_by_zero, "ZeroDivisionError: .*; the law must be defined at rest", 1),
        (not_a_number, "k0 = 5, but the law has the tangent nan at rest", 0),
        (too_few_arguments, "TypeError: .* takes 6 positional arguments but 8 were given", 0),
    ],
)
def test_a_law_that_fails_at_rest_is_refused_with_its_line(law, message, line):
    element = Element(law, np.ones(1), (5.0,), k0=5.0, scale=0.1)
    with pytest.raises(DeclarationError, match=message) as error:
        check_at_rest(element, "element 0")
    assert str(error.value).startswith(f"element 0 ({__name__}.{law.__name__}): ")
    error.match(line_of(law, line))


def test_k0_must_be_the_tangent_at_rest_to_one_in_a_million():
    right = Element(spring, np.ones(1), (5e6,), k0=5e6, scale=0.1)
    check_at_rest(right, "element 0")
    check_at_rest(replace(right, k0=5e6 * (1.0 + 1e-7)), "element 0")
    for wrong in (0.0, -5e6, 5e6 * (1.0 + 1e-5)):
        with pytest.raises(DeclarationError, match=r"but the law has the tangent 5000000 at rest \(d = 0\)"):
            check_at_rest(replace(right, k0=wrong), "element 0")


def test_a_damper_has_no_tangent_at_rest():
    """Its tangent 2/h times the slope vanishes in a long step, even from the slope of rate0 = 1 um/s."""
    damper = viscous(np.ones(1), 2e6, 0.2, 1e-6)
    check_at_rest(damper, "element 0")
    with pytest.raises(DeclarationError, match="k0 = 1, but the law has the tangent"):
        check_at_rest(replace(damper, k0=1.0), "element 0")


@pytest.mark.parametrize("field", ["k0", "k0_coupling"])
def test_a_law_of_two_rows_is_checked_in_both_and_between_them(field):
    check_at_rest(SEGMENT, "element 0")
    with pytest.raises(DeclarationError, match=f": {field} = 1, but the law has the tangent"):
        check_at_rest(replace(SEGMENT, **{field: 1.0}), "element 0")
    with pytest.raises(DeclarationError, match=r": k0 = 34000, .* the tangent 34001 at rest"):
        check_at_rest(replace(SEGMENT, law=stiff_second_row), "element 0")
    with pytest.raises(DeclarationError, match=r"must return stored, lost, .* is 4"):
        check_at_rest(replace(SEGMENT, law=pair_of_four), "element 0")
    with pytest.raises(DeclarationError, match=r"IndexError: index 3 .* z has 3, "):
        check_at_rest(replace(SEGMENT, memory=1), "element 0")


def test_a_structure_names_the_element_that_it_refuses():
    """Before K is tested for the initial tangents, which would be blamed on K."""
    structure = Structure(np.eye(1), np.zeros((1, 1)), np.array([[9.0]]), np.ones(1))
    right = Element(spring, np.ones(1), (4.0,), k0=4.0, scale=0.1)
    with pytest.raises(DeclarationError, match=r"^element 1 \(.*\.spring\): k0 = 50, "):
        NonlinearStructure.build(structure, [right, replace(right, k0=50.0)])
    assert len(NonlinearStructure.build(structure, [right, right]).k0) == 2
