# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Motion of spheres at random, and its features, for tests of features and networks."""

from __future__ import annotations

import numpy as np
from rigid_gns_core.gns.config import GNSConfig
from rigid_gns_core.gns.features import Features, GraphBatch
from rigid_gns_core.gns.motion import joined, Motion
from rigid_gns_core.scenes.scene import Scene
import torch


def random_motion(seed: int, count: int = 20, history: int = 2) -> Motion:
    """Spheres in a box of 10 m, most without contact, with `history` earlier velocities."""
    rng = np.random.default_rng(seed)
    quaternions = rng.normal(size=(count, 4))
    arrays = (
        rng.uniform(-5, 5, (count, 3)) + [0, 0, 6],
        quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True),
        rng.normal(size=(history + 1, count, 3)) * 5,
        rng.normal(size=(history + 1, count, 3)),
    )
    return Motion(*map(torch.from_numpy, arrays))


def features(config: GNSConfig, scene: Scene, *motions: Motion) -> Features:
    """Features of the next step of 0.1 s, of motions in the same scene side by side."""
    counts = [len(motion.positions) for motion in motions]
    scenes = GraphBatch([scene] * len(motions), counts, config, 0.1, torch.device('cpu'))
    return scenes.features(joined(motions))
