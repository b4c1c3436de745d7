"""FMI 2.0 and 3.0 through one class: the same results from both versions, and the features of 3.0.

The FMUs are exported ones, and those of c/probe.h for features that the exporter does not have.
"""

from __future__ import annotations

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

from cosim import (
    FMU,
    Block,
    CosimError,
    FMUError,
    Input,
    Output,
    Result,
    Simulation,
    SimulationEndedWarning,
    SimulationError,
    State,
    System,
    WiringError,
    simulate,
)
from cosim.cli.inspection import inspection
from fmus.export import export
from tests.cosim.fmi.probe import INTEGERS, probe
from tests.cosim.parts import Chain, Counter, Mass, Ramp, closed

VERSIONS = ["2.0", "3.0"]
SAMPLED, STAGES = {}, {"coupling": "continuous", "solver": "ode1"}
H = 9 / 32  # a binary fraction: times and states below are exact


@pytest.fixture(scope="module")
def probes(tmp_path_factory):
    folder = tmp_path_factory.mktemp("probes")
    return {v: probe(folder / f"probe{v[0]}.fmu", v) for v in VERSIONS}


class Square(Block):
    """whole = 1, 2, 3, ...; bit = 0, 1, 0, ...; mode = 1, 2, 1, ...; half = whole / 2"""

    whole = State(0.0)
    bit = Output()
    mode = Output()
    half = Output(unit="N")

    def step(self, t, h):
        self.bit = self.whole % 2.0
        self.mode = 1.0 + self.bit
        self.whole += 1.0
        self.half = 0.5 * self.whole


# ------------------------------------------------------------------- both versions alike


@pytest.mark.parametrize("interfaces", [["CoSimulation"], ["ModelExchange"]])
def test_versions_give_the_same_bits(tmp_path, interfaces):
    """Both are the same kernels; Co-Simulation and stage coupling give those of Python as well."""
    options = [SAMPLED] if interfaces == ["CoSimulation"] else [SAMPLED, STAGES]
    for option in options:
        record, first = ["plant.a", "g.u"], None
        python = simulate(closed(Chain()), step=0.01, stop=3.0, record=record, **option)
        for version in VERSIONS:
            path = export(Chain(), tmp_path / f"{version}.fmu", fmi_version=version, interfaces=interfaces)
            fmu = simulate(closed(FMU(path)), step=0.01, stop=3.0, record=record, **option)
            # sampled coupling integrates Model Exchange by ode4, off by |A^5| h^5 / 120 = 3e-11 a step
            bound = 1e-8 if interfaces == ["ModelExchange"] and not option else 0.0
            first = first or fmu
            for name in record:
                assert np.abs(fmu[name] - python[name]).max() <= bound
                assert np.array_equal(fmu[name], first[name])
        assert np.ptp(python["plant.a"], axis=0).min() > 0.5


@pytest.mark.parametrize("version", VERSIONS)
def test_hand_written_fmus_are_valid_and_run_in_fmpy(probes, version):
    assert validate_fmu(str(probes[version])) == []
    options = {"stop_time": 4 * H, "output_interval": H, "step_size": H, "start_values": {"r_in": 3.5}}
    result = simulate_fmu(str(probes[version]), fmi_type="CoSimulation", output=["r_out", "x"], **options)
    ours = simulate(System({"p": FMU(probes[version], start={"r_in": 3.5})}), step=H, stop=4 * H)
    assert list(result["r_out"]) == list(ours["p.r_out"]) == [7.0] * 5
    assert list(result["x"]) == list(ours["p.x"])


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("options", [SAMPLED, STAGES], ids=["Co-Simulation", "Model Exchange"])
def test_every_type_goes_in_and_out(probes, version, options):
    """Stage coupling reads the outputs after the blocks; sampled coupling reads them before, a step late."""
    system = System({"s": Square(sample_period=H), "p": FMU(probes[version])})
    for source, target in (("half", "r_in"), ("whole", "i_in"), ("bit", "b_in"), ("mode", "e_in")):
        system.connect(f"s.{source}", f"p.{target}")
    result = simulate(system, step=H, stop=8 * H, **options)
    n = np.arange(1.0, 10.0)
    late = options == SAMPLED
    expected = {"r_out": n, "i_out": n + 1, "b_out": n % 2, "e_out": 2 - n % 2}
    first = {"r_out": 1.0, "i_out": 8.0, "b_out": 0.0, "e_out": 1.0}  # of the start values
    for name, values in expected.items():
        shifted = [first[name], *values[:-1]] if late else values
        assert list(result[f"p.{name}"]) == list(shifted), name


