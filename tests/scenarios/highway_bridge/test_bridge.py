"""The reduced bridge and the 430-degree-of-freedom model, against the benchmark's figures.

The uncontrolled responses come from the benchmark's own code. Tests that need the benchmark's files
read them from the folder in BENCHMARK_DATA (sub-folder highway_bridge); without it they are skipped
with a reason.
"""

from __future__ import annotations

import json
from functools import cache

import numpy as np
import pytest
import scipy.linalg as la

from cosim import System, simulate
from cosim.blocks.sources import RecordSource
from scenarios.highway_bridge.benchmark import benchmark_bridge
from scenarios.highway_bridge.bridge import EI, M_Y, highway_bridge
from scenarios.highway_bridge.earthquakes import earthquake
from tests.benchmark_data import BRIDGE, needs_data

FILES = {"el-centro": "Elcentro", "chi-chi": "Chichi084", "northridge": "Rinadi"}


def dense(bridge, name):
    """Return a matrix of the plant from its stored upper triangle."""
    n = len(bridge.M)
    A = np.zeros((n, n))
    start, row = bridge.A_start.astype(int), bridge.A_row.astype(int)
    for j in range(n):
        for p in range(start[j], start[j + 1]):
            A[row[p], j] = A[j, row[p]] = getattr(bridge, name)[p]
    return A


@cache
def uncontrolled(model, name, step, stop=None, folder=None):
    """Return the response from rest: midspan, bearings, moments, curvatures, energy."""
    bridge = (
        highway_bridge()
        if model == "reduced"
        else benchmark_bridge(BRIDGE, late_events=model == "late", bisections=0 if model == "late" else 5)
    )
    quake = earthquake(name, folder)
    stop = quake.duration if stop is None else stop
    steps = round(stop / step - 1e-6)
    means = quake.step_means(step, steps * step)
    sources = {
        axis: RecordSource(means[:, i], step, interpolation="hold", unit="m/s^2")
        for i, axis in enumerate("xy")
    }
    system = System({"bridge": bridge, **sources}, [("x.y", "bridge.ground[1]"), ("y.y", "bridge.ground[2]")])
    ports = ["y", "a", "deformation", "force", "plastic", "energy", "failure"]
    return simulate(system, step=step, stop=steps * step, record=[f"bridge.{p}" for p in ports])


def curvatures(result):
    return result["bridge.force"][:, 16:] / EI + result["bridge.plastic"][:, 16:]


def yielded(result):
    return int((np.abs(curvatures(result)).max(axis=0) > M_Y / EI).sum())


def test_frequencies_of_the_reduced_bridge():
    """The first five within 3 % (the sixth is too): members of 14.6 m instead of 3.9 m."""
    bridge = highway_bridge()
    values = la.eigh(dense(bridge, "K"), np.diag(bridge.M), eigvals_only=True)
    frequencies = np.sqrt(values[:6]) / (2 * np.pi)
    assert frequencies == pytest.approx([1.213, 1.242, 1.518, 1.655, 1.733, 2.854], rel=0.03)


def test_masses_of_the_reduced_bridge():
    """Horizontal mass 4,236,379 kg; lumping along members loses nothing but rounded sections (0.2 %)."""
    bridge = highway_bridge()
    for direction in (0, 1):
        assert (bridge.M * bridge.influence[direction]).sum() == pytest.approx(4_236_379.0, rel=2e-3)


def test_reduced_bridge_under_el_centro():
    """With the PEER processing of the record, which is weaker than the benchmark's: no column yields,
    the energy balance closes to 1e-4 and the bearings yield."""
    result = uncontrolled("reduced", "el-centro", 0.005, 20.0)
    energy = result["bridge.energy"]
    assert np.abs(energy[:, :2].sum(axis=1) - energy[:, 2:].sum(axis=1)).max() < 1e-4 * energy[-1, 0]
    assert yielded(result) == 0
    assert np.abs(result["bridge.deformation"][:, :16]).max() > 3 * 0.015
    assert (result["bridge.failure"][:, 0] == -1.0).all()


