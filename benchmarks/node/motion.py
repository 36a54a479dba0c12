# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Balls whose motion is known for ever: they bounce and slide without loss."""

from __future__ import annotations

from typing import Any

import numpy as np

RADIUS, GRAVITY = 0.02, 9.81  # [m], [m/s^2]
HEIGHTS = np.array([0.5, 0.8, 0.0, 0.0])  # of the bounces [m]
VELOCITIES = np.array([0.3, -0.2, 0.4, -0.1])  # along x [m/s]
NOISE = 1e-4  # of each tracked coordinate [m]

SCENE: dict[str, Any] = {
    'scene': {
        'surfaces': [{'point': [0, 0, 0], 'normal': [0, 0, 1]}],
        'radius': RADIUS,
        'mass': 0.0027,
        'restitution': 1.0,
        'friction': 0.0,
        'rolling_friction': 0.0,
    }
}


def poses_at(
    times: np.ndarray, heights: np.ndarray = HEIGHTS, velocities: np.ndarray = VELOCITIES
) -> np.ndarray:
    """Poses without noise, shape (k, n, 7).

    Args:
        times: Since the start [s], shape (k,).
        heights: Of the bounces [m], 0: it slides; shape (n,).
        velocities: Along x [m/s], shape (n,).
    """
    times = np.asarray(times, dtype=np.float64)[:, None]
    fall = np.sqrt(2 * np.maximum(heights, 1e-9) / GRAVITY)
    since = (times + fall) % (2 * fall) - fall  # around each highest point
    poses = np.zeros((len(times), len(heights), 7))
    poses[..., 0] = velocities * times
    poses[..., 1] = 0.5 * np.arange(len(heights))
    poses[..., 2] = RADIUS + np.where(heights > 0, heights - 0.5 * GRAVITY * since**2, 0.0)
    poses[..., 6] = 1.0
    return poses
