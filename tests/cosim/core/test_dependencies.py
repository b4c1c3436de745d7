"""Feedthrough: exact on small kernels, and never less than numerical differences show."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import Block, Continuous, Input, LinearContinuous, Local, Output, Parameter, Participant, State
from cosim.core.dependencies import dependencies
from cosim.functions import assign, clip, dot, expm, matvec, solve, transposed_matvec, transposed_matvec_add


class Plant(Continuous):
    """x from v, v from force and ground; one output of each kind."""

    f = Input()
    g = Input()
    x = State()
    v = State()
    a = Output()
    drift = Output()
    clock = Output()

    def derivatives(self, t):
        self.der_x = self.v
        self.der_v = self.f - 2.0 * self.x

    def outputs(self, t):
        self.a = self.der_v + self.g
        self.drift = self.x
        self.clock = t


class StateSpace(LinearContinuous):
    """x' = A x + B u, y = C x: a call writes its last argument only."""

    A = Parameter(shape=("n", "n"))
    B = Parameter(shape=("m", "n"))  # transposed
    C = Parameter(shape=("p", "n"))
    u = Input(shape="m")
    x = State(shape="n")
    y = Output(shape="p")

    def derivatives(self, t):
        transposed_matvec(self.A, self.x, self.der_x)
        transposed_matvec_add(self.B, self.u, self.der_x)

    def outputs(self, t):
        matvec(self.C, self.x, self.y)


class Alias(Block):
    """A local name for an output array."""

    u = Input(shape=3)
    w = Input()
    y = Output(shape=3)
    z = Output(shape=3)

    def step(self, t, h):
        target = self.y
        for i in range(self.z.shape[0]):
            target[i] = self.u[i]
            self.z[i] = self.w


class EarlyReturn(Block):
    """Statements after a conditional return depend on its condition."""

    u = Input()
    w = Input()
    y = Output()

    def step(self, t, h):
        if self.u > 0.0:
            return
        self.y = self.w


class Vectors(Block):
    """Written through the vector of the states, read by name."""

    u = Input(shape=2)
    w = Input()
    p = State()
    q = State()
    y = Output()

    def step(self, t, h):
        self.state_vector[1] = dot(self.u, self.u)
        self.y = self.q


class Branch(Block):
    """Conditions, loops, tuples, walrus."""

    a = Input()
    b = Input()
    c = Input()
    d = Input()
    y = Output()
    z = Output()

    def step(self, t, h):
        low, high = self.a, self.b
        if self.c > 0.0:
            self.y = clip(low, -1.0, 1.0)
        self.z = high + (self.d if (n := self.a) > 0 else n)


EXACT = [
    (Plant(), {"a": "fxg", "drift": "x", "clock": "", "der_x": "v", "der_v": "fx"}),
    (StateSpace(A=np.eye(3), B=np.ones((2, 3)), C=np.ones((4, 3))), {"y": "x", "der_x": "xu"}),
    (Alias(), {"y": "u", "z": "w"}),
    (EarlyReturn(), {"y": "uw"}),
    (Vectors(), {"y": "uq"}),
    (Branch(), {"y": "ac", "z": "abd"}),
]


@pytest.mark.parametrize(("participant", "wanted"), EXACT, ids=lambda x: type(x).__name__)
def test_dependencies_are_exact_on_small_kernels(participant, wanted):
    assert dependencies(participant) == {name: set(letters) for name, letters in wanted.items()}


class Listener(Block):
    compiled = False
    u = Input()
    y = Output()

    def step(self, t, h):
        self.seen.append(self.u)
        self.y = self.seen[0]


class Helper(Block):
    u = Input()
    w = Input()
    y = Output()

    def step(self, t, h):
        touch(self)


def touch(block):
    block.y = block.u


@pytest.mark.parametrize("participant", [Listener(), Helper()], ids=lambda x: type(x).__name__)
def test_what_cannot_be_read_depends_on_everything(participant):
    inputs = {n for n, v in participant.variables.items() if v.kind == "input"}
    assert dependencies(participant) == {"y": inputs}


class Tangle(Block):
    """Everything at once: calls that write through aliases, nested calls, branches, loops, vectors."""

    u = Input(shape=2)
    w = Input(start=0.3)
    k = Input(start=0.7)
    x = State(0.2, shape=2)
    p = Output(shape=2)
    q = Output()
    r = Output()
    s = Output(shape=2)
    work = Local(0.0, shape=(4, 2, 2))
    rows = Local(0.0, shape=(2, 1))

    def step(self, t, h):
        M = self.work[0]
        M[0, 0], M[1, 0] = self.u[0], self.w
        M[0, 1] = 0.5
        M[1, 1] = -0.4
        expm(self.work)
        for i in range(2):
            self.rows[i, 0] = self.x[i]
            self.s[i] = self.k if i == 0 else 1.0
        solve(self.work[0], self.rows)
        self.p[0] = self.rows[0, 0]
        total = 0.0
        for i in range(2):
            if self.x[i] > 10.0:
                break
            total += self.s[i] * math.cos(self.k)
        self.q = total
        assign(self.p, self.state_vector)
        self.r = self.x[0] if self.u[1] > 0.5 else self.w


PROBED = [Tangle(), *(p for p, _ in EXACT)]


@given(index=st.integers(0, len(PROBED) - 1), seed=st.integers(0, 2**31))
def test_an_input_that_changes_an_output_is_listed(index, seed):
    """Two evaluations that differ in one input or state: every output that differs must list it."""
    random = np.random.default_rng(seed)
    participant = PROBED[index].fresh()
    names = [n for n, v in participant.variables.items() if v.kind in ("input", "state")]
    for v in participant.variables.values():
        if v.kind in ("input", "state"):
            participant._views[v.name][...] = random.uniform(-1.0, 1.0, v.shape)
    listed = dependencies(participant)
    for name in names:
        base, moved = participant.fresh(), participant.fresh()
        moved._views[name][...] += random.uniform(0.1, 12.0)
        _evaluate(base)
        _evaluate(moved)
        for target in listed:
            if not np.array_equal(base._views[target], moved._views[target]):
                assert name in listed[target], (target, name)


def _evaluate(participant: Participant) -> None:
    kernels = participant.kernels
    for name in ("derivatives", "outputs"):
        if name in kernels:
            getattr(participant, name)(0.0)
    if "step" in kernels:
        participant.step(0.0, 0.1)
