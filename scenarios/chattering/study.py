"""Chapter 4: six cases of chattering in sliding mode control, and gains that reduce it.

Plant (4.1), (4.2), as a native FMU: x1' = x2, x2' = -(k/m) x1 - (c/m) x2 + u + d, from
(14, 25). Controller: s = x2 + a x1, u = -M sgn(s) (4.4).

    case  sensor dynamics  noise  El Centro  disturbance     M     tuned gain
    1     -                -      -          -              100    Algorithm I
    2     1/(mu s + 1)^2   -      -          -              100    Algorithm I
    3     -                yes    -          -              300    Algorithm II
    4     -                -      yes        -              300    Algorithm II
    5     -                -      -          25 (sin t + 1) 300    Algorithm II, beta = 100
    6     yes              yes    yes        yes            150    Algorithm II

The thesis does not state its numerics. Its numbers are those of the fixed-step method
ode3 at 0.01 s with the controller called at every solver stage (coupling "continuous");
a controller that samples (coupling "sampled") gives others. Both are in the table.

Nor does it state the unit of the earthquake: figure 4.28 is in g, and x2' has no units
anywhere in the chapter. By default the record's numbers in g are added to x2', as the
figure suggests; `ground_unit="m/s^2"` adds what the ground really does. The norms of
case 4 hardly differ (905.0 and 905.4), so the print does not tell.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from controllers.laws.algorithm_1 import AlgorithmI
from controllers.laws.algorithm_2 import AlgorithmII
from controllers.laws.constant_gain import ConstantGain
from controllers.laws.equivalent_control import EquivalentControlGain
from controllers.laws.phase_plane_surface import PhasePlaneSurface
from controllers.laws.state_dependent import StateDependentGain
from controllers.laws.switching import HysteresisControl, SaturationControl
from cosim import Block, G, Result, System, el_centro, simulate
from cosim.blocks import RecordSource, SensorDynamics, WeightedSum, WhiteNoise, function_source
from fmus.export import as_fmu
from fmus.plants.oscillator import Oscillator

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CaseNumber = Literal[1, 2, 3, 4, 5, 6]
Gain = Literal[
    "constant",
    "algorithm-1",
    "algorithm-2",
    "state-dependent",
    "equivalent-control",
    "saturation",
    "hysteresis",
]
GAINS: tuple[Gain, ...] = get_args(Gain)
#: nothing to iterate here: no plant drives another one
Coupling = Literal["sampled", "continuous"]
Plant = Literal["fmu", "python"]
GroundUnit = Literal["g", "m/s^2"]
STEP, STOP = 0.01, 40.0
SPREAD = range(1, 11)  # seeds over which the table gives the spread of a noisy case
RECORDED = ("plant.x", "plant.v", "control.u", "control.M", "control.sgn")


@dataclass(frozen=True)
class Case:
    """What a case has, and what the thesis prints: (norm of u, mean of sgn s) by gain."""

    title: str
    tuned: Gain
    M: float
    sensor: bool = False
    noise: bool = False
    ground: bool = False
    disturbance: bool = False
    beta: float = 300.0
    printed: tuple[tuple[Gain, float, float | None], ...] = ()


CASES: dict[int, Case] = {
    1: Case(
        "nothing unmodelled",
        "algorithm-1",
        100.0,
        printed=(("constant", 6335.0, 0.0027), ("algorithm-1", 672.0, 0.1032)),
    ),
    2: Case(
        "sensor dynamics",
        "algorithm-1",
        100.0,
        sensor=True,
        printed=(("constant", 6324.0, 0.0075), ("algorithm-1", 765.0, 0.0745)),
    ),
    3: Case(
        "white noise",
        "algorithm-2",
        300.0,
        noise=True,
        printed=(("constant", 18976.0, None), ("algorithm-2", 153.0, None)),
    ),
    4: Case(
        "El Centro",
        "algorithm-2",
        300.0,
        ground=True,
        printed=(("constant", 18976.0, None), ("algorithm-2", 905.0, None)),
    ),
    5: Case(
        "disturbance 25 (sin t + 1)",
        "algorithm-2",
        300.0,
        disturbance=True,
        beta=100.0,
        printed=(("constant", 18976.0, None), ("algorithm-2", 2491.0, None)),
    ),
    6: Case(
        "all of them",
        "algorithm-2",
        150.0,
        sensor=True,
        noise=True,
        ground=True,
        disturbance=True,
        printed=(("constant", 9487.0, None), ("algorithm-2", 2623.0, None)),
    ),
}

NOTES: dict[tuple[int, str], str] = {
    (1, "constant"): "print: probably 6325 (100 sqrt 4001); its means are magnitudes",
    (3, "algorithm-2"): "153 is not reproduced: s = 0 cannot be reached from (14, 25) at so little effort",
    (6, "constant"): "print: M = 300, but 9487 = 150 sqrt 4000, so M = 150 here",
}


def disturbance(t: float) -> float:
    """Return 25 (sin t + 1), case 5."""
    return 25.0 * (math.sin(t) + 1.0)


def gain_law(case: Case, gain: Gain) -> Block:
    """Return the controller u = -M sgn(s) with one of the gain laws, its numbers as in the thesis."""
    laws: dict[str, Block] = {
        "constant": ConstantGain(M_0=case.M),
        "algorithm-1": AlgorithmI(M=case.M),
        "algorithm-2": AlgorithmII(beta=case.beta),
        "state-dependent": StateDependentGain(),
        "equivalent-control": EquivalentControlGain(M_0=case.M),
        "saturation": SaturationControl(M_0=case.M, scaled=1.0),
        "hysteresis": HysteresisControl(M_0=case.M),
    }
    return laws[gain]


def build(
    *,
    case: CaseNumber = 1,
    gain: Gain | Literal["tuned"] = "tuned",
    seed: int = 1,
    plant: Plant = "fmu",
    ground_unit: GroundUnit = "g",
) -> System:
    """Return the system of a case: plant, sliding surface, controller, and what disturbs them."""
    this = CASES[case]
    law = this.tuned if gain == "tuned" else gain
    oscillator = Oscillator()
    system = System({"plant": as_fmu(oscillator) if plant == "fmu" else oscillator})
    system.add("surface", PhasePlaneSurface())
    system.add("control", gain_law(this, law))
    system.connect("plant.x", "surface.x1")
    system.connect("plant.v", "surface.x2")
    if law == "state-dependent":
        system.connect("plant.x", "control.x[1]")
        system.connect("plant.v", "control.x[2]")
    if this.sensor:
        system.add("sensor", SensorDynamics())
        system.connect("surface.s", "sensor.u")
        system.connect("sensor.y", "control.s")
    else:
        system.connect("surface.s", "control.s")
    if this.noise or this.ground or this.disturbance:
        system.add("total", WeightedSum([1.0, 1.0, 1.0], unit="m/s^2"))
        if this.noise:
            system.add("noise", WhiteNoise(seed=seed, sample_period=STEP, unit="m/s^2"))
            system.connect("noise.y", "total.u[1]")
        if this.ground:
            scale = 1.0 / G if ground_unit == "g" else 1.0
            system.add("ground", RecordSource(el_centro(), scale=scale))
            system.connect("ground.y", "total.u[2]")
        if this.disturbance:
            system.add("force", function_source(disturbance, unit="m/s^2"))
            system.connect("force.y", "total.u[3]")
        system.connect("total.y", "plant.d")
    system.connect("control.u", "plant.u")
    return system


def run(
    *,
    case: CaseNumber = 1,
    gain: Gain | Literal["tuned"] = "tuned",
    coupling: Coupling = "continuous",
    seed: int = 1,
    plant: Plant = "fmu",
    ground_unit: GroundUnit = "g",
    progress: Any = None,
) -> Result:
    """Run one of the six cases of chapter 4.

    Parameters
    ----------
    case
        1 nothing unmodelled, 2 sensor dynamics, 3 noise, 4 El Centro, 5 disturbance, 6 all of 2 to 5
    gain
        gain law; tuned is the thesis' algorithm for the case
    coupling
        continuous: controller at every solver stage, as in the thesis; sampled: as a real one
    seed
        of the white noise, cases 3 and 6
    plant
        step the plant as a native FMU, or as Python in the loop
    ground_unit
        add the earthquake's numbers in g to x2', as figure 4.28 suggests, or its acceleration in m/s^2
    """
    system = build(case=case, gain=gain, seed=seed, plant=plant, ground_unit=ground_unit)
    return simulate(
        system, step=STEP, stop=STOP, coupling=coupling, solver="ode3", record=RECORDED, progress=progress
    )


def metrics(result: Result) -> dict[str, tuple[float, str]]:
    """Return the numbers that the thesis prints, and the chattering of u."""
    u, x = result["control.u"], result["plant.x"]
    return {
        "norm(u)": (result.statistics["control.u"].norm, "N"),
        "mean(sgn s)": (result.statistics["control.sgn"].mean, "1"),
        "changes of sign of u": (float(np.sum(u[1:] * u[:-1] < 0)), "1"),
        "final M": (float(result["control.M"][-1]), "N"),
        "final x": (float(x[-1]), "m"),
    }


def table(*, seed: int = 1, plant: Plant = "fmu", comparison: bool = True) -> list[dict[str, Any]]:
    """Run all cases and compare with the print.

    Parameters
    ----------
    seed
        of the white noise, cases 3 and 6
    plant
        step the plant as a native FMU, or as Python in the loop
    comparison
        add the gain laws that the thesis mentions and does not run
    """
    rows = []
    for number, gain, coupling in _runs(comparison):
        printed = {law: (norm, mean) for law, norm, mean in CASES[number].printed}
        result = run(case=number, gain=gain, coupling=coupling, seed=seed, plant=plant)
        norm, mean = printed.get(gain, (None, None))
        rows.append(
            {
                "case": number,
                "gain": gain,
                "coupling": coupling,
                "norm_u": result.statistics["control.u"].norm,
                "mean_sgn": result.statistics["control.sgn"].mean,
                "printed_norm_u": norm,
                "printed_mean_sgn": mean,
                "note": _note(number, gain, coupling, plant),
            }
        )
    return rows


def _runs(comparison: bool) -> Iterator[tuple[CaseNumber, Gain, Coupling]]:
    """Yield what the table runs: every case, gain law and coupling."""
    for number in get_args(CaseNumber):
        for gain in GAINS if comparison else (law for law, _, _ in CASES[number].printed):
            for coupling in get_args(Coupling):
                yield number, gain, coupling


def _note(number: CaseNumber, gain: Gain, coupling: Coupling, plant: Plant) -> str:
    """Return what has to be said about a cell: a misprint, or how far the noise moves it."""
    notes = [NOTES[number, gain]] if (number, gain) in NOTES else []
    if CASES[number].noise and gain == CASES[number].tuned:
        runs = (run(case=number, gain=gain, coupling=coupling, seed=s, plant=plant) for s in SPREAD)
        norms = [r.statistics["control.u"].norm for r in runs]
        notes.append(f"{min(norms):.0f} to {max(norms):.0f} over {len(norms)} seeds ({coupling})")
    return "; ".join(notes)


def table_text(rows: list[dict[str, Any]]) -> str:
    """Return the table: a line a case and gain, the print beside both couplings."""
    head = (
        f"{'case':<4}  {'gain':<18}  |  {'norm(u): printed':>16} {'continuous':>10} {'sampled':>10}  |"
        f"  {'mean(sgn s): printed':>20} {'continuous':>10} {'sampled':>8}"
    )
    lines = [head, "-" * len(head)]
    pairs: dict[tuple[int, str], dict[str, dict[str, Any]]] = {}
    for row in rows:
        pairs.setdefault((row["case"], row["gain"]), {})[row["coupling"]] = row
    for (case, gain), by in pairs.items():
        c, s = by["continuous"], by["sampled"]
        norm = "-" if c["printed_norm_u"] is None else f"{c['printed_norm_u']:.0f}"
        mean = "-" if c["printed_mean_sgn"] is None else f"{c['printed_mean_sgn']:.4f}"
        note = f"  {c['note']}" if c["note"] else ""
        lines.append(
            f"{case:<4}  {gain:<18}  |  {norm:>16} {c['norm_u']:>10.2f} {s['norm_u']:>10.2f}  |"
            f"  {mean:>20} {c['mean_sgn']:>+10.5f} {s['mean_sgn']:>+8.5f}{note}"
        )
    return "\n".join(lines)


_PHASE = ("displacement x₁ (m)", "velocity x₂ (m/s)")


def figures(result: Result) -> dict[str, Figure]:
    """Return the thesis' figures of a case: phase plane, close-up, x1(t), u(t) and its close-up, M(t)."""
    x, v, u, M = (result[n] for n in ("plant.x", "plant.v", "control.u", "control.M"))
    t = result.time
    sliding = (x < 0.5 * x.max()) & (x > 0.25 * x.max()) & (t > t[x.argmax()])
    drawn = {
        "phase_plane": _plot(x, v, "displacement x₁ (m)", "velocity x₂ (m/s)", "Phase plane", surface=True),
        "phase_plane_close_up": _plot(
            x[sliding], v[sliding], *_PHASE, "Phase plane, close-up of the sliding mode", surface=True
        ),
        "displacement": _plot(t, x, "time (s)", "displacement x₁ (m)", "Displacement"),
        "control_force": _plot(t, u, "time (s)", "control force u (N)", "Control force"),
        "control_force_close_up": _plot(
            t[500:600], u[500:600], "time (s)", "control force u (N)", "Control force, close-up", steps=True
        ),
        "gain": _plot(t, M, "time (s)", "sliding gain M (N)", "Sliding gain"),
    }
    return drawn


def _plot(
    x: Any, y: Any, x_label: str, y_label: str, title: str, *, surface: bool = False, steps: bool = False
) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 4.0))
    axes = figure.add_axes((0.14, 0.13, 0.83, 0.78))  # fixed: laying out costs as much as drawing
    axes.plot(x, y, linewidth=0.8, drawstyle="steps-post" if steps else "default", label="trajectory")
    if surface:
        ends = np.array([np.min(x), np.max(x)])
        axes.plot(ends, -ends, "--", color="tab:red", linewidth=1.0, label="sliding surface x₂ = -x₁")
        axes.legend()
    axes.set(xlabel=x_label, ylabel=y_label, title=title)
    axes.grid(alpha=0.3)
    return figure
