"""An FMU of very many variables is read, inspected, connected and run; quadratic code would not end."""

from __future__ import annotations

import pytest

from cosim import FMU, FMUError, System, simulate
from cosim.cli.inspection import inspection
from tests.cosim.fmi.probe import write_fmu


def many(path, n):
    """Write an FMU y[i] = 2 u[i], i < n, whose names are not elements of arrays."""
    variables, unknowns = [], []
    for i in range(n):
        for k, (name, causality, start) in enumerate((("u", "input", 'start="1"'), ("y", "output", ""))):
            variables.append(
                f'<ScalarVariable name="part{i % 97}.{name}{i}" valueReference="{2 * i + k}" '
                f'causality="{causality}" variability="continuous"><Real unit="N" {start}/></ScalarVariable>'
            )
        unknowns.append(f'<Unknown index="{2 * i + 2}"/>')
    listed = "".join(unknowns)
    text = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="many" guid="many"><CoSimulation modelIdentifier="many"/>
<UnitDefinitions><Unit name="N"><BaseUnit kg="1" m="1" s="-2"/></Unit></UnitDefinitions>
<ModelVariables>{"".join(variables)}</ModelVariables><ModelStructure><Outputs>{listed}</Outputs>
<InitialUnknowns>{listed}</InitialUnknowns></ModelStructure></fmiModelDescription>"""
    return write_fmu(path, text, "many", "many.c", "rest2.c")


@pytest.mark.parametrize("n", [3_000, pytest.param(50_000, marks=pytest.mark.long)])
def test_an_fmu_of_many_variables(tmp_path, n):
    """Every output of `a` is connected to `b`, whose outputs are 4 after two steps: n connections."""
    path = many(tmp_path / "many.fmu", n)
    assert inspection(path).count("\n") > 2 * n
    with pytest.raises(FMUError, match=r"no variable 'part7\.u8'; did you mean"):
        FMU(path, start={"part7.u8": 1.0})
    a, b = FMU(path, start={f"part{i % 97}.u{i}": 1.0 for i in range(n)}), FMU(path)
    assert all(len(inputs) == n for inputs in a.feedthrough().values())
    system = System({"a": a, "b": b}, [(f"a.part{i % 97}.y{i}", f"b.part{i % 97}.u{i}") for i in range(n)])
    result = simulate(system, step=0.5, stop=1.0, record=["b.part0.y0", f"b.part{(n - 1) % 97}.y{n - 1}"])
    assert list(result["b.part0.y0"]) == list(result[f"b.part{(n - 1) % 97}.y{n - 1}"]) == [0.0, 0.0, 4.0]