@pytest.mark.parametrize("recorded", [["i", "b"], ["b", "i"]])
@pytest.mark.parametrize("first", VERSIONS)
def test_negative_integers_with_booleans(probes, first, recorded):
    """Int32 and the Boolean of FMI 2.0 are both C ints; each must keep its own conversion, in any order."""
    participants = {
        f"p{v[0]}": FMU(probes[v], start={"i_in": -7.0}) for v in sorted(VERSIONS, key=lambda v: v != first)
    }
    record = [f"{p}.{name}_out" for p in participants for name in recorded]
    result = simulate(System(participants), step=H, stop=2 * H, record=record)
    for p in participants:
        assert list(result[f"{p}.i_out"]) == [-6.0] * 3
        assert list(result[f"{p}.b_out"]) == [0.0] * 3


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("options", [{}, {"coupling": "continuous", "solver": "ode3"}])
def test_state_time_and_step_events(probes, version, options):
    """x = t mod 1, stair = floor(t / 0.75), quarters = floor(k / 4): events at the end of a step."""
    system = System({"p": FMU(probes[version])})
    if not options:  # Co-Simulation counts no steps
        result = simulate(system, step=H, stop=40 * H)
    else:
        result = simulate(system, step=H, stop=40 * H, **options)
        assert list(result["p.quarters"]) == list(np.arange(41) // 4)
    t = np.arange(41) * H
    # ode3 adds h (2 + 3 + 4) / 9 = h to rounding
    assert result["p.x"] == pytest.approx(t % 1.0, abs=1e-14)
    assert list(result["p.stair"]) == list(t // 0.75)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("options", [SAMPLED, STAGES], ids=["Co-Simulation", "Model Exchange"])
def test_a_request_to_end_ends_the_run(probes, version, options):
    """The run ends normally at the communication point that the FMU reached, for all components."""
    parts = {"a": Counter(), "p": FMU(probes[version], start={"end_at": 5 * H}), "z": Mass()}
    with pytest.warns(SimulationEndedWarning, match=r"p asked to end the simulation at t = 1\.40625 s"):
        result = simulate(System(parts), step=H, stop=9 * H, **options)
    assert result.ended == "p asked to end the simulation at t = 1.40625 s"
    assert (result.steps, result.interrupted) == (5, False)
    assert list(result.time) == [k * H for k in range(6)]
    whole = simulate(System({"z": Mass(), "p": FMU(probes[version])}), step=H, stop=9 * H, **options)
    assert whole.ended == ""
    for name in ("z.x", "p.x", "p.stair"):
        assert list(result[name]) == list(whole[name][:6]), name
    assert result.statistics["p.stair"].maximum == 1.0


@pytest.mark.parametrize("version", VERSIONS)
def test_a_request_to_end_within_a_step(probes, version, tmp_path):
    """The FMU reaches 4.5 H in the step to 5 H: the last point of the result is 4 H."""
    fmu = FMU(probes[version], start={"early_at": 4.5 * H, "end_at": 4.7 * H})
    with pytest.warns(SimulationEndedWarning):
        result = simulate(System({"p": fmu}), step=H, stop=9 * H)
    assert result.ended == "p asked to end the simulation at t = 1.265625 s"
    assert list(result.time) == [k * H for k in range(5)]
    result.save(tmp_path / "result.npz")
    assert Result.load(tmp_path / "result.npz").ended == result.ended


def test_after_a_request_to_end(probes):
    """The run cannot continue, but an earlier snapshot can be restored."""
    with Simulation(System({"r": Ramp(), "p": FMU(probes["2.0"], start={"end_at": 3 * H})}), step=H) as run:
        with pytest.warns(SimulationEndedWarning):
            run.run(5 * H)
        with pytest.raises(SimulationError, match=r"cannot run: p asked to end .* restore a snapshot"):
            run.run(6 * H)


def test_an_early_return_is_continued(probes):
    """x moves by the time that every doStep covers; FMI 2.0 can only discard a step, which ends the run."""
    system = System({"p": FMU(probes["3.0"], start={"early_at": 4.5 * H})})
    assert list(simulate(system, step=H, stop=9 * H)["p.x"]) == [k * H % 1.0 for k in range(10)]
    system = System({"p": FMU(probes["2.0"], start={"early_at": 4.5 * H})})
    with pytest.raises(SimulationError, match=r"p failed at t = 1\.125 s with fmi2Discard"):
        simulate(system, step=H, stop=9 * H)


@pytest.mark.parametrize("version", VERSIONS)
def test_numbers_that_a_type_does_not_hold(probes, version):
    """The ramp is 2 + 3 t, so 2.84375 after the first step; it is neither rounded nor wrapped."""
    for target, words in (
        ("i_in", r"p\.i_in is not a whole number from -2147483648 to 2147483647 at t = 0\.28125 s"),
        ("b_in", r"p\.b_in is not a whole number from 0 to 1 at t = 0 s"),
    ):
        with pytest.raises(SimulationError, match=words):
            simulate(
                System({"r": Ramp(), "p": FMU(probes[version])}, [("r.u", f"p.{target}")]), step=H, stop=1.125
            )
    with pytest.raises(
        FMUError, match=r"start value i_in = 2147483648 does not fit type Int.* \(a whole number from"
    ):
        FMU(probes[version], start={"i_in": 2**31})
    with pytest.raises(FMUError, match="start value b_in = 2 does not fit type Boolean"):
        FMU(probes[version], start={"b_in": 2})
    with pytest.raises(FMUError, match="start value label = 3 does not fit type String"):
        FMU(probes[version], start={"label": 3})


@pytest.mark.parametrize("version", VERSIONS)
def test_units_strings_and_dependencies(probes, version):
    fmu = FMU(probes[version], start={"label": "façade"})
    assert (fmu.inputs["r_in"].unit, fmu.outputs["r_out"].unit) == ("N", "N")  # its own, its type's
    result = simulate(System({"p": fmu}), step=H, stop=H, record=["p.label_length"])
    assert list(result["p.label_length"]) == [7.0, 7.0]  # bytes of UTF-8
    needs = fmu.feedthrough()
    assert needs["r_out"] == {"r_in"}
    assert needs["stair"] == set()  # an empty list: none
    assert needs["i_out"] == set(fmu.input_ports)  # no list: all


@pytest.mark.parametrize("version", VERSIONS)
def test_an_fmu_with_one_instance_per_process(tmp_path, version):
    path = probe(tmp_path / "once.fmu", version, once=True)
    simulate(System({"a": FMU(path)}), step=H, stop=H)
    with pytest.raises(WiringError, match=r"b and a are the same FMU, once\.fmu, .* only once per process"):
        simulate(System({"a": FMU(path), "b": FMU(path)}), step=H, stop=H)
    assert "one instance per process" in inspection(path)


# ------------------------------------------------------------------------- FMI 3.0 alone


def test_numbers_of_all_widths_at_their_limits(probes):
    """NAME_out = NAME_in + 1 in the type itself; limits that fit a float are exact."""
    top = {kind: 2 ** (int(kind.lstrip("UInt")) - (kind[0] == "I")) - 2 for kind in INTEGERS}
    top |= {"Int64": 2**53 - 1, "UInt64": 2**53 - 1}
    fmu = FMU(probes["3.0"], start={f"{k}_in": v for k, v in top.items()} | {"f32_in": 0.1})
    result = simulate(System({"p": fmu}), step=H, stop=2 * H)
    for kind, value in top.items():
        assert list(result[f"p.{kind}_out"]) == [value + 1.0] * 3, kind
    assert result["p.f32_out"][-1] == np.float32(np.float32(0.1) + 1.0)
    low = {f"Int{bits}_in": -(2 ** (bits - 1)) for bits in (8, 16, 32)} | {"Int64_in": -(2**53) - 1}
    result = simulate(System({"p": FMU(probes["3.0"], start=low)}), step=H, stop=2 * H)
    for name, value in low.items():
        assert int(result[f"p.{name.replace('_in', '_out')}"][-1]) == value + 1  # as integers, above 2^53 too


@pytest.mark.parametrize("kind", ["Int64", "UInt64"])
def test_a_number_above_2_53_is_not_rounded(probes, kind):
    fmu = FMU(probes["3.0"], start={f"{kind}_in": 2**53})
    with pytest.raises(SimulationError, match=rf"p\.{kind}_out is above 2\^53"):
        simulate(System({"p": fmu}), step=H, stop=H, record=[f"p.{kind}_out"])


def test_an_input_above_2_53_that_is_recorded_is_not_rounded(probes):
    fmu = FMU(probes["3.0"], start={"Int64_in": 2**53 + 1})
    with pytest.raises(CosimError, match=r"p\.Int64_in starts with 9007199254740993.* a float"):
        simulate(System({"p": fmu}), step=H, stop=H, record=["p.Int64_in"])


@pytest.mark.parametrize("kind", ["Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32"])
def test_inputs_outside_the_range_of_their_type(probes, kind):
    """The first value that is one too large is refused, the largest one is not."""
    top = 2 ** (int(kind.lstrip("UInt")) - (kind[0] == "I")) - 1

    class Up(Block):
        y = State(float(top))

        def step(self, t, h):
            if t > 0.0:
                self.y += 1.0

    system = System({"up": Up(), "p": FMU(probes["3.0"])}, [("up.y", f"p.{kind}_in")])
    with pytest.raises(SimulationError, match=rf"p\.{kind}_in is not a whole number .* at t = {H} s"):
        simulate(system, step=H, stop=3 * H, record=["up.y"])


def test_structural_parameters_size_arrays(probes):
    small = FMU(probes["3.0"])
    assert (small.inputs["v_in"].shape, small.outputs["v_out"].shape) == ((2,), (2,))
    result = simulate(System({"p": small}), step=H, stop=H, record=["p.v_out"])
    assert result["p.v_out"].tolist() == [[5.0, 3.0]] * 2
    large = FMU(probes["3.0"], start={"n": 4, "v_in": [1.0, 2.0, 3.0, 4.0]})
    assert large.outputs["v_out"].shape == (4,)
    system = System({"r": Ramp(), "p": large}, [("r.u", "p.v_in[2]")])
    result = simulate(system, step=H, stop=2 * H, record=["p.v_out", "p.v_in[2]"])
    last = 2.0 + 3.0 * H
    assert result["p.v_out"].tolist() == [[8.0, 6.0, 4.0, 2.0]] * 2 + [[8.0, 6.0, 2 * last, 2.0]]
    assert result["p.v_in[2]"].tolist() == [2.0, 2.0, last]
    with pytest.raises(FMUError, match=r"v_in = .* does not fit type Float64 of shape \(4,\)"):
        FMU(probes["3.0"], start={"n": 4, "v_in": [1.0, 2.0, 3.0]})
    with pytest.raises(FMUError, match=r"start value n = 1\.5 does not fit type UInt64"):
        FMU(probes["3.0"], start={"n": 1.5})


def test_binary_start_values(probes):
    fmu = FMU(probes["3.0"], start={"blob": bytes([1, 2, 250])})
    assert simulate(System({"p": fmu}), step=H, stop=H)["p.blob_sum"][-1] == 253.0
    with pytest.raises(FMUError, match="start value blob = 'text' does not fit type Binary"):
        FMU(probes["3.0"], start={"blob": "text"})


def test_aliases_are_names_of_one_variable(probes):
    """Two names of an output are two ports; two names of an input are one, which has one source."""
    system = System({"r": Ramp(), "p": FMU(probes["3.0"])})
    system.connect("r.u", "p.r_other")
    with pytest.raises(WiringError, match=r"p\.r_in is already connected"):
        system.connect("r.u", "p.r_in")
    result = simulate(system, step=H, stop=4 * H)
    assert list(result["p.r_out"][1:]) == list(2.0 * result["r.u"][:-1])
    assert list(result["p.x_alias"]) == list(result["p.x"])


def test_inspection_of_an_fmu_of_fmi_3(probes):
    lines = inspection(probes["3.0"]).splitlines()
    assert lines[0].split() == ["model", "probe,", "FMI", "3.0"]
    assert "Co-Simulation       yes: variable step, early return" in lines
    rows = {line.split()[0]: line.split() for line in lines if line}
    assert rows["v_in"][1:3] == ["Float64[2]", "input"]
    assert rows["r_out"][1:4] == ["Float64", "output", "N"]


# -------------------------------------------------------------------- in place of a block


class Twice(Block):
    """y counts its calls and adds 2 x: an output that depends on the input at the same instant."""

    x = Input()
    n = State(0.0)
    y = Output()

    def step(self, t, h):
        self.n += h
        self.y = self.n + 2.0 * self.x


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("rate", [{}, {"every": 3}, {"sample_period": 0.5}])
def test_a_block_as_fmu_acts_where_the_block_acts(tmp_path, version, rate):
    """The order of the connections, the rate and the step are those of the block: the same bits."""
    path = export(Twice(), tmp_path / "twice.fmu", fmi_version=version)
    runs = []
    for member in (Twice(**rate), FMU(path, as_block=True, **rate)):
        system = System({"b": member, "r": Ramp()}, [("r.u", "b.x")])
        runs.append(simulate(system, step=0.125, stop=4.0, record=["b.y", "b.n", "r.u"]))
    for name in ("b.y", "b.n"):
        assert list(runs[0][name]) == list(runs[1][name])
    assert runs[0].schedule == runs[1].schedule.replace(" (FMU)", "")


def test_blocks_as_fmus_in_a_cycle_and_at_solver_stages(tmp_path):
    path = export(Twice(), tmp_path / "twice.fmu", fmi_version="3.0")
    system = System({"a": FMU(path, as_block=True), "b": Twice()}, [("a.y", "b.x")])
    with pytest.raises(WiringError, match=r"algebraic cycle: .*b\.y -> a\.x"):
        system.connect("b.y", "a.x")
    with pytest.raises(WiringError, match=r"a \(twice\.fmu\) stands for a block at every stage .* every=1"):
        simulate(system, step=0.1, stop=1.0, coupling="continuous")
    with pytest.raises(FMUError, match="every and sample_period belong to a block; give as_block=True"):
        FMU(path, every=2)
    plant = export(Chain(), tmp_path / "me.fmu", interfaces=["ModelExchange"])
    with pytest.raises(FMUError, match="as_block=True needs Co-Simulation"):
        FMU(plant, as_block=True)
