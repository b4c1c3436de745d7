"""An SSP of ours in other tools: ecos (C++), libcosim (C++, FMI Library) and FMPy, to the last bit or 1e-12.

They are Jacobi masters: at a communication point all FMUs get what the others had then, and
all are stepped, blocks as well. That is our own loop with every FMU as a plain one
(`as_block=False`), and it is our sampled loop with every connection out of a block one step late.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from cosim import Block, State, System, WiringError, read_ssp, simulate
from fmus.packaging.other_tools import ecospy
from fmus.packaging.ssp import PARAMETER_SET, export_ssp
from tests.fmus.packaging.ssp_parts import Frame, Mass, at_rest, frame
from tests.others import tool

H, N = 0.005, 400


def ecos(path: str, ports: Sequence[str]) -> np.ndarray:
    rows = []
    with tool(ecospy).EcosSimulation(step_size=H, ssp_path=path) as sim:
        sim.init(parameter_set=PARAMETER_SET)
        for k in range(N + 1):
            if k:
                sim.step()
            rows.append([sim.get_real(port.replace(".", "::")) for port in ports])
    return np.array(rows)


def libcosim(path: str, ports: Sequence[str]) -> np.ndarray:
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.WARNING)
    sim = CosimExecution.from_ssp_file(ssp_path=path, step_size=round(H * 1e9))  # ns
    observer = CosimObserver.create_last_value()
    assert sim.add_observer(observer)
    where = []
    for port in ports:
        slave, _, name = port.partition(".")
        i = sim.slave_index_from_instance_name(slave)
        where.append((i, next(v.reference for v in sim.slave_variables(i) if v.name.decode() == name)))
    rows = [[np.nan] * len(ports)]  # it initializes in the first step
    for _ in range(N):
        assert sim.step(1)
        rows.append([observer.last_real_values(i, [reference])[0] for i, reference in where])
    return np.array(rows)


def fmpy(path: str, ports: Sequence[str]) -> np.ndarray:
    from fmpy.ssp.simulation import simulate_ssp

    found = simulate_ssp(path, stop_time=(N - 0.5) * H, step_size=H)
    first = [0.0] * len(ports)  # row k is written after step k, with the time before it
    return np.array([first, *zip(*(found[port] for port in ports), strict=True)])


LOOPS: dict[str, tuple[Callable[[], System], list[str]]] = {
    "at rest": (at_rest, ["mass.x", "mass.v", "brake.u"]),
    "frame": (frame, ["frame.x[1]", "frame.x[2]", "damper.f[1]", "damper.f[2]", "damper.work"]),
}


def column(result, port):
    if port in result.signals:
        return result[port]
    name, _, index = port.partition("[")
    return result[name][:, int(index[:-1]) - 1]


@pytest.mark.parametrize(
    ("tool", "name"),
    [(ecos, "at rest"), (ecos, "frame"), (libcosim, "at rest"), (libcosim, "frame"), (fmpy, "at rest")],
    ids=lambda x: x if isinstance(x, str) else x.__name__,
)
def test_the_same_numbers_elsewhere(tmp_path, tool, name):
    """FMPy starts with zeros in all connectors and drops transformations: it gets the loop without."""
    build, ports = LOOPS[name]
    path = export_ssp(build(), tmp_path / "loop.ssp", step=H, stop=N * H)
    plain = read_ssp(path)
    for fmu in plain.participants.values():
        fmu.as_block = False
    ours = simulate(plain, step=H, stop=N * H)
    theirs = tool(str(path), ports)
    for i, port in enumerate(ports):
        expected = column(ours, port)
        assert np.ptp(expected) > 0.1, port
        # the same calls with the same numbers; the sine reads the time, which these tools sum up
        bound = 1e-12 * np.abs(expected).max() if name == "at rest" else 0.0
        assert np.abs(theirs[1:, i] - expected[1:]).max() <= bound, port


def test_fmus_of_version_3_in_ecos(tmp_path):
    """Scalars of FMI 3.0 in SSP 1.0: ecos has no arrays, the others no FMI 3.0."""
    path = export_ssp(at_rest(), tmp_path / "loop.ssp", fmi_version="3.0")
    plain = read_ssp(path)
    for fmu in plain.participants.values():
        assert fmu.description.fmiVersion == "3.0"
        fmu.as_block = False
    ours = simulate(plain, step=H, stop=N * H)["mass.x"]
    assert np.abs(ecos(str(path), ["mass.x"])[:, 0] - ours).max() <= 1e-12 * np.abs(ours).max()


@pytest.mark.parametrize("name", LOOPS)
def test_the_delay_that_a_jacobi_master_adds(tmp_path, name):
    """One step for each block in the loop: our sampled loop with what leaves a block one step late."""
    build, ports = LOOPS[name]
    system = build()
    late = System(dict(system.participants))
    for c in system.connections:
        block = isinstance(system.participants[c.source.participant], Block)
        late.connect(str(c.source), str(c.target), initial=0.0 if block else None)
    sampled = [simulate(s, step=H, stop=N * H) for s in (late, system)]
    theirs = ecos(str(export_ssp(system, tmp_path / "loop.ssp")), ports)
    for i, port in enumerate(ports):
        if system.participants[port.partition(".")[0]].__class__ in (Mass, Frame):
            same, other = (column(s, port) for s in sampled)
            bound = 1e-12 * np.abs(same).max()  # FMUs advance as Continuous do, to the last bits
            assert np.abs(theirs[:, i] - same).max() <= bound, port
            assert np.abs(theirs[:, i] - other).max() > 1e6 * bound, port


class Count(Block):
    """n counts the calls"""

    n = State(0.0)

    def step(self, t: float, h: float) -> None:
        self.n += 1.0


def test_a_sample_period_is_known_to_ecos(tmp_path):
    """Our annotation keeps it for us, the Open Simulation Platform's for tools that read that."""
    system = System({"slow": Count(sample_period=4 * H), "fast": Count()})
    path = export_ssp(system, tmp_path / "rates.ssp", step=H, stop=N * H)
    assert ecos(str(path), ["slow.n", "fast.n"])[-1].tolist() == [N / 4, N]
    assert read_ssp(path).participants["slow"].sample_period == 4 * H
    with pytest.raises(WiringError, match="has no component"):
        read_ssp(path, replace={"slwo": Count()})