@needs_data
@pytest.mark.long
@pytest.mark.parametrize("name", ["n-palm-springs", "chi-chi", "el-centro", "northridge", "turkey", "kobe"])
def test_reduced_bridge_against_the_full_model(name):
    """Midspan and bearing peaks within 15 %, the same number of yielded column ends."""
    records = BRIDGE / "records"
    reduced = uncontrolled("reduced", name, 0.005, folder=records)
    full = uncontrolled("full", name, 0.005, folder=records)
    for port, columns in (("y", slice(None)), ("deformation", slice(16))):
        a, b = (np.abs(r[f"bridge.{port}"][:, columns]).max() for r in (reduced, full))
        assert a == pytest.approx(b, rel=0.15)
    assert yielded(reduced) == yielded(full)


def full_model(name, late):
    return uncontrolled("late" if late else "full", name, 0.002, folder=BRIDGE / "records")


@needs_data
@pytest.mark.parametrize(
    "name", ["el-centro", pytest.param("northridge"), pytest.param("chi-chi", marks=pytest.mark.long)]
)
def test_full_model_reproduces_the_benchmark(name):
    """With events a step late, as in the benchmark's code, histories agree to 1e-4 relative RMS (the
    files have six digits) and all peaks to 1e-4, with 0, 4 and 6 yielded column ends."""
    result = full_model(name, late=True)
    stored = np.load(BRIDGE / "uncontrolled" / f"{FILES[name]}.npz")
    ours = {
        "mid_x": result["bridge.y"][:, 0], "mid_y": result["bridge.y"][:, 1],
        "acc_x": result["bridge.a"][:, 0], "acc_y": result["bridge.a"][:, 1],
        "bearing1_x": result["bridge.deformation"][:, 0], "bearing1_y": result["bridge.deformation"][:, 1],
    }  # fmt: skip
    n = min(len(stored["t"]), len(result.time) // 2)
    for key, values in ours.items():
        error = values[: 2 * n : 2] - stored[key][:n]
        assert np.sqrt((error**2).mean() / (stored[key][:n] ** 2).mean()) < 1e-4, key
    peaks = json.loads((BRIDGE / "uncontrolled" / "peaks.json").read_text())[FILES[name]]
    moments = result["bridge.force"][:, 16:]
    shear = (
        np.abs(moments[:, 16::20] + moments[:, 17::20]).max(),
        np.abs(moments[:, 18::20] + moments[:, 19::20]).max(),
    )
    found = {
        "Fb_N": max(shear) / 0.732, "Mb_Nm": np.abs(moments).max(),
        "phi_1pm": np.abs(curvatures(result)).max(),
        "y_mid_m": np.abs(result["bridge.y"]).max(), "a_mid_ms2": np.abs(result["bridge.a"][:, :2]).max(),
        "y_bear_m": np.abs(result["bridge.deformation"][:, :16]).max(),
    }  # fmt: skip
    assert found == pytest.approx({k: peaks[k] for k in found}, rel=1e-4)
    assert yielded(result) == {"el-centro": 0, "northridge": 4, "chi-chi": 6}[name]


@needs_data
@pytest.mark.long
@pytest.mark.parametrize("name", ["northridge", "chi-chi"])
def test_located_events_differ_from_late_ones_as_much_as_one_step_overshoots(name):
    """Base shear, moment, displacement, acceleration and bearing within 2 %, curvature within 5 %: a
    column that yields a step of 2 ms late carries 1 MN*m more, and is bent less."""
    late, exact = full_model(name, late=True), full_model(name, late=False)
    for port, columns, bound in (
        ("y", slice(None), 0.02),
        ("a", slice(2), 0.02),
        ("force", slice(16, None), 0.02),
    ):
        a, b = (np.abs(r[f"bridge.{port}"][:, columns]).max() for r in (late, exact))
        assert b == pytest.approx(a, rel=bound)
    assert np.abs(curvatures(exact)).max() == pytest.approx(np.abs(curvatures(late)).max(), rel=0.05)
    assert yielded(late) == yielded(exact)
