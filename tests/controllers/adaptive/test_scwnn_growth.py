"""The wavelet network's new nodes: when one is made, and with which numbers (thesis, (3.34) to (3.39))."""

from __future__ import annotations

import pytest

from controllers.adaptive.scwnn import SCWNN

E2 = 0.05  # least error that makes a node
FAR = 1.0  # of a new input from the nearest node, far above the distance that makes one


def grown(x: float) -> SCWNN:
    """Hold |e| = x for six samples, the sixth at a new place, where the nearest node is FAR away."""
    # centres and widths stay where they are, and no node is dropped
    network = SCWNN.design(1, 10, d_max=E2, d_min=E2, eta_c=0.0, eta_sigma=0.0, E3=0.0)
    for k in range(6):
        network.x[0], network.v[0] = x, FAR if k == 5 else 0.0
        network.step(0.0, 0.005)
    return network


@pytest.mark.parametrize(("error", "nodes"), [(0.9 * E2, 2.0), (1.1 * E2, 3.0)])
def test_a_node_needs_a_large_error_of_five_samples(error: float, nodes: float) -> None:
    """(3.35): sqrt(sum |e|^2 / m^2) of m = 5 equal samples is |e| / sqrt(5); the two first nodes stay."""
    assert grown(error * 5.0**0.5).nodes == nodes


def test_a_new_node_has_its_width_centre_and_weight() -> None:
    """Centre X, width rho = 0.8 of the distance to the nearest, weight e, and no share of g yet."""
    x = 0.2
    network = grown(x)
    assert network.c[2].tolist() == [x, FAR]
    assert network.sigma[2] == pytest.approx([0.8 * FAR] * 2, rel=1e-12)
    assert network.eta_iw * network.w[2, 0] == pytest.approx(x, rel=1e-12)
    assert network.theta[2, 0] == 0.0
