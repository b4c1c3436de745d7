"""A system as one FMU: in our loop and in FMPy, the bits of the system itself.

The container gives outputs of plants at t_k as they are then, those of blocks as computed at
t_{k-1}: compared with that shift, and nothing else.
"""

from __future__ import annotations

import sys

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

from cosim import FMU, Continuous, CosimError, Input, Output, State, System, simulate
from fmus.export import ExportError, export
from fmus.packaging.container import export_container
from fmus.plants.oscillator import Oscillator
from scenarios.chattering.study import Study
from tests.fmus.packaging.ssp_parts import Brake, Damper, Frame, Watch, at_rest, frame

H, STOP = 0.005, 1.0


class Chain(Continuous):
    """x' = u - x, y = x + u: two of them in a row differ if one gets what the other has at t_k+1"""

    u = Input("input", unit="N", start=1.0)
    x = State(0.3, "state", unit="N")
    y = Output("output", unit="kN")

    def derivatives(self, t: float) -> None:
        self.der_x = self.u - self.x

    def outputs(self, t: float) -> None:
        self.y = (self.x + self.u) * 1e-3


def chain() -> System:
    """Plant drives plant, with units on the way; the first one's input is free, the last one is blocked."""
    system = System({"a": Chain(), "b": Chain(x=-0.2), "c": Chain(), "brake": Brake(), "mass": Oscillator()})
    system.connect("a.y", "b.u")
    system.connect("b.x", "c.u")
    system.connect("b.x", "mass.u")
    system.connect("mass.v", "brake.v")
    return system


def late() -> System:
    """Late values of a plant, of a block in a cycle of blocks, and with a conversion."""
    system = System({"frame": Frame(), "damper": Damper(), "watch": Watch()})
    system.connect("frame.v", "damper.v", initial=[40.0, -30.0])
    system.connect("damper.f", "frame.F")
    system.connect("damper.f[1]", "watch.p", initial=250.0)
    system.connect("watch.y", "damper.a[2]")
    system.connect("frame.x[2]", "watch.q", initial=7.0)
    return system


def case_6() -> System:
    return Study(case=6).build()


@pytest.mark.parametrize(
    ("build", "version", "step"),
    [
        (at_rest, "2.0", H),
        (frame, "2.0", H),
        (frame, "3.0", H),
        (chain, "2.0", H),
        (late, "2.0", H),
        (case_6, "2.0", 0.01),
    ],
    ids=["at rest", "arrays 2.0", "arrays 3.0", "chain", "late", "chattering"],
)
def test_the_same_bits_as_the_system(tmp_path, build, version, step):
    """Noise, switching control and feedthrough amplify what is off by a bit or by a step."""
    system = build()
    path = export_container(system, tmp_path / "whole.fmu", step=step, stop=STOP, fmi_version=version)
    assert validate_fmu(str(path)) == []
    expected = simulate(system, step=step, stop=STOP)
    found = simulate(System({"it": FMU(path)}), step=step, stop=STOP)
    for name, signal in expected.signals.items():
        late = int(system.participants[name.partition(".")[0]].as_block)
        whole = found[f"it.{name}"]
        # at t_0 the container has brought initial outputs to inputs, which we do when we step
        first = 1 if build is chain else late
        assert np.array_equal(whole[first:], signal[first - late : len(signal) - late]), name
        assert expected.units[name] == found.units[f"it.{name}"]
        assert np.ptp(signal) > 0.0 or build is case_6


def test_in_fmpy_with_larger_steps(tmp_path):
    """The host steps four times as far; inside it is the same, so the numbers are."""
    path = export_container(frame(), tmp_path / "whole.fmu", step=H, stop=STOP)
    theirs = simulate_fmu(str(path), stop_time=STOP, output_interval=4 * H, output=["frame.x[1]"])
    ours = simulate(frame(), step=H, stop=STOP)["frame.x"][::4, 0]
    assert np.array_equal(theirs["frame.x[1]"], ours)


def test_inputs_and_parameters_of_the_whole(tmp_path):
    """What nothing feeds is an input, parameters are parameters; start values of FMUs are kept."""
    oscillator = export(Oscillator(), tmp_path / "oscillator.fmu")
    system = System({"mass": FMU(oscillator, start={"m": 2.0, "x": 3.0}), "brake": Brake()})
    system.connect("mass.v", "brake.v")
    system.connect("brake.u", "mass.u")
    path = export_container(system, tmp_path / "whole.fmu", step=H)
    whole = FMU(path, start={"brake.b": 0.3, "mass.d": 0.7})
    assert list(whole.inputs) == ["mass.d"]
    other = System({"mass": FMU(oscillator, start={"m": 2.0, "x": 3.0, "d": 0.7}), "brake": Brake(b=0.3)})
    other.connect("mass.v", "brake.v")
    other.connect("brake.u", "mass.u")
    expected = simulate(other, step=H, stop=STOP)["mass.x"]
    assert np.array_equal(simulate(System({"it": whole}), step=H, stop=STOP)["it.mass.x"], expected)


def ring() -> System:
    system = System({"a": Chain(), "b": Chain()})
    system.connect("a.x", "b.u")
    system.connect("b.x", "a.u")
    return system


def part() -> System:
    system = System({"frame": Frame(), "watch": Watch()})
    system.connect("frame.x[2]", "watch.q", transformation=(1.0, 0.0))
    return system


REFUSED = [
    (
        lambda: System({"damper": Damper(every=2)}),
        "2.0",
        r"damper acts every 0\.01 s and the container steps",
    ),
    (ring, "2.0", r"[ab] and [ab] drive each other; in a container the last one would receive"),
    (part, "3.0", r"frame\.x\[2\]: a part of an array cannot be linked in a container; use FMI 2\.0"),
]


@pytest.mark.parametrize(("build", "version", "message"), REFUSED, ids=["rate", "ring", "part"])
def test_what_a_container_cannot_say_is_refused(tmp_path, build, version, message):
    with pytest.raises(CosimError, match=message):
        export_container(build(), tmp_path / "whole.fmu", step=H, fmi_version=version)
    assert not (tmp_path / "whole.fmu").exists()


def test_without_the_toolbox_it_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "fmu_manipulation_toolbox.container", None)
    with pytest.raises(ExportError, match=r"pip install structcosim\[container\]"):
        export_container(at_rest(), tmp_path / "whole.fmu", step=H)
