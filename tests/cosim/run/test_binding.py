"""Components of a system as running instances, and its connections as copies."""

from __future__ import annotations

import ctypes

import pytest

from cosim import Input, LinearContinuous, Output, State, System, WiringError, simulate
from cosim.core.component import Component
from cosim.core.port import Port
from cosim.loop.instance import Integrated, MakesInstance, Stepping
from cosim.run.binding import Binding
from cosim.run.kernel_instance import KernelInstance
from cosim.run.plan import RunPlan
from tests.cosim.parts import Gain, Mass


def bound(system: System, **options) -> Binding:
    return Binding(system, RunPlan(**{"step": 0.5} | options), [])


def floats(address: int, n: int) -> list[float]:
    return list((ctypes.c_double * n).from_address(address))


class Pair(LinearContinuous):
    """y = (x, 2 x)"""

    u = Input(shape=2)
    x = State(3.0)
    y = Output(shape=2)

    def derivatives(self, t):
        self.der_x = self.u[0] + self.u[1]

    def outputs(self, t):
        self.y[0] = self.x
        self.y[1] = 2.0 * self.x


def test_a_connection_is_one_copy_with_factor_offset_and_rate():
    system = System({"p": Pair(), "g": Gain(sample_period=1.5)})
    system.connect("p.y[2]", "g.x", transformation=(4.0, -1.0))
    system.connect("g.u", "p.u")  # a scalar for both elements
    binding = bound(system)
    (into_block,), (into_plant,) = binding.copies("g", 3), binding.copies("p")
    assert into_block.source == binding.instances["p"].address("y") + 8
    assert (into_block.factor, into_block.offset, into_block.every) == (4.0, -1.0, 3)
    assert into_block.line() == "g.x <- p.y[2] [* 4 + -1] (every 3)"
    assert (into_plant.count, into_plant.spread) == (2, True)
    assert binding.every == {"g": 3}
    assert binding.copies("p", without=[system.connections[1]]) == []


def test_a_delayed_connection_is_copied_from_its_memory_which_is_kept_and_passed_on():
    system = System({"p": Pair(), "g": Gain()}, [("g.u", "p.u")])
    system.connect("p.x", "g.x", initial=7.0)
    binding = bound(system)
    (memory,) = binding.memory
    (copy,), (keep,), (pass_on,) = binding.copies("g"), binding.keep, binding.pass_on
    assert floats(copy.source, 1) == [7.0]
    assert keep.source == binding.instances["p"].address("x")
    assert (keep.target, pass_on.target) == (memory[1].ctypes.data, copy.source)
    assert pass_on.source == keep.target


def test_an_instance_has_storage_of_its_own():
    mass = Mass()
    one, two = (bound(System({"m": mass})).instances["m"] for _ in range(2))
    assert len({one.address("x"), two.address("x"), mass.memory.ctypes.data}) == 3


def test_kernel_instances_serve_every_coupling():
    instance = bound(System({"m": Mass()})).instances["m"]
    assert isinstance(instance, Stepping)
    assert isinstance(instance, Integrated)
    assert instance.unrepeatable == ""


class Own:
    """A component that makes its own instance: that of a mass, under its own name for the state."""

    as_block, every, sample_period, declared_outputs = False, None, None, ["x"]

    def ports(self, direction):
        return {"x": Port("", "x")} if direction == "output" else {}

    def instance(self, name, setting):
        self.setting = setting
        return KernelInstance(name, Mass(), setting)


def test_a_component_may_make_its_own_instance():
    own = Own()
    assert isinstance(own, Component)
    assert isinstance(own, MakesInstance)
    result = simulate(System({"o": own}), step=0.25, stop=1.0)
    assert result["o.x"].tolist() == simulate(System({"m": Mass()}), step=0.25, stop=1.0)["m.x"].tolist()
    assert (own.setting.step, set(own.setting.used)) == (0.25, {"x"})


class Mute:
    as_block, every, sample_period, declared_outputs = False, None, None, ()

    def ports(self, direction):
        return {}


def test_a_component_without_an_instance_is_refused_with_its_remedy():
    with pytest.raises(WiringError, match=r"m: Mute makes no running instance; derive it from Block"):
        simulate(System({"m": Mute()}), step=0.25, stop=1.0)
