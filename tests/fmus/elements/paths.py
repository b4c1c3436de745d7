"""Elements driven along paths of their deformation: shared by the tests of all laws of one row."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.elements.element import OWN, Element


def memory(element: Element, rows: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return parameters and two memories with `rows` rows; the last row is the element's."""
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


def check_tangent(element: Element) -> None:
    """Central differences of 1e-6 leave a relative error near 1e-8; 1e-5 leaves room at curvature."""
    p, z0, z = memory(element, 1)
    z0[0] = 0.05  # some plastic deformation, some hysteresis
    for d in (-0.9, -0.31, 0.1, 0.2, 0.8):
        h, d0, rate0 = 0.01, 0.15, 0.2

        def force(x, d0=d0, h=h, rate0=rate0):
            return element.law(0, x, d0, 2.0 / h * (x - d0) - rate0, h, p, z0, z)[:2]

        slope = (force(d + 1e-6)[0] - force(d - 1e-6)[0]) / 2e-6
        assert force(d)[1] == pytest.approx(slope, rel=1e-5, abs=1e-5)


def check_energy(element: Element) -> None:
    """Work by the trapezoidal rule of 20,000 steps; its kinks leave 1e-5 of the work of a yielding law."""
    path = 0.9 * np.sin(np.linspace(0.0, 13.0, 20_001)) * np.linspace(0.2, 1.0, 20_001)
    out = drive(element, path)
    mean = 0.5 * (out[1:, 0] + out[:-1, 0])
    work = (mean * np.diff(path)).sum()
    assert out[-1, 2] - out[0, 2] + out[1:, 3].sum() == pytest.approx(work, rel=1e-5)
    assert (out[:, 3] >= -1e-12).all()
