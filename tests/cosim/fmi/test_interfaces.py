"""Options of the interfaces: those that exclude each other cannot be written."""

from __future__ import annotations

import pytest

from cosim import CoSimulation, FMUError, ModelExchange
from cosim.fmi.interfaces import interface_of


def test_options_that_exclude_each_other():
    for options, words in [
        ({"solver": "cvod"}, "solver 'cvod' is not known; did you mean 'cvode'"),
        ({"solver": "cvode", "substeps": 2}, 'substeps belong to .* solver="cvode" chooses its own'),
        ({"solver": "ode4", "tolerance": 1e-3}, 'tolerance belongs to solver="cvode", and ode4 has fixed'),
        ({"tolerance": 0.0}, r"tolerance=0\.0 must be a number from 1e-14 to 1"),
        ({"solver": "ode4", "substeps": 0}, "substeps=0 must be a whole number"),
        ({"solver": "ode4", "substeps": 2.5}, r"substeps=2\.5 must be a whole number"),
    ]:
        with pytest.raises(FMUError, match=words):
            ModelExchange(**options)


def test_the_solver_that_is_used_if_none_is_given():
    assert ModelExchange(substeps=2).resolved(has_indicators=False) == ModelExchange("ode4", 2)
    assert ModelExchange(tolerance=1e-8).resolved(True) == ModelExchange("cvode", tolerance=1e-8)
    with pytest.raises(FMUError, match="substeps belong to"):
        ModelExchange(substeps=2).resolved(has_indicators=True)


def test_flat_options_choose_their_interface():
    """As the command line and SSP files give them."""
    assert interface_of("x", None) is None
    assert interface_of("x", None, solver="ode2", substeps=3) == ModelExchange("ode2", 3)
    assert interface_of("x", None, event_mode=True) == CoSimulation(True)
    for name, options, words in [
        ("CoSimulation", {"substeps": 2}, "substeps belongs to ModelExchange, and CoSimulation, .* is used"),
        ("ModelExchange", {"event_mode": True}, "event_mode belongs to CoSimulation, and ModelExchange"),
        (None, {"event_mode": True, "solver": "ode2"}, "event_mode belongs to CoSimulation"),
    ]:
        with pytest.raises(FMUError, match=words):
            interface_of("x", name, **options)
