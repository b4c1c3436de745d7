"""Systems out as SSP and in again: valid by the schemas, the same bits, the same wiring."""

from __future__ import annotations

import contextlib
import re
import zipfile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cosim import (
    FMU,
    Block,
    CosimError,
    Input,
    ModelExchange,
    Output,
    System,
    WiringError,
    read_ssp,
    simulate,
)
from cosim.ssp.format import NAMESPACES, SSPError
from cosim.ssp.reader import Experiment, read_package
from fmus.export import export
from fmus.packaging.ssp import export_ssp
from scenarios.chattering.study import Study
from tests.fmus.packaging.ssp_parts import Damper, Frame, Watch, loop, validated

H, STOP = 0.01, 2.0


def same_runs(system, other, **options):
    a, b = (simulate(s, step=H, stop=STOP, **options) for s in (system, other))
    assert set(a.signals) <= set(b.signals)
    for name in a.signals:
        assert np.array_equal(a[name], b[name]), name
        assert a.units[name] == b.units[name], name
    return a


@pytest.mark.parametrize("version", ["1.0", "2.0"])
def test_the_same_bits_after_the_way_through_a_file(tmp_path, version):
    """Arrays, slices, units, transformations, late connections, sample periods: no bit is lost."""
    system = loop()
    path = export_ssp(system, tmp_path / "loop.ssp", step=H, stop=STOP, version=version)
    root = validated(path)
    assert root.get("version") == version
    package = read_package(path)
    result = same_runs(system, package.system)
    assert np.ptp(result["watch.y"]) > 0.01
    assert (package.experiment.start, package.experiment.stop, package.experiment.step) == (0.0, STOP, H)
    assert package.system.participants["damper"].as_block
    # and once more: FMUs are copied
    again = export_ssp(package.system, tmp_path / "again.ssp", step=H, stop=STOP, version=version)
    validated(again)
    same_runs(system, read_ssp(again))


def test_a_scenario_with_all_its_blocks(tmp_path):
    """Chapter 4, case 6: noise, earthquake, sensor, switching control, which amplifies a lost bit."""
    system = Study(case=6).build()
    path = export_ssp(system, tmp_path / "chattering.ssp")
    validated(path)
    result = same_runs(system, read_ssp(path))
    assert np.sum(np.diff(result["control.sgn"]) != 0) > 5


def test_version_1_unless_the_system_needs_2(tmp_path):
    frame, damper = (
        export(part, tmp_path / f"{name}.fmu", fmi_version="3.0")
        for name, part in (("frame", Frame()), ("damper", Damper()))
    )
    alone = System({"frame": FMU(frame)})
    assert validated(export_ssp(alone, tmp_path / "a.ssp")).get("version") == "1.0"
    arrays = System(
        {"frame": FMU(frame), "damper": FMU(damper, as_block=True)},
        [("frame.v", "damper.v"), ("damper.f", "frame.F")],
    )
    assert validated(export_ssp(arrays, tmp_path / "b.ssp")).get("version") == "2.0"
    same_runs(arrays, read_ssp(tmp_path / "b.ssp"))
    with pytest.raises(SSPError, match=r"SSP 1\.0 cannot express that frame\.v is an array; write version 2"):
        export_ssp(arrays, tmp_path / "c.ssp", version="1.0")
    started = System({"frame": FMU(frame, start={"K": [[50.0, -20.0], [-21.0, 22.0]], "x": [1.0, 2.0]})})
    assert validated(export_ssp(started, tmp_path / "d.ssp")).get("version") == "2.0"
    same_runs(started, read_ssp(tmp_path / "d.ssp"))


def test_units_are_written_as_what_replaces_them(tmp_path):
    """A tool that knows units must not convert twice, one that does not must convert once."""
    root = validated(export_ssp(loop(), tmp_path / "loop.ssp"))
    found = {
        (c.get("startConnector"), c.get("endConnector")): c
        for c in root.iterfind(".//ssd:Connection", NAMESPACES)
    }
    force = found["f[1]", "F[1]"]
    assert force.get("suppressUnitConversion") == "true"
    linear = force.find("ssc:LinearTransformation", NAMESPACES)
    assert (float(linear.get("factor")), float(linear.get("offset"))) == (1e-3, 0.0)
    units = {u.get("name"): u[0].attrib for u in root.iterfind("ssd:Units/ssc:Unit", NAMESPACES)}
    assert dict(units["kN"]) == {"kg": "1", "m": "1", "s": "-2", "factor": "1000.0"}


