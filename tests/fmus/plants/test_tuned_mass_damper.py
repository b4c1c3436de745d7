"""The tuned mass damper as a plant: its reaction on the floor balances its momentum."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.plants.tuned_mass_damper import TunedMassDamper


def test_reaction_is_the_opposite_of_what_moves_the_mass() -> None:
    """m y'' = -reaction at any state and input, since spring, dashpot and actuator act on the floor."""
    random = np.random.default_rng(6)
    damper = TunedMassDamper(m=50.0, c=20.0, k=500.0)
    for _ in range(10):
        for name, value in zip(("x_top", "v_top", "u", "y", "y_dot"), random.normal(size=5), strict=True):
            setattr(damper, name, value)
        damper.derivatives(0.0)
        damper.outputs(0.0)
        # the same three forces in another order: roundings of 1e-16 each
        assert damper.reaction == pytest.approx(-50.0 * damper.der_y_dot, rel=1e-12)
