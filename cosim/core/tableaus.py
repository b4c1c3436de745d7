"""Fixed-step explicit Runge-Kutta methods: nodes c, rows a, weights b, and their order.

ode1 Euler, ode2 Heun, ode3 Bogacki and Shampine (1989), ode4 the classical method. The
names are those of block-diagram tools.
"""

from __future__ import annotations

Tableau = tuple[tuple[float, ...], tuple[tuple[float, ...], ...], tuple[float, ...]]

TABLEAUS: dict[str, Tableau] = {
    "ode1": ((0.0,), ((),), (1.0,)),
    "ode2": ((0.0, 1.0), ((), (1.0,)), (0.5, 0.5)),
    "ode3": ((0.0, 0.5, 0.75), ((), (0.5,), (0.0, 0.75)), (2.0 / 9.0, 1.0 / 3.0, 4.0 / 9.0)),
    "ode4": (
        (0.0, 0.5, 0.5, 1.0),
        ((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)),
        (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0),
    ),
}