def test_the_parameters_of_a_python_participant_are_in_its_set(tmp_path):
    """They can be changed in the file, and count."""
    path = export_ssp(System({"damper": Damper(g=33.0)}), tmp_path / "one.ssp")
    with zipfile.ZipFile(path) as archive:
        files = {n: archive.read(n) for n in archive.namelist()}
    text = files["SystemStructure.ssd"]
    assert text.count(b'<ssv:Real value="33.0" unit="kg"/>') == 1
    files["SystemStructure.ssd"] = text.replace(b'value="33.0" unit="kg"', b'value="44.5" unit="kg"')
    changed = tmp_path / "changed.ssp"
    with zipfile.ZipFile(changed, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    assert read_ssp(changed).participants["damper"].start["g"] == 44.5


def test_how_fmus_and_the_system_are_run_is_kept(tmp_path):
    fmu = export(Frame(), tmp_path / "frame.fmu")
    given = FMU(fmu, interface=ModelExchange("ode2", substeps=3))
    stiff = FMU(fmu, interface=ModelExchange("cvode", tolerance=1e-9))
    system = System({"a": given, "b": stiff, "c": FMU(fmu, interface="CoSimulation", isolated=True)})
    path = export_ssp(system, tmp_path / "me.ssp", step=H, stop=STOP, coupling="continuous", solver="ode4")
    validated(path)
    package = read_package(path)
    assert package.experiment == Experiment(0.0, STOP, H, "continuous", "ode4")
    for name in ("interface", "isolated", "as_block", "event_mode"):
        for key, member in system.participants.items():
            assert getattr(package.system.participants[key], name) == getattr(member, name), (key, name)


def test_one_file_for_two_of_the_same_fmu(tmp_path):
    fmu = export(Frame(), tmp_path / "frame.fmu")
    system = System({"left": FMU(fmu), "right": FMU(fmu, start={"x[1]": 5.0})})
    path = export_ssp(system, tmp_path / "two.ssp")
    with zipfile.ZipFile(path) as archive:
        assert archive.namelist() == ["SystemStructure.ssd", "resources/left.fmu"]
    same_runs(system, read_ssp(path))


def test_the_same_system_gives_the_same_bytes(tmp_path):
    paths = [export_ssp(loop(), tmp_path / folder / "loop.ssp") for folder in ("a", "b")]
    assert paths[0].read_bytes() == paths[1].read_bytes()


class Interpreted(Block):
    """Python that is not compiled"""

    compiled = False
    y = Output()

    def step(self, t, h):
        self.y = float(str(t))


def test_what_cannot_leave_is_an_error_that_names_it(tmp_path):
    with pytest.raises(CosimError, match="participant odd: Interpreted runs as Python"):
        export_ssp(System({"odd": Interpreted()}), tmp_path / "a.ssp")
    with pytest.raises(SSPError, match=r"SSP version '3\.0' is not supported"):
        export_ssp(loop(), tmp_path / "a.ssp", version="3.0")
    with pytest.raises(SSPError, match="has no participants"):
        export_ssp(System(), tmp_path / "a.ssp")


class Mine(Block):
    """The user's controller in place of the damper: other names for inside, the same ports, forces in kN"""

    v = Input(unit="m/s", shape=2)
    a = Input(unit="m/s^2", shape=2)
    f = Output(unit="kN", shape=2)

    def step(self, t, h):
        for i in range(2):
            self.f[i] = -0.7 * self.v[i] - 0.02 * self.a[i]


def test_a_python_block_in_place_of_a_component(tmp_path):
    path = export_ssp(loop(), tmp_path / "loop.ssp")
    found = simulate(read_ssp(path, replace={"damper": Mine(sample_period=0.02)}), step=H, stop=STOP)
    expected = System({"frame": Frame(), "damper": Mine(sample_period=0.02)})
    expected.connect("frame.v", "damper.v")
    expected.connect("frame.a[1]", "damper.a[2]")
    expected.connect("frame.a[2]", "damper.a[1]", initial=[0.125])
    expected.connect("damper.f", "frame.F")
    expected = simulate(expected, step=H, stop=STOP)
    # kN -> N -> kN on the way through the file rounds, and nothing here amplifies it
    assert np.abs(found["frame.x"] - expected["frame.x"]).max() < 1e-12 * np.abs(expected["frame.x"]).max()
    with pytest.raises(WiringError, match=r"has no component 'dampr'; did you mean 'damper'"):
        read_ssp(path, replace={"dampr": Mine()})
    with pytest.raises(WiringError, match=r"damper\.v\[1\] \(damper is replaced by a Watch, ports: p, q, y"):
        read_ssp(path, replace={"damper": Watch()})


# --------------------------------------------------------------- random wirings


def links(system):
    """Every element that is fed, by name: where from, with which factor, offset and start."""
    found = {}
    for c in system.connections:
        names = []
        for end in (c.source, c.target):
            n = end.shape[-1] if end.shape else 1
            elements = range(end.first, end.first + end.count)
            names.append([(end.participant, end.name, divmod(i, n)) for i in elements])
        sources = names[0] * len(names[1]) if len(names[0]) == 1 else names[0]
        late = None if c.initial is None else list(np.broadcast_to(c.initial, len(names[1])))
        for i, (a, b) in enumerate(zip(sources, names[1], strict=True)):
            found[b] = (a, c.scale, c.offset, None if late is None else float(late[i]))
    return found


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("parts")
    return {
        (kind, version): export(kind(), folder / f"{kind.__name__}{version[0]}.fmu", fmi_version=version)
        for kind in (Frame, Damper, Watch)
        for version in ("2.0", "3.0")
    }


NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_wiring_comes_back(files, tmp_path, data):
    """Participants, start values, rates, and what feeds every element of every input."""
    version = data.draw(st.sampled_from(["2.0", "3.0"]))
    system = System()
    for i, kind in enumerate(
        data.draw(st.lists(st.sampled_from([Frame, Damper, Watch]), min_size=1, max_size=5))
    ):
        start = {}
        if kind is Frame and data.draw(st.booleans()):
            start = {"x": data.draw(st.lists(NUMBERS, min_size=2, max_size=2))}
        block = kind is not Frame
        rate = data.draw(st.sampled_from([{}, {"every": 3}, {"sample_period": 0.1 + 0.2}])) if block else {}
        system.add(f"p{i}", FMU(files[kind, version], start=start, as_block=block, **rate))
    outputs = [f"{n}.{p}" for n, m in system.participants.items() for p in m.outputs]
    inputs = [f"{n}.{p}" for n, m in system.participants.items() for p in m.inputs]
    ends = st.sampled_from(["", "[1]", "[2]", "[1:2]", "[2,1]"])
    for _ in range(data.draw(st.integers(0, 8))):
        source = data.draw(st.sampled_from(outputs)) + data.draw(ends)
        target = data.draw(st.sampled_from(inputs)) + data.draw(ends)
        initial = data.draw(st.none() | NUMBERS)
        transformation = data.draw(st.none() | st.tuples(NUMBERS, NUMBERS))
        try:
            system.connect(source, target, initial=initial, transformation=transformation)
        except WiringError:
            continue  # no such element, units that differ, a cycle: not what is tested here
    path = export_ssp(system, tmp_path / "any.ssp")
    validated(path)
    back = read_ssp(path)
    assert list(back.participants) == list(system.participants)
    assert links(back) == links(system)
    for name, member in system.participants.items():
        other = back.participants[name]
        assert other.start_values() == member.start_values()
        assert (other.as_block, other.every, other.sample_period) == (
            member.as_block, member.every, member.sample_period
        )  # fmt: skip


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_other_text_is_read_or_refused(tmp_path, data):
    """A changed SSD gives a system or an error of ours, never another one."""
    path = tmp_path / "good.ssp"
    if not path.exists():
        export_ssp(loop(), path)
    with zipfile.ZipFile(path) as archive:
        files = {n: archive.read(n) for n in archive.namelist()}
    text = files["SystemStructure.ssd"].decode()
    words = sorted(set(re.findall(r'[\w:.]+|"[^"]*"', text)))
    for _ in range(data.draw(st.integers(1, 4))):
        word = data.draw(st.sampled_from(words))
        other = data.draw(
            st.sampled_from(words) | st.sampled_from(['""', '"-1"', '"nan"', '"1e400"', '"[1]"', ""])
        )
        text = text.replace(word, other, data.draw(st.sampled_from([1, -1])))
    changed = tmp_path / "changed.ssp"
    with zipfile.ZipFile(changed, "w") as archive:
        for name, content in (files | {"SystemStructure.ssd": text.encode()}).items():
            archive.writestr(name, content)
    with contextlib.suppress(CosimError):
        assert len(read_ssp(changed).participants) <= 3
