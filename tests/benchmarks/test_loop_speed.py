"""Speed of the loop: four small participants, a million steps, three recorded numbers.

The reference is a C program written for this one system, compiled by the same clang and run
right before, so the ratio is the cost of the generic loop. Nothing is asserted about seconds.
"""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import scipy.linalg

from cosim import Block, Input, LinearContinuous, Output, Parameter, State, System, simulate

pytestmark = pytest.mark.benchmark

STEPS, H = 1_000_000, 0.001


class Oscillator(LinearContinuous):
    u = Input()
    x = State(1.0)
    v = State(0.0)
    a = Output()

    def derivatives(self, t):
        self.der_x = self.v
        self.der_v = self.u - 0.3 * self.v - 2.0 * self.x

    def outputs(self, t):
        self.a = self.der_v


class Sensor(LinearContinuous):
    """y' = (x - y) / T"""

    x = Input()
    y = State(0.0)

    def derivatives(self, t):
        self.der_y = (self.x - self.y) / 0.01


class Control(Block):
    K = Parameter(0.7)
    x = Input()
    u = Output()

    def step(self, t, h):
        self.u = -self.K * self.x


class Filter(Block):
    x = Input()
    y = State(0.0)

    def step(self, t, h):
        self.y = 0.9 * self.y + 0.1 * self.x


PROGRAM = r"""
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

struct oscillator { double u, x, v, a; } p = {0, 1, 0, 0};
struct sensor { double x, y; } s;
struct control { double x, u; } c;
struct filter { double x, y; } f;
static const double A[2][2] = {{%(A)s}}, B[2] = {%(B)s}, E = %(E)s, F = %(F)s;

__attribute__((noinline)) void outputs(void) { p.a = p.u - 0.3 * p.v - 2.0 * p.x; }
__attribute__((noinline)) void control(void) { c.u = -0.7 * c.x; }
__attribute__((noinline)) void filter(void) { f.y = 0.9 * f.y + 0.1 * f.x; }
__attribute__((noinline)) void advance_sensor(void) { s.y = E * s.y + F * s.x; }
__attribute__((noinline)) void advance_oscillator(void) {
    double x = A[0][0] * p.x + A[0][1] * p.v + B[0] * p.u;
    p.v = A[1][0] * p.x + A[1][1] * p.v + B[1] * p.u;
    p.x = x;
}

int main(void) {
    const long n = %(n)d;
    double *record = malloc(3 * sizeof(double) * (n + 1));
    struct timespec a, b;
    clock_gettime(CLOCK_MONOTONIC, &a);
    for (long k = 0; k <= n; k++) {
        outputs();
        c.x = s.y;
        control();
        f.x = c.u;
        filter();
        if (!isfinite(p.a) || !isfinite(p.x) || !isfinite(p.v) || !isfinite(c.u) || !isfinite(f.y)) return 1;
        record[3 * k] = p.x;
        record[3 * k + 1] = f.y;
        record[3 * k + 2] = p.a;
        if (k == n) break;
        p.u = f.y;
        s.x = p.a;
        advance_oscillator();
        advance_sensor();
    }
    clock_gettime(CLOCK_MONOTONIC, &b);
    printf("%%.9g %%.17g %%.17g\n", (b.tv_sec - a.tv_sec) + 1e-9 * (b.tv_nsec - a.tv_nsec),
           record[3 * n], record[3 * n + 2]);
    return 0;
}
"""


@pytest.fixture(scope="module")
def c_program(tmp_path_factory):
    """Build the C program; return its best time of five runs and its last values."""
    folder = tmp_path_factory.mktemp("c")
    M = scipy.linalg.expm(np.array([[0.0, 1.0, 0.0], [-2.0, -0.3, 1.0], [0.0, 0.0, 0.0]]) * H)
    e = np.exp(-H / 0.01)
    numbers = {
        "A": "},{".join(",".join(f"{x:.17g}" for x in row[:2]) for row in M[:2]),
        "B": ",".join(f"{row[2]:.17g}" for row in M[:2]),
        "E": f"{e:.17g}",
        "F": f"{1.0 - e:.17g}",
        "n": STEPS,
    }
    (folder / "loop.c").write_text(PROGRAM % numbers)
    command = [sys.executable, "-m", "ziglang", "cc", "-O3", "-march=native", "-ffp-contract=off"]
    subprocess.run([*command, "-o", folder / "loop", folder / "loop.c", "-lm"], check=True)
    runs = []
    for _ in range(5):
        done = subprocess.run([folder / "loop"], capture_output=True, text=True, check=True)
        runs.append([float(x) for x in done.stdout.split()])
    return min(run[0] for run in runs), runs[0][1:]


def test_a_million_steps_of_four_participants(c_program):
    seconds, last = c_program
    system = System(
        {"plant": Oscillator(), "sensor": Sensor(), "control": Control(), "filter": Filter()},
        [
            ("plant.a", "sensor.x"),
            ("sensor.y", "control.x"),
            ("control.u", "filter.x"),
            ("filter.y", "plant.u"),
        ],
    )
    options = {"step": H, "stop": STEPS * H, "record": ["plant.x", "filter.y", "plant.a"], "statistics": []}
    simulate(system, **options | {"stop": 10 * H})  # compiles
    runs = [simulate(system, **options) for _ in range(5)]
    ours = min(r.seconds for r in runs)
    print(f"\nplain C {STEPS / seconds / 1e6:.1f}, loop {STEPS / ours / 1e6:.1f} million steps/s: "
          f"{seconds / ours:.2f} of C")  # fmt: skip
    # the same work: a decaying loop, rounded differently in each of a million steps
    assert [runs[0]["plant.x"][-1], runs[0]["plant.a"][-1]] == pytest.approx(last, abs=1e-9)
