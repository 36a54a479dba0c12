# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What tracked poses alone tell: tracker's noise, and velocities of spheres that touch nothing.

Between contacts a sphere has a constant acceleration (gravity in flight, none where a surface
carries it) and a constant spin. So third differences of its positions are noise, and so are those
of its rotations; and where two steps in a row agree with either motion, nothing was struck.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..scenes.state import Array, rotation_between

# standard deviation of a third difference of values that have one of 1: 1, 3, 3, 1 squared
_THIRD = float(np.sqrt(20.0))
# a normal distribution: part of its smallest quarter, and its mean square when cut at 3
_QUARTER, _CUT = 0.3186, 0.9733
# a deviation of so many standard deviations is a contact, not noise
SIGMAS = 5.0
# a rotation of more than this in one step may have been tracked the other way round [rad]
HALF_TURN = 2.8
# what rolling friction and drag may do to a step, as a part of gravity
_CARRIED = 0.1


@dataclass(frozen=True)
class PoseNoise:
    """Standard deviations of the noise of a tracker.

    Args:
        position: Of each coordinate [m].
        rotation: Of the rotation about each axis [rad]; None where no rotation is tracked.
    """

    position: float
    rotation: float | None


@dataclass(frozen=True)
class TrackedStarts:
    """Velocities at each frame from those before and after it.

    Args:
        velocities: [m/s], shape (frames, n, 3); zero in the first frame and the last.
        angular_velocities: [rad/s], world frame, shape (frames, n, 3).
        trusted: Whether the three frames are those of one motion without contact, shape (frames,
            n); False in the first and the last.
    """

    velocities: Array
    angular_velocities: Array
    trusted: NDArray[np.bool_]


def rotates(quaternions: Array) -> bool:
    """Whether a tracker follows rotations at all; many send the same one for ever.

    Quaternions have shape (frames, ..., 4).
    """
    return bool(np.abs(rotation_between(quaternions[:1], quaternions)).max(initial=0.0) > 1e-9)


def estimate_noise(parts: list[tuple[Array, Array, Array]]) -> PoseNoise:
    """Noise of a tracker, from third differences; steps with contacts are left out as outliers.

    Args:
        parts: Times [s], shape (k,), positions, shape (k, n, 3), and quaternions, shape (k, n, 4),
            of segments without gaps. Only four frames in a row at equal times, to a tenth, count.

    Returns:
        The noise; 0 where no four frames in a row are there to tell.
    """
    places: list[Array] = [np.zeros(0)]
    turns: list[Array] = [np.zeros(0)]
    tracked = any(rotates(quaternions) for _, _, quaternions in parts)
    for times, positions, quaternions in parts:
        if len(times) < 4:
            continue
        intervals = np.diff(times)
        triples = np.stack([intervals[:-2], intervals[1:-1], intervals[2:]])
        even = np.ptp(triples, axis=0) <= 0.1 * np.median(intervals)
        places.append(np.diff(positions, 3, axis=0)[even].ravel())
        turned = rotation_between(quaternions[:-1], quaternions[1:])
        turns.append(np.diff(turned, 2, axis=0)[even].ravel())
    position = normal_spread(np.concatenate(places)) / _THIRD
    return PoseNoise(position, normal_spread(np.concatenate(turns)) / _THIRD if tracked else None)


def tracked_starts(
    positions: Array, quaternions: Array, dt: float, gravity: Array, noise: PoseNoise
) -> TrackedStarts:
    """Velocities from three frames each, and whether they can be trusted.

    They are right for every constant acceleration, of flight as of rolling. Their noise is
    `noise.position` / (sqrt(2) dt), half of that of one backward difference.

    Args:
        positions: Centres [m], shape (frames, n, 3).
        quaternions: Rotations (x, y, z, w), shape (frames, n, 4).
        dt: Time between two frames [s].
        gravity: Acceleration of free flight [m/s^2], shape (3,).
        noise: Of the poses.
    """
    velocities, spins = np.zeros_like(positions), np.zeros_like(positions)
    trusted = np.zeros(positions.shape[:2], dtype=bool)
    if len(positions) < 3:
        return TrackedStarts(velocities, spins, trusted)
    bent = np.diff(positions, 2, axis=0)
    fall = gravity * dt**2
    flying, uniform = np.linalg.norm(bent - fall, axis=-1), np.linalg.norm(bent, axis=-1)
    velocities[1:-1] = (positions[2:] - positions[:-2]) / (2.0 * dt)
    allowed = SIGMAS * np.sqrt(6.0) * noise.position + _CARRIED * float(np.linalg.norm(fall))
    trusted[1:-1] = np.minimum(flying, uniform) <= allowed
    if noise.rotation is not None:
        turned = rotation_between(quaternions[:-1], quaternions[1:])
        spins[1:-1] = 0.5 * (turned[1:] + turned[:-1]) / dt
        change = np.linalg.norm(np.diff(turned, axis=0), axis=-1)
        # rolling friction slows a spin too; 0.02 rad is a tenth of what a bounce does
        trusted[1:-1] &= change <= SIGMAS * np.sqrt(6.0) * noise.rotation + 0.02
        # near half a turn in a step the way round is a guess
        trusted[1:-1] &= (
            np.maximum(*np.linalg.norm([turned[1:], turned[:-1]], axis=-1)) < HALF_TURN
        )
    return TrackedStarts(velocities, spins, trusted)


def normal_spread(values: Array) -> float:
    """Return the std of the normal part of values, (k,); the rest are contacts; 0 of none."""
    if not len(values):
        return 0.0
    size = np.sort(np.abs(values))
    # a normal distribution: its smallest quarter ends there
    found = float(size[len(size) // 4]) / _QUARTER
    squares = np.cumsum(size**2)
    for _ in range(20):
        kept = int(np.searchsorted(size, 3.0 * found, side='right'))
        if not kept:
            break
        before, found = found, float(np.sqrt(squares[kept - 1] / kept / _CUT))
        if found == before:
            break
    return found
