"""Motion of spheres at random, for tests of features and networks."""

from __future__ import annotations

import numpy as np

from rigid_gns_core.models.features import Motion


def random_motion(seed: int, count: int = 20, history: int = 2) -> Motion:
    """Spheres in a box of 10 m, most without contact, with `history` earlier velocities."""
    rng = np.random.default_rng(seed)
    quaternions = rng.normal(size=(count, 4))
    return Motion(
        rng.uniform(-5, 5, (count, 3)) + [0, 0, 6],
        quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True),
        rng.normal(size=(history + 1, count, 3)) * 5,
        rng.normal(size=(history + 1, count, 3)),
    )
