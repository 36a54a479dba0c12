# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""States of tracked spheres by smoothing, so that a network does not learn the tracker's noise.

A Kalman filter forwards and the smoother of Rauch, Tung and Striebel (1965) backwards, for each
sphere. Between two samples, h apart, position and velocity change by flight and by white
acceleration noise of intensity q:

    x <- x + v h + g h^2 / 2,   v <- v + g h,   Q = q [[h^3 / 3, h^2 / 2], [h^2 / 2, h]].

q is what the samples show: the jump of velocity at a sample is j = (x_+ - 2 x + x_-) / h - g h,
known to within the noise, sqrt(6) sigma / h. Where it is larger than noise explains, q h is the
square of the rest; elsewhere it is that of a share of g h, a larger one where something is near,
which may support the sphere. A blow is so taken to be as large as it looks, and flight and rest
are smoothed.
"""

from __future__ import annotations

import numpy as np

from ...engine.learned_contacts import NEAR
from ...kernels.neighbours import Flags
from ...scenes.scene import Scene
from ...scenes.state import Array, quaternion_multiply, State

# least standard deviation of a jump [g h], in flight and where something is near
_FLIGHT, _CONTACT = 0.02, 1.0
# squares of jumps that noise exceeds in 1 of 100 samples [of their mean]
_SEEN = 3.8
# least noise of positions [radii], and of rotations [rad]: rounding
_LEAST = 1e-6


def smoothed_states(scene: Scene, positions: Array, quaternions: Array, h: float) -> State:
    """States at all samples.

    Args:
        scene: Surfaces, radii and gravity.
        positions: Tracked centres, shape (m, n, 3), m at least 4.
        quaternions: Tracked rotations (x, y, z, w), shape (m, n, 4).
        h: Time between samples.

    Returns:
        Stacked states: fields of shape (m, n, k).
    """
    radius = scene.per_sphere('radius', positions.shape[1])
    is_near = near(scene, positions, radius, NEAR * float(radius.mean()))
    gravity = np.asarray(scene.gravity, dtype=np.float64)
    weight = float(np.linalg.norm(gravity)) or 9.81
    centres, velocities = _smoothed(
        positions, gravity, is_near, h, weight, _LEAST * float(radius.min())
    )
    turned = _turned(quaternions)
    pull = weight / float(radius.mean())
    _, spins = _smoothed(turned, np.zeros(3), is_near, h, pull, _LEAST)
    return State.unchecked(centres, quaternions, velocities, spins)


def near(scene: Scene, positions: Array, radius: Array, reach: float) -> Flags:
    """Whether something is within `reach` of each sphere at each sample; shape (m, n)."""
    found = np.zeros(positions.shape[:2], dtype=bool)
    touching = radius[:, None] + radius + reach
    for k, centres in enumerate(positions):
        square = ((centres[:, None] - centres) ** 2).sum(-1) + 1e12 * np.eye(len(radius))
        found[k] = (square < touching**2).any(axis=1)
    for plane in scene.surfaces:
        local = (positions - plane.point) @ plane.axes.T
        local[..., :2] -= np.clip(local[..., :2], -plane.half_lengths, plane.half_lengths)
        found |= np.linalg.norm(local, axis=-1) < radius + reach
    return found


def _turned(quaternions: Array) -> Array:
    """Sum of the rotation vectors from sample to sample, shape (m, n, 3)."""
    back = quaternions[:-1] * [-1.0, -1.0, -1.0, 1.0]
    steps = quaternion_multiply(quaternions[1:], back)
    steps = np.where(steps[..., 3:] < 0, -steps, steps)
    sines = np.linalg.norm(steps[..., :3], axis=-1, keepdims=True)
    angles = 2.0 * np.arctan2(sines, steps[..., 3:])
    vectors = steps[..., :3] * np.where(sines > 1e-12, angles / np.maximum(sines, 1e-12), 2.0)
    return np.concatenate([np.zeros_like(vectors[:1]), np.cumsum(vectors, axis=0)])


def _smoothed(
    values: Array, pull: Array, is_near: Flags, h: float, weight: float, least: float
) -> tuple[Array, Array]:
    """Smoothed values and their rates, shape (m, n, 3) each."""
    jumps = np.zeros_like(values)
    jumps[1:-1] = np.diff(values, 2, axis=0) / h - pull * h
    flying = np.abs(jumps[1:-1])[~is_near[1:-1]]
    sample = flying if flying.size > 100 else np.abs(jumps[1:-1])
    noise = max(least, float(np.median(sample)) / 0.6745 * h / np.sqrt(6.0))
    square, known = (jumps**2).mean(-1), 6.0 * (noise / h) ** 2
    beyond = np.where(square > _SEEN * known, square - known, 0.0)
    floor = (np.where(is_near, _CONTACT, _FLIGHT) * weight * h) ** 2
    # a jump at a sample may have happened on both sides of it
    intensity = np.maximum(beyond, floor)
    intensity = np.maximum(intensity[:-1], intensity[1:]) / h  # of the intervals
    count, size = len(values), values.shape[1]
    x, v = values[0].copy(), (values[1] - values[0]) / h - 0.5 * h * pull
    cover = np.tile(np.diag([noise**2, 4.0 * (noise / h) ** 2]), (size, 1, 1))
    cover[:, 1, 1] += intensity[0] * h
    move = np.array([[1.0, h], [0.0, 1.0]])
    shape = np.array([[h**3 / 3.0, h**2 / 2.0], [h**2 / 2.0, h]])
    states, covers = np.empty((count, size, 2, 3)), np.empty((count, size, 2, 2))
    ahead, ahead_covers = np.empty_like(states), np.empty_like(covers)
    states[0, :, 0], states[0, :, 1], covers[0] = x, v, cover
    for k in range(1, count):
        ahead[k] = move @ states[k - 1]
        ahead[k, :, 0] += 0.5 * h * h * pull
        ahead[k, :, 1] += h * pull
        ahead_covers[k] = move @ covers[k - 1] @ move.T
        ahead_covers[k] += intensity[k - 1][:, None, None] * shape
        gain = ahead_covers[k, :, :, 0] / (ahead_covers[k, :, 0, 0] + noise**2)[:, None]
        innovation = values[k] - ahead[k, :, 0]
        states[k] = ahead[k] + gain[:, :, None] * innovation[:, None, :]
        covers[k] = ahead_covers[k] - gain[:, :, None] * ahead_covers[k][:, None, 0, :]
    for k in range(count - 2, -1, -1):
        back = covers[k] @ move.T @ np.linalg.inv(ahead_covers[k + 1])
        states[k] += back @ (states[k + 1] - ahead[k + 1])
    return states[:, :, 0], states[:, :, 1]
