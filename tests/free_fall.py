# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A trajectory of three spheres in free fall."""

from __future__ import annotations

import numpy as np
from rigid_gns_core.scenes.state import Trajectory


def falling(steps=12, offset=0.0):
    time = (np.arange(steps + 1) * 0.1)[:, None, None]
    start = np.array([[-4.0, 0, 20], [0, 3, 25], [5, -5, 30]]) + offset
    gravity = np.array([0, 0, -9.81])
    positions = start + gravity * time**2 / 2
    return Trajectory(
        positions=positions,
        quaternions=np.broadcast_to([0.0, 0, 0, 1], (steps + 1, 3, 4)),
        velocities=np.broadcast_to(gravity * time, positions.shape),
        angular_velocities=np.zeros_like(positions),
        dt=0.1,
    )
