"""Names of `self` in kernels: a slip is named with its line before anything is compiled."""

from __future__ import annotations

import inspect

import pytest

from cosim import (
    Block,
    CompilationError,
    Continuous,
    DeclarationError,
    Input,
    Output,
    State,
    System,
    simulate,
)
from cosim.codegen.kernels import lower


class Integrator(Block):
    """Assigns self.w, which is not declared."""

    s = Input()
    u = Output()

    def step(self, t, h):
        self.w = self.s
        self.u = self.s


class Spring(Continuous):
    """Assigns self.der_w in place of self.der_v."""

    x = State(1.0)
    v = State(0.0)

    def derivatives(self, t):
        self.der_x = self.v
        self.der_w = -self.x


class Method(Block):
    """Calls a method of its own."""

    u = Output()

    def law(self, t):
        return 2.0 * t

    def step(self, t, h):
        self.u = self.law(t)


def line_of(kind, text):
    lines, first = inspect.getsourcelines(kind)
    return first + next(i for i, line in enumerate(lines) if text in line)


@pytest.mark.parametrize(
    ("kind", "text", "words"),
    [
        (Integrator, "self.w =", r"Integrator\.step .*uses self\.w, which is not declared .*available: s, u"),
        (Spring, "self.der_w =", r"Spring\.derivatives .*uses self\.der_w, .*did you mean 'der_"),
    ],
)
def test_an_undeclared_name_is_refused_with_its_line(kind, text, words):
    for use in (lower, lambda part: simulate(System({"part": part}), step=0.1, stop=0.2)):
        with pytest.raises(DeclarationError, match=words) as caught:
            use(kind())
        assert f"test_names.py, line {line_of(kind, text)})" in str(caught.value)


def test_a_method_is_not_a_variable():
    with pytest.raises(CompilationError, match=r"uses self\.law, which is not a declared variable"):
        lower(Method())
