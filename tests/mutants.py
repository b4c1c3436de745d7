"""Mistakes that the tests must catch: `python -m tests.mutants [--only NAME]`.

Each mutant changes one text in a copy of the tree, and its test must fail there. All of them once
passed every ordinary test of their area. `tests/test_mutants.py` asserts that the sources still
contain the texts, and runs the whole list under `long`.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
TREES = ("cosim", "controllers", "fmus", "scenarios", "tests", "pyproject.toml")


@dataclass(frozen=True)
class Mutant:
    """A text that occurs once in a file, its replacement, and the test that catches the change."""

    name: str
    path: str
    text: str
    replacement: str
    test: str


MUTANTS = (
    Mutant(
        "frame: rotations left-handed",
        "fmus/structures/frame.py",
        "slope = (1.0 if even else -1.0) / L",
        "slope = (-1.0 if even else 1.0) / L",
        "tests/fmus/structures/test_frame.py::test_a_cantilever_is_timoshenkos",
    ),
    Mutant(
        "frame: rigid in shear",
        "fmus/structures/frame.py",
        "phi = 12.0 * EI / (GA * L * L)",
        "phi = 0.0",
        "tests/fmus/structures/test_frame.py::test_a_cantilever_is_timoshenkos",
    ),
    Mutant(
        "bridge: damping of 8.7 %",
        "scenarios/highway_bridge/bridge.py",
        "ALPHA, BETA = 0.4912, 0.005036",
        "ALPHA, BETA = 0.7632, 0.007825",
        "tests/scenarios/highway_bridge/test_design.py::test_damping_is_5_percent_at_two_frequencies",
    ),
    Mutant(
        "scwnn: mean of errors (3.35) over m",
        "controllers/adaptive/scwnn.py",
        "self.errors[k] / (m * m)",
        "self.errors[k] / m",
        "tests/controllers/adaptive/test_scwnn_growth.py::test_a_node_needs_a_large_error_of_five_samples",
    ),
    Mutant(
        "scwnn: narrow nodes",
        "controllers/adaptive/scwnn.py",
        "rho = Parameter(0.8,",
        "rho = Parameter(0.5,",
        "tests/controllers/adaptive/test_scwnn_growth.py::test_a_new_node_has_its_width_centre_and_weight",
    ),
    Mutant(
        "scwnn: wide nodes",
        "controllers/adaptive/scwnn.py",
        "rho = Parameter(0.8,",
        "rho = Parameter(8.0,",
        "tests/controllers/adaptive/test_scwnn_growth.py::test_a_new_node_has_its_width_centre_and_weight",
    ),
    Mutant(
        "scwnn: weight of a new node with the wrong sign",
        "controllers/adaptive/scwnn.py",
        "= self.x[j] / self.eta_iw if",
        "= -self.x[j] / self.eta_iw if",
        "tests/controllers/adaptive/test_scwnn_growth.py::test_a_new_node_has_its_width_centre_and_weight",
    ),
    Mutant(
        "kinematic observer: another beta",
        "controllers/observers/kinematic_observer.py",
        "beta=alpha**2 / (2.0 - alpha)",
        "beta=alpha / (2.0 - alpha)",
        "tests/controllers/observers/test_kinematic_observer.py"
        "::test_poles_are_those_of_the_steady_kalman_filter",
    ),
    Mutant(
        "bridge: base shear of the top segment",
        "scenarios/highway_bridge/criteria.py",
        "lowest = ends[:, :, -1]",
        "lowest = ends[:, :, 0]",
        "tests/scenarios/highway_bridge/test_design.py::test_base_shear_is_that_of_the_lowest_segment",
    ),
    Mutant(
        "tuned mass damper: the actuator's reaction with the wrong sign",
        "fmus/plants/tuned_mass_damper.py",
        "self.c * self.v_m - self.u",
        "self.c * self.v_m + self.u",
        "tests/fmus/plants/test_tuned_mass_damper.py::test_reaction_is_the_opposite_of_what_moves_the_mass",
    ),
    Mutant(
        "tower: weights a floor too low",
        "scenarios/tall_building/control.py",
        "floor_46, floor_76, damper = KEPT.index(46), KEPT.index(76), len(KEPT)",
        "floor_46, floor_76, damper = KEPT.index(30), KEPT.index(60), len(KEPT)",
        "tests/scenarios/tall_building/test_control.py::test_weight_of_accelerations_is_on_floors_46_60_76",
    ),
    Mutant(
        "tower: LQG's weight of force x 100",
        "scenarios/tall_building/control.py",
        "R=1.0e-12",
        "R=1.0e-10",
        "tests/scenarios/tall_building/test_control.py::test_lqg_uses_the_force_that_its_weight_allows",
    ),
    Mutant(
        "tower: the filter three times slower",
        "scenarios/tall_building/study.py",
        '"filter", LowPass(',
        '"filter", LowPass(3.0 * ',
        "tests/scenarios/tall_building/test_control.py::test_filter_has_its_time_constant",
    ),
    Mutant(
        "tower: a wrong digit in the printed J1",
        "scenarios/tall_building/printed.csv",
        "0.372,0.379,0.381",
        "0.372,0.379,0.387",
        "tests/scenarios/tall_building/test_printed.py",
    ),
    Mutant(
        "bridge: LQG's weight of force x 100",
        "scenarios/highway_bridge/control.py",
        "R = np.eye(BEARINGS) / LIMIT**2",
        "R = 100.0 * np.eye(BEARINGS) / LIMIT**2",
        "tests/scenarios/highway_bridge/test_design.py::test_lqg_uses_the_force_that_its_weight_allows",
    ),
    Mutant(
        "chattering: case 3 without noise",
        "scenarios/chattering/study.py",
        'system.connect("noise.y", "total.u[1]")',
        "pass",
        "tests/scenarios/chattering/test_disturbances.py::test_case_3_has_white_noise_of_variance_1",
    ),
    Mutant(
        "chattering: case 4 without earthquake",
        "scenarios/chattering/study.py",
        'system.connect("ground.y", "total.u[2]")',
        "pass",
        "tests/scenarios/chattering/test_disturbances.py::test_case_4_has_el_centro_in_g",
    ),
    Mutant(
        "algorithm II: limited before the fall",
        "controllers/laws/algorithm_2.py",
        "M = self.M + self.alpha * h",
        "M = clip(self.M + self.alpha * h, self.M1, self.M2)",
        "tests/controllers/laws/test_algorithm_2.py::test_gain_by_hand",
    ),
)


def passes(tree: Path, tests: Sequence[str]) -> bool:
    """Run tests in a copy of the tree; raise RuntimeError where pytest cannot run them."""
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-x", *tests]
    env = os.environ | {"PYTHONPATH": str(tree)}
    done = subprocess.run(command, cwd=tree, env=env, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        raise RuntimeError(f"pytest ended with {done.returncode}:\n{done.stdout}{done.stderr}")
    return done.returncode == 0


def killed(mutants: Sequence[Mutant]) -> Iterator[tuple[Mutant, bool]]:
    """Yield each mutant and whether its test fails on it; the tests must pass without any."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder)
        for name in TREES:
            if (ROOT / name).is_dir():
                shutil.copytree(ROOT / name, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(ROOT / name, tree / name)
        if not passes(tree, sorted({m.test for m in mutants})):
            raise RuntimeError("the tests fail without a mutant; correct that first")
        for mutant in mutants:
            file = tree / mutant.path
            original = file.read_text()
            file.write_text(original.replace(mutant.text, mutant.replacement))
            yield mutant, not passes(tree, [mutant.test])
            file.write_text(original)


def main() -> None:
    """Print a line for each mutant; exit with 1 if one survives."""
    parser = argparse.ArgumentParser(description="Run each mutant against the test that must see it.")
    parser.add_argument("--only", action="append", metavar="NAME", help="a part of a mutant's name")
    only = parser.parse_args().only
    chosen = [m for m in MUTANTS if not only or any(name in m.name for name in only)]
    survived = 0
    for mutant, dead in killed(chosen):
        print(f"{'killed' if dead else 'SURVIVED':9} {mutant.name}", flush=True)
        survived += not dead
    print(f"{len(chosen) - survived} killed, {survived} survived")
    sys.exit(1 if survived else 0)


if __name__ == "__main__":
    main()
