# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Measurement noise of recorded poses, and velocities between contacts, by finite differences.

Between contacts a sphere has a constant acceleration (gravity in flight, none where a surface
supports it) and a constant spin. So third differences of its positions and of its rotations are
noise; and where two consecutive steps agree with either motion, there was no contact.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
import math

import numpy as np
from numpy.typing import NDArray

from ..scenes.state import Array, rotation_between

# standard deviation of a third difference of unit noise: sqrt(1 + 9 + 9 + 1)
_THIRD = float(np.sqrt(20.0))
# of the standard normal: the quartile of |x|, and the mean square of what is below 3
_QUARTER, _CUT = 0.3186, 0.9733
# beyond this many standard deviations a deviation is a contact, not noise
SIGMAS = 5.0
# above this rotation in one step its sense is ambiguous [rad]
HALF_TURN = 2.8
# largest acceleration by rolling friction and drag, as a part of gravity
_CARRIED = 0.1


@dataclass(frozen=True)
class PoseNoise:
    """Standard deviations of the measurement noise of a tracker.

    Args:
        position: Noise of each coordinate [m].
        rotation: Noise of the rotation about each axis [rad]; None where none is tracked.
    """

    position: float
    rotation: float | None


@dataclass(frozen=True)
class TrackedStarts:
    """Velocities at each frame, by central differences.

    Args:
        velocities: Velocities [m/s], shape (frames, n, 3); zero in the first and last frame.
        angular_velocities: Angular velocities [rad/s], world frame, shape (frames, n, 3).
        trusted: Whether no contact lies between the three frames, shape (frames, n); False in the
            first and last frame.
    """

    velocities: Array
    angular_velocities: Array
    trusted: NDArray[np.bool_]


def rotates(quaternions: Array) -> bool:
    """Whether rotations are tracked at all: many trackers always send the same one.

    Args:
        quaternions: Rotations (x, y, z, w), shape (frames, ..., 4).
    """
    return bool(np.abs(rotation_between(quaternions[:1], quaternions)).max(initial=0.0) > 1e-9)


def rotating(quaternions: Array, seen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether the rotation of each sphere changes in the frames that show it, shape (n,).

    Args:
        quaternions: Rotations (x, y, z, w), shape (frames, n, 4).
        seen: Whether a sphere was seen, shape (frames, n).
    """
    if (quaternions == quaternions[:1]).all():
        return np.zeros(seen.shape[1], dtype=np.bool_)
    first = quaternions[np.argmax(seen, axis=0), np.arange(seen.shape[1])]
    same = np.sign((quaternions * first).sum(axis=-1, keepdims=True))
    changes = np.abs(quaternions - same * first).max(axis=-1)  # half of the angle, about
    found: NDArray[np.bool_] = (seen & (changes > 5e-10)).any(axis=0)
    return found


def estimate_noise(segments: list[tuple[Array, Array, Array]]) -> PoseNoise:
    """Measurement noise from third differences; contacts are left out as outliers.

    Args:
        segments: Times [s], shape (k,), positions [m], shape (k, n, 3), and quaternions, shape
            (k, n, 4), of each. Only four consecutive frames at equal intervals, to 10 %, count.

    Returns:
        The noise; 0 where there are no such four frames.
    """
    position_differences: list[Array] = [np.zeros(0)]
    rotation_differences: list[Array] = [np.zeros(0)]
    tracked = any(rotates(quaternions) for _, _, quaternions in segments)
    for times, positions, quaternions in segments:
        if len(times) < 4:
            continue
        intervals = np.diff(times)
        triples = np.stack([intervals[:-2], intervals[1:-1], intervals[2:]])
        even = np.ptp(triples, axis=0) <= 0.1 * np.median(intervals)
        position_differences.append(np.diff(positions, 3, axis=0)[even].ravel())
        turned = rotation_between(quaternions[:-1], quaternions[1:])
        rotation_differences.append(np.diff(turned, 2, axis=0)[even].ravel())
    position = normal_spread(np.concatenate(position_differences)) / _THIRD
    return PoseNoise(
        position, normal_spread(np.concatenate(rotation_differences)) / _THIRD if tracked else None
    )


def tracked_starts(
    positions: Array, quaternions: Array, dt: float, gravity: Array, noise: PoseNoise
) -> TrackedStarts:
    """Velocities by central differences over three frames, and whether they can be trusted.

    They are exact for any constant acceleration. Their noise is `noise.position` / (sqrt(2) dt),
    half of that of a backward difference.

    Args:
        positions: Centres [m], shape (frames, n, 3).
        quaternions: Rotations (x, y, z, w), shape (frames, n, 4).
        dt: Time between two frames [s].
        gravity: Acceleration of free flight [m/s^2], shape (3,).
        noise: Measurement noise of the poses.
    """
    velocities, spins = np.zeros_like(positions), np.zeros_like(positions)
    trusted = np.zeros(positions.shape[:2], dtype=bool)
    if len(positions) < 3:
        return TrackedStarts(velocities, spins, trusted)
    second_differences = np.diff(positions, 2, axis=0)
    fall = gravity * dt**2
    flying, uniform = (
        np.linalg.norm(second_differences - fall, axis=-1),
        np.linalg.norm(second_differences, axis=-1),
    )
    velocities[1:-1] = (positions[2:] - positions[:-2]) / (2.0 * dt)
    allowed = SIGMAS * np.sqrt(6.0) * noise.position + _CARRIED * float(np.linalg.norm(fall))
    trusted[1:-1] = np.minimum(flying, uniform) <= allowed
    if noise.rotation is not None:
        turned = rotation_between(quaternions[:-1], quaternions[1:])
        spins[1:-1] = 0.5 * (turned[1:] + turned[:-1]) / dt
        change = np.linalg.norm(np.diff(turned, axis=0), axis=-1)
        # rolling friction slows a spin too; 0.02 rad is a tenth of what a bounce does
        trusted[1:-1] &= change <= SIGMAS * np.sqrt(6.0) * noise.rotation + 0.02
        # near half a turn in a step the sense of rotation is a guess
        trusted[1:-1] &= (
            np.maximum(*np.linalg.norm([turned[1:], turned[:-1]], axis=-1)) < HALF_TURN
        )
    return TrackedStarts(velocities, spins, trusted)


def normal_spread(values: Array) -> float:
    """Standard deviation of values, shape (k,), without the outliers (contacts); 0 of none."""
    if not len(values):
        return 0.0
    ordered = np.sort(np.abs(values))
    squares, size = np.cumsum(ordered**2), ordered.tolist()
    # first guess from the quartile, then the mean square below three standard deviations
    found = size[len(size) // 4] / _QUARTER
    for _ in range(20):
        kept = bisect_right(size, 3.0 * found)
        if not kept:
            break
        before, found = found, math.sqrt(float(squares[kept - 1]) / kept / _CUT)
        if found == before:
            break
    return found
