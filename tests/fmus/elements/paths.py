"""Elements driven along paths of their deformation: shared by the tests of all laws of one row.

Paths are measured in the element's scale, the smallest deformation at which its law changes,
and reach six times as far; branches beyond that need a test of their own.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.elements.element import OWN, Element


def memory(element: Element, rows: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return parameters and two memories with `rows` rows; only the last row has the parameters."""
    p = np.zeros((rows, len(element.parameters)))
    p[-1] = element.parameters
    z = np.zeros((2, rows, OWN + element.memory))
    return p, z[0], z[1]


def drive(element: Element, path, h: float = 0.01) -> np.ndarray:
    """Force, tangent, stored and lost energy along a path, one step for each point.

    The element is the second row, so that a law that reads row 0 fails.
    """
    p, z0, z = memory(element, 2)
    rate, d0, out = 0.0, 0.0, []
    for d in path:
        rate = 2.0 / h * (d - d0) - rate
        out.append(element.law(1, d, d0, rate, h, p, z0, z))
        z0[:], d0 = z, d
    return np.array(out)


def cycles(element: Element, steps: int) -> np.ndarray:
    """Eight half cycles whose amplitude grows from zero to six times the element's scale."""
    t = np.linspace(0.0, 1.0, steps + 1)[1:]
    return 6.0 * element.scale * t * np.sin(25.0 * t)


def check_tangent(element: Element) -> None:
    """Compare the tangent at every step of the cycles with central differences of the force.

    The force is rounded at 1e-15 of the stiffness times the deformation, and an iterating law
    leaves 1e-14; over the differencing step, 1e-6 of the scale, these become 1e-8 of the
    stiffness, and 1e-7 leaves room. The steps are fast and slow for laws that depend on the rate.
    """
    delta = 1e-6 * element.scale
    for h in (0.001, 0.1):
        p, z0, z = memory(element, 1)
        rate0, d0, tangents, slopes = 0.0, 0.0, [], []
        path = cycles(element, 400)
        for d in path:
            force = {}
            for x in (d - delta, d + delta, d):  # the last one leaves its memory in z
                rate = 2.0 / h * (x - d0) - rate0
                force[x], tangent, *_ = element.law(0, x, d0, rate, h, p, z0, z)
            tangents.append(tangent)
            slopes.append((force[d + delta] - force[d - delta]) / (2.0 * delta))
            z0[:], d0, rate0 = z, d, rate
        bound = 1e-7 * np.abs(slopes).max()
        wrong = [i for i in range(len(path)) if not abs(tangents[i] - slopes[i]) <= bound]
        assert not wrong, (
            f"step {wrong[0]} (h = {h:g} s), d = {path[wrong[0]]:g} m: the tangent is "
            f"{tangents[wrong[0]]:.9g} N/m, but the force has the slope {slopes[wrong[0]]:.9g} N/m"
        )


def check_energy(element: Element) -> None:
    """Compare the energies with the work by the trapezoidal rule, all along 20,000 steps.

    Kinks lie within steps of at most 0.0075 of the scale; they leave 1e-5 of the largest work.
    """
    path = cycles(element, 20_000)
    out = drive(element, path)
    work = np.cumsum(0.5 * (out[1:, 0] + out[:-1, 0]) * np.diff(path))
    size = np.abs(work).max()
    assert out[1:, 2] - out[0, 2] + np.cumsum(out[1:, 3]) == pytest.approx(work, abs=1e-5 * size)
    assert (out[:, 3] >= -1e-12 * size).all()
