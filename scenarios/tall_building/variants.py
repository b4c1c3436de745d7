"""Studies beyond the thesis: imperfections of the loop, gain laws of chapter 4, actuator dynamics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from .campaign import run_all
from .criteria import LIMITS, NAMES, UNITS, broken_limits
from .study import Study

Row = dict[str, Any]

REALISM: dict[str, Row] = {
    "no noise": {"noise": 0.0},
    "noise 0.1 cm/s^2 (tables)": {},
    "noise 1 cm/s^2": {"noise": 0.01},
    "sensor dynamics": {"sensor_dynamics": True},
    "one step of delay": {"delay": 1},
    "20 steps of delay": {"delay": 20},
    "saturation at 300 kN": {"saturation": True},
    "quantisation, 12 bits": {"bits": 12},
    "actuator, 50 ms": {"actuator": 0.05},
    "all of them, one step": {
        "noise": 0.01, "sensor_dynamics": True, "delay": 1, "saturation": True, "bits": 12, "actuator": 0.05,
    },
}  # fmt: skip
"""Filtered SMC, a = 1.065, with one imperfection at a time."""

BEYOND: dict[str, Row] = {
    "filtered SMC": {"controller": "filtered-smc"},
    "SMC, M = a|s| + delta": {"controller": "smc"},
    "SMC, Algorithm I": {"controller": "algorithm-1"},
    "SMC, Algorithm II": {"controller": "algorithm-2"},
    "SMC, gain by equivalent control": {"controller": "equivalent-control-gain"},
    "passive damper": {"controller": "passive"},
    "filtered SMC, actuator 20 ms": {"controller": "filtered-smc", "actuator": 0.02},
    "filtered SMC, actuator 100 ms": {"controller": "filtered-smc", "actuator": 0.1},
    "SMC, actuator 20 ms": {"controller": "smc", "actuator": 0.02},
    "SMC, actuator 100 ms": {"controller": "smc", "actuator": 0.1},
}
"""Gain laws of chapter 4 on the tall building, and actuator dynamics (proposed in 5.2)."""

VARIANTS = {"realism": REALISM, "beyond": BEYOND}
SHOWN = ("J1", "J3", "J5", "J6", "J7", "J9", "J11", "J12", "sigma_u", "max_u", "max_xm")


def variant_rows(name: str, base: Study, workers: int = 0) -> list[Row]:
    """Return the 16 criteria of every case of a study; None where the run diverges."""
    cases = VARIANTS[name]
    found = run_all([replace(base, **options) for options in cases.values()], workers)
    return [
        {"study": name, "case": case, "criterion": criterion, "computed": result and result[criterion]}
        for case, result in zip(cases, found, strict=True)
        for criterion in NAMES
    ]


def variant_text(rows: list[Row]) -> str:
    """Return one line per case, with the hardware limits that it breaks and its largest change."""
    cases: dict[str, dict[str, float | None]] = {}
    for row in rows:
        cases.setdefault(row["case"], {})[row["criterion"]] = row["computed"]
    first = next(iter(cases))
    lines = [f"{'':<34}" + "".join(f"{n:>9}" for n in SHOWN)]
    for case, criteria in cases.items():
        values = {n: v for n, v in criteria.items() if v is not None}
        if not values:
            lines.append(f"{case:<34}   unstable")
            continue
        remarks = (
            [_change(values, cases[first])] if case != first and None not in cases[first].values() else []
        )
        remarks += [f"{n} above {LIMITS[n]:g} {UNITS[n]}" for n in broken_limits(values)]
        lines.append(f"{case:<34}" + "".join(f"{values[n]:9.4g}" for n in SHOWN) + "  " + "; ".join(remarks))
    return "\n".join(
        [*(line.rstrip() for line in lines), _verdict(cases), f"The largest change is against '{first}'."]
    )


def _change(values: Mapping[str, float], first: Mapping[str, float | None]) -> str:
    """Return the largest relative change of a criterion."""
    changes = {n: values[n] / v - 1.0 for n in SHOWN if (v := first[n])}
    name = max(changes, key=lambda n: abs(changes[n]))
    return f"{name} {changes[name]:+.1%}"


def _verdict(cases: Mapping[str, Mapping[str, float | None]]) -> str:
    """Say how many cases are unstable and how many break a limit."""
    stable = {c: {n: v for n, v in values.items() if v is not None} for c, values in cases.items()}
    unstable = [c for c, values in stable.items() if not values]
    broken = [c for c, values in stable.items() if values and broken_limits(values)]
    limits = ", ".join(f"{n} {limit:g} {UNITS[n]}" for n, limit in LIMITS.items())
    return (
        f"Of {len(cases)} cases, {len(unstable)} are unstable ({'; '.join(unstable) or 'none'}), and "
        f"{len(broken)} break a hardware limit ({'; '.join(broken) or 'none'}).\nLimits: {limits}"
    )
