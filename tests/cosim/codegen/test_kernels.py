"""From kernels to machine code: the cache, its key, and kernels that cannot be compiled."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import textwrap
import types

import numpy as np
import pytest

from cosim import (
    Block,
    CompilationError,
    Continuous,
    Input,
    Local,
    Output,
    Parameter,
    State,
    System,
    simulate,
)
from cosim.codegen import kernels as compiler
from tests.cosim.parts import Gain, Mass

GRAVITY = 9.81


def weight(m, g=GRAVITY, *, factor=1.0):
    return m * g * factor


class Heavy(Block):
    m = Parameter(2.0)
    F = Output()

    def step(self, t, h):
        self.F = weight(self.m) + math.sqrt(GRAVITY)


def changed(function, name, value):
    """The same function in a module where one global is another."""
    return types.FunctionType(
        function.__code__, function.__globals__ | {name: value}, function.__name__, function.__defaults__
    )


def test_the_key_covers_helpers_constants_defaults_and_modules():
    key = compiler.fingerprint({"step": Heavy.step})
    assert key == compiler.fingerprint({"step": Heavy.step})
    constants = types.ModuleType("my_constants")
    constants.GRAVITY = 1.0

    def other_default(m, g=1.62, *, factor=1.0):
        return m * g * factor

    def other_body(m, g=GRAVITY, *, factor=1.0):
        return m * g + factor

    def from_module(self, t, h):
        self.F = constants_here.GRAVITY  # noqa: F821

    variants = [
        changed(Heavy.step, "GRAVITY", 9.80665),
        changed(Heavy.step, "weight", other_default),
        changed(Heavy.step, "weight", other_body),
        changed(from_module, "constants_here", constants),
    ]
    keys = {compiler.fingerprint({"step": variant}) for variant in variants}
    constants.GRAVITY = 2.0
    keys |= {compiler.fingerprint({"step": variants[-1]}), key}
    assert len(keys) == 6
    same = types.FunctionType(Heavy.step.__code__.replace(co_firstlineno=999), Heavy.step.__globals__)
    assert compiler.fingerprint({"step": same}) == key  # a moved line changes nothing


def test_the_key_covers_the_layout():
    assert compiler.kernel_key(Gain()) == compiler.kernel_key(Gain(K=3.0))

    class Bigger(Gain):
        more = Local(0.0, shape=3)

    assert compiler.kernel_key(Gain()) != compiler.kernel_key(Bigger())


SCRIPT = """
    import sys
    from cosim import Block, Continuous, Input, Output, Parameter, State, System, simulate
    from tests.cosim.parts import Gain, Mass
    links = [("m.x", "g.x"), ("g.u", "m.u")]
    result = simulate(System({"m": Mass(), "g": Gain()}, links), step=0.01, stop=1.0)
    print("numba" in sys.modules, result["m.x"][-1].hex())
"""


def test_a_second_process_finds_everything_in_the_cache(tmp_path):
    """Without Numba, and with the same bits."""
    environment = os.environ | {"STRUCTCOSIM_CACHE": str(tmp_path), "PYTHONPATH": os.getcwd()}
    outputs = []
    for _ in range(2):
        command = [sys.executable, "-c", textwrap.dedent(SCRIPT)]
        done = subprocess.run(
            command, capture_output=True, text=True, env=environment, timeout=300, check=True
        )
        outputs.append(done.stdout.split())
    assert [imported for imported, _ in outputs] == ["True", "False"]
    assert outputs[0][1] == outputs[1][1]


class Allocates(Block):
    x = Input(shape=3)
    y = Output()

    def step(self, t, h):
        double = self.x * 2.0
        self.y = double[1]


class Assigns(Allocates):
    z = Output(shape=3)

    def step(self, t, h):
        self.z[:] = self.x


class Copies(Block):
    """z is a copy of y, not another name for it."""

    y = Output(shape=3)
    z = Output(shape=3)

    def step(self, t, h):
        self.y[1] = 2.0 * t
        self.z = self.y
        self.y[1] = -1.0


class Returns(Allocates):
    def step(self, t, h):
        self.y = 1.0
        return self.y, 2.0


class Unknown(Allocates):
    def step(self, t, h):
        self.y = nowhere(self.x)  # noqa: F821


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (Allocates, "allocates an array; write into a declared Local"),
        (Assigns, "allocates an array"),
        (Returns, "returns a value .* writes to self"),
        (Unknown, "nowhere"),
    ],
)
def test_what_cannot_be_compiled_names_class_kernel_and_remedy(kind, words):
    with pytest.raises(CompilationError, match=f"{kind.__name__}: kernel_step .*{words}"):
        compiler.lower(kind())


@pytest.mark.parametrize("jit", [True, False])
def test_assigning_an_array_copies_it(jit):
    result = simulate(System({"c": Copies()}), step=1.0, stop=2.0, jit=jit)
    assert result["c.z"].tolist() == [[0, 0, 0], [0, 2, 0], [0, 4, 0]]
    assert result["c.y"].tolist() == [[0, -1, 0]] * 3


def test_the_code_needs_libm_at_most():
    """One text for the loop and for an FMU: without Numba, Python or the name of a machine."""
    import llvmlite.binding as llvm

    class Curve(Continuous):
        u = Input()
        x = State(0.3)
        y = Output()

        def derivatives(self, t):
            self.der_x = math.sin(self.u + t) - math.exp(-self.x)

        def outputs(self, t):
            self.y = math.atan2(self.x, 2.0)

    text = compiler.lower(Curve())
    assert "target triple" not in text
    module = llvm.parse_assembly(text)
    external = {f.name for f in module.functions if f.is_declaration and not f.name.startswith("llvm.")}
    assert external <= compiler.LIBM
    kernels = {f.name for f in module.functions if not f.is_declaration and f.linkage.name == "external"}
    assert kernels == {"kernel_derivatives", "kernel_outputs", "kernel_advance"}
    run = simulate(System({"c": Curve(), "m": Mass()}, [("m.x", "c.u")]), step=0.1, stop=2.0)
    by_python = simulate(System({"c": Curve(), "m": Mass()}, [("m.x", "c.u")]), step=0.1, stop=2.0, jit=False)
    # sin, exp and atan2 are the C library's in both; a vector form may differ in the last digit
    assert run["c.y"] == pytest.approx(by_python["c.y"], rel=1e-14)
    assert np.ptp(run["c.y"]) > 0.1


IR = """
declare double @"{symbol}"(double)
define i32 @"kernel_outputs"(ptr %self, double %t, double %h) {{
  %y = call double @"{symbol}"(double %t)
  ret i32 0
}}
"""


@pytest.mark.parametrize(
    ("symbol", "remedy"),
    [
        ("NRT_Allocate", "declared Local"),
        ("PyErr_Format", "Python runtime"),
        ("mystery", "only functions of libm"),
    ],
)
def test_a_symbol_that_compiled_code_does_not_have_is_named_with_its_remedy(symbol, remedy):
    import llvmlite.binding as llvm

    module = llvm.parse_assembly(IR.format(symbol=symbol))
    with pytest.raises(CompilationError, match=f"kernel_outputs needs '{symbol}'.*{remedy}"):
        compiler.check_symbols(module, "kernel_outputs")
    for known in ("hypot", "llvm.sqrt.f64"):
        compiler.check_symbols(llvm.parse_assembly(IR.format(symbol=known)), "kernel_outputs")
