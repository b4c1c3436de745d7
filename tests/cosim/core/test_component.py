"""The contract of a component: kept by every kind, and enough for a system."""

from __future__ import annotations

import pytest

from cosim import FMU, System, WiringError
from cosim.core.component import Component
from cosim.core.port import Port
from tests.cosim.fmi.probe import probe
from tests.cosim.parts import Gain, Mass


class Pipe:
    """A component of a kind that cosim does not define."""

    as_block = True
    every = None
    sample_period = None
    declared_outputs = ("out",)

    def ports(self, direction):
        number = Port("", "in", unit="kN") if direction == "input" else Port("", "out", (3,), "N", count=3)
        text = Port("", f"text_{direction}", kind="String")
        words = Port("", f"words_{direction}", (2,), kind="String", count=2)
        return {port.name: port for port in (number, text, words)}


def test_every_kind_keeps_the_contract(tmp_path):
    for component in (Gain(), Mass(), FMU(probe(tmp_path / "p.fmu", "3.0")), Pipe()):
        assert isinstance(component, Component)
        for direction in ("input", "output"):
            for port in component.ports(direction).values():
                assert (port.participant, port.first, port.count) == ("", 0, port.size)
        assert set(component.declared_outputs) <= component.ports("output").keys()
    assert (Gain().as_block, Mass().as_block) == (True, False)


def test_a_system_knows_no_kinds():
    system = System({"mass": Mass(), "a": Pipe(), "b": Pipe()})
    system.connect("a.out[2]", "b.in")
    assert system.connections[0].scale == 1e-3
    assert str(system.connections[0].source) == "a.out[2]"
    assert system.block_order() == ["a", "b"]
    with pytest.raises(WiringError, match=r"algebraic cycle: .*b\.text_output -> a\.text_input"):
        system.connect("b.text_output", "a.text_input")
    assert system.text_connections == []
    with pytest.raises(WiringError, match=r"b\.text_output is a String and a\.in is a number"):
        system.connect("b.text_output", "a.in")
    with pytest.raises(WiringError, match=r"b\.words_output is an array of type String; only single values"):
        system.connect("b.words_output", "a.text_input")
    with pytest.raises(WiringError, match=r"transformation \(inf, 0\.0\) must be finite"):
        system.connect("mass.x", "a.in", transformation=(float("inf"), 0.0))


@pytest.mark.parametrize("what", [Gain, 3, None, object()])
def test_what_breaks_the_contract_is_refused(what):
    with pytest.raises(WiringError, match="cannot take part in a system; give"):
        System({"a": what})
