"""The scripts that a user copies: their commands run, and their numbers agree with independent ones."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cosim import Result, simulate
from cosim.cli.app import main
from fmus.export import export
from scenarios import building_in_fmpy, controller_in_ssp, external_plant
from tests.others import swing

SCENARIOS = Path(external_plant.__file__).parent


@pytest.mark.parametrize("name", ["external_plant", "building_in_fmpy", "controller_in_ssp"])
def test_an_example_is_short(name: str) -> None:
    lines = (SCENARIOS / f"{name}.py").read_text().splitlines()
    assert sum(bool(line) for line in lines) < 60


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_a_controller_on_somebody_elses_plant(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], version: str
) -> None:
    """Plants of pythonfmu against their recursion in Python, bit for bit: a shift by a sample would show.

    They state no units, so they take the force's number in kN as it is.
    """
    path = swing(tmp_path, version)
    main(["inspect", str(path)])
    text = capsys.readouterr().out
    assert f"FMI {version}" in text
    assert any(line.split()[:4] == ["m", "Real" if version == "2.0" else "Float64", "parameter", "-"]
               for line in text.splitlines())  # fmt: skip
    result = external_plant.Study(fmu=path, start={"m": 4.0}, damping=0.002, stop=5.0).run()
    x, v, xs = 1.0, 0.0, []
    for _ in range(501):
        xs.append(x)
        u = max(-8e-3, min(8e-3, -0.002 * v))
        v += 0.01 * (u - 8.0 * x) / 4.0
        x += 0.01 * v
    assert np.array_equal(result["plant.x"], xs)


def test_start_values_from_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A number, a number with a unit, and errors with their remedy."""
    monkeypatch.chdir(tmp_path)
    run = ["run", "external_plant", "--stop", "1", "--no-figures"]
    for value in ("2.0", "0.002t"):
        main([*run, "--start.m", value, "--out", value])
    one, other = (Result.load(tmp_path / value / "result.npz") for value in ("2.0", "0.002t"))
    assert np.array_equal(one["plant.x"], other["plant.x"])
    for wrong, words in (("--start.kk", "did you mean 'k'"), ("--strat", "Did you mean --start")):
        with pytest.raises(SystemExit):
            main([*run, wrong, "1.0"])
        assert words in capsys.readouterr().err


def test_the_force_is_converted_to_the_plants_unit() -> None:
    """0.4e-3 kN*s/m are 0.4 N*s/m, limited to 8 N: the energy shows the force on the plant in N."""
    result = external_plant.Study(stop=10.0).run()
    F, v = result["control.F"], result["plant.v"]
    assert np.array_equal(F, np.clip(-0.4e-3 * v, -8e-3, 8e-3))
    assert result.units["control.F"] == "kN"
    # energy of (14 m, 25 m/s) less the work of the damper: m = 1 kg, k = 0.01 N/m, c = 0.001 N*s/m
    energy = 0.5 * v**2 + 0.5 * 0.01 * result["plant.x"] ** 2
    taken = 1e3 * F[:-1] * np.diff(result["plant.x"]) - 0.001 * 0.5 * (v[1:] ** 2 + v[:-1] ** 2) * 0.01
    # the force is held, so its work over a step is exact; the trapezium of v^2 is off by h^2 / 12
    assert energy[0] + np.cumsum(taken) == pytest.approx(energy[1:], rel=1e-6)


def test_a_building_in_somebody_elses_loop(tmp_path: Path) -> None:
    """The script alone, without access to this project; its number is that of the project's loop."""
    path = export(building_in_fmpy.build().participants["building"], tmp_path / "building.fmu")
    (tmp_path / "alone").mkdir()
    script = tmp_path / "alone" / "building_in_fmpy.py"
    script.write_text((SCENARIOS / "building_in_fmpy.py").read_text())
    blocked = tmp_path / "blocked"
    for package in ("cosim", "fmus", "controllers", "scenarios"):
        (blocked / package).mkdir(parents=True)
        (blocked / package / "__init__.py").write_text("raise ImportError('the script must need FMPy only')")
    done = subprocess.run(
        [sys.executable, str(script), str(path)], capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": str(blocked)}, cwd=script.parent,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    ours = building_in_fmpy.run()["building.x"][:, 2]
    assert float(done.stdout.split()[-2]) == pytest.approx(np.abs(ours).max(), abs=5e-7)  # the digits printed
    assert np.array_equal(building_in_fmpy.shake(str(path)), ours)
    assert np.abs(ours).max() > 0.01


def test_the_loop_imports_fmpy_only() -> None:
    tree = ast.parse((SCENARIOS / "building_in_fmpy.py").read_text())
    names = {(n.module if isinstance(n, ast.ImportFrom) else n.names[0].name).split(".")[0]
             for n in tree.body if isinstance(n, (ast.Import, ast.ImportFrom))}  # fmt: skip
    assert names == {"math", "shutil", "sys", "typing", "fmpy"}


def test_a_controller_in_an_ssp(tmp_path: Path) -> None:
    """ecos computes the loop with its delays; without the delays the loop gives other numbers.

    1e-12: the ground reads the time, which ecos sums up from steps.
    """
    ssp = tmp_path / "loop.ssp"
    late = controller_in_ssp.run(ssp=ssp, late=True)["building.x"][:, 2]
    roof = np.array(controller_in_ssp.ecos(ssp))
    assert np.abs(roof - late).max() <= 1e-12 * np.abs(late).max()
    sampled = controller_in_ssp.run(ssp=ssp)
    assert np.abs(sampled["building.x"][:, 2] - roof).max() > 0.01 * np.abs(roof).max()
    python = simulate(controller_in_ssp.build(), step=controller_in_ssp.STEP, stop=controller_in_ssp.STOP)
    assert np.array_equal(python["building.x"], sampled["building.x"])


def test_another_controller_in_the_same_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    controller_in_ssp.run(ssp=Path("loop.ssp"))
    source = SCENARIOS / "controller_in_ssp.py"
    Path("mine.py").write_text(source.read_text().replace("class RoofDamper", "class Mine"))
    main(["run", "loop.ssp", "--replace", "control=mine.py:Mine", "--no-figures", "--out", "mine"])
    main(["run", "loop.ssp", "--no-figures", "--out", "own"])
    runs = [Result.load(Path(name) / "result.npz")["building.x"] for name in ("mine", "own")]
    assert (
        np.abs(runs[0] - runs[1]).max() <= 1e-12 * np.abs(runs[1]).max()
    )  # two conversions from kN, which differ in the last bits
