"""Strings and binary data during a run: passed from FMU to FMU, and recorded."""

from __future__ import annotations

import pytest

from cosim import FMU, CoSimulation, Result, Simulation, System, WiringError, read_ssp, simulate
from fmus.packaging.ssp import export_ssp
from tests.cosim.fmi.metronome import metronome
from tests.cosim.fmi.probe import probe
from tests.cosim.parts import Ramp

H = 0.25


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return metronome(tmp_path_factory.mktemp("texts") / "m.fmu")


RECORD = ["a.echo", "b.echo", "c.echo", "b.reversed", "c.reversed"]


def chain(path, **options):
    """echo is word with "!"; a goes to b goes to c; reversed is data backwards."""
    start = {"word": "Grüße", "data": b"\x00\x01\xff"}
    system = System(
        {"a": FMU(path, start=start, **options), "b": FMU(path, **options), "c": FMU(path, **options)}
    )
    for one, next_one in (("a", "b"), ("b", "c")):
        system.connect(f"{one}.echo", f"{next_one}.word")
        system.connect(f"{one}.reversed", f"{next_one}.data")
    return system


@pytest.mark.parametrize("event_mode", [False, True])
def test_texts_go_from_fmu_to_fmu(path, event_mode):
    """What is got at t_k is set before the step from t_k, and so seen at t_{k+1}, as a float is."""
    result = simulate(
        chain(path, interface=CoSimulation(event_mode)), step=H, stop=3 * H, record=[*RECORD, "a.x"]
    )
    assert result.texts["a.echo"] == ["Grüße!"] * 4
    assert result.texts["b.echo"] == ["a!"] + ["Grüße!!"] * 3
    assert result.texts["c.echo"] == ["a!", "a!!"] + ["Grüße!!!"] * 2
    assert result.texts["b.reversed"] == [b""] + [b"\x00\x01\xff"] * 3
    assert result.texts["c.reversed"] == [b"", b""] + [b"\xff\x01\x00"] * 2
    assert list(result["a.x"]) == [0.0, 0.25, 0.5, 0.75]


def test_texts_of_blocks_count_at_once(path):
    """FMUs in the place of blocks act in the order of the connections."""
    result = simulate(chain(path, as_block=True), step=H, stop=2 * H, record=RECORD)
    assert result.texts["c.echo"] == ["Grüße!!!"] * 3
    assert list(result.time) == [0.0, H, 2 * H]
    system = chain(path, as_block=True)
    with pytest.raises(WiringError, match=r"algebraic cycle: .*c\.echo -> a\.word"):
        system.connect("c.echo", "a.word")
    assert len(system.text_connections) == 4


def test_a_text_that_stays_is_set_once(path):
    """Every change is an event of an FMU with event mode, of which it counts the entries."""
    system = System(
        {"a": FMU(path), "b": FMU(path, interface=CoSimulation(True), start={"beat": 0.0, "rate": 1e-9})}
    )
    system.connect("a.echo", "b.word")
    result = simulate(system, step=H, stop=8 * H, record=["b.entries"])
    assert list(result["b.entries"]) == [0.0] + [1.0] * 8


def test_recording_decimation_saving_and_going_on(path, tmp_path):
    with Simulation(chain(path), step=H, record=RECORD, decimation=2) as simulation:
        result = simulation.run(4 * H)
        assert result.texts["c.echo"] == ["a!", "Grüße!!!", "Grüße!!!"]
        assert simulation.run(8 * H).texts["b.echo"] == ["Grüße!!"] * 3
    result.save(tmp_path / "r.npz")
    assert Result.load(tmp_path / "r.npz").texts == result.texts
    with pytest.raises(WiringError, match=r"c\.echo is a String or Binary; use result\.texts\['c\.echo'\]"):
        result["c.echo"]


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_texts_of_both_versions(tmp_path, version):
    path = probe(tmp_path / "p.fmu", version)
    system = System({"p": FMU(path, start={"text_in": "x"}), "q": FMU(path)}, [("p.text_out", "q.text_in")])
    for options in ({}, {"coupling": "continuous"}):
        result = simulate(system, step=H, stop=2 * H, record=["p.text_out", "q.text_out"], **options)
        assert result.texts["p.text_out"] == ["x"] * 3
        assert result.texts["q.text_out"] == ["", "x", "x"]


@pytest.mark.parametrize("version", ["1.0", "2.0"])
def test_texts_leave_as_ssp_and_come_back(path, tmp_path, version):
    file = export_ssp(chain(path), tmp_path / "s.ssp", version=version)
    one, back = (simulate(s, step=H, stop=3 * H, record=RECORD) for s in (chain(path), read_ssp(file)))
    assert one.texts == back.texts
    assert back.texts["c.echo"][-1] == "Grüße!!!"


def test_connections_that_are_refused(path):
    system = System({"a": FMU(path), "b": FMU(path), "r": Ramp()})
    for source, target, words in (
        ("a.echo", "b.u", r"a\.echo is a String and b\.u is a number: a String goes to a String"),
        ("r.u", "b.word", r"r\.u is a number and b\.word is a String"),
        ("a.echo", "b.data", r"a\.echo is a String and b\.data is a Binary"),
        ("a.word", "b.word", r"a\.word is an input, not an output"),
        ("a.echo", "b.echo", r"b\.echo is an output, not an input"),
        ("a.echo", "b.wrod", r"b has no input 'wrod'"),
    ):
        with pytest.raises(WiringError, match=words):
            system.connect(source, target)
    with pytest.raises(WiringError, match="a String cannot be delayed or transformed"):
        system.connect("a.echo", "b.word", initial=0.0)
    system.connect("a.echo", "b.word")
    with pytest.raises(WiringError, match=r"b\.word is already connected to a\.echo"):
        system.connect("a.echo", "b.word")
    with pytest.raises(WiringError, match=r"a\.echo is a String; statistics need numbers"):
        simulate(system, step=H, stop=H, statistics=["a.echo"])
