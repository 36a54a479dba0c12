# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Resampling of tracked poses at other times, without a straight line through a bounce.

Between two frames a sphere flies (a parabola), is supported by a surface (a straight line), or
has a contact. A step that agrees with the step before or after it has no contact in it. In a step
with a contact, the motion before it is extrapolated forward and that after it backward, to where
they meet. Where they do not meet, as after two contacts in one step, a straight line is taken, and
counted. Rotations are interpolated along the shorter arc.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..scenes.scene import Scene
from ..scenes.state import Array, rotate_quaternions, rotation_between
from ..tracking.pose_noise import SIGMAS

# times within this are the same [s]
_SAME = 1e-7
# times tried for a contact within a step
_MOMENTS = 33
# largest distance of the motions before and after a contact where they meet [radii]
_MEET = 0.02
# largest acceleration by rolling friction, as a part of gravity
_BENT = 0.05
_FLIGHT, _CARRIED, _STRUCK = 0, 1, 2


@dataclass(frozen=True)
class Resampled:
    """Resampled poses.

    Args:
        positions: Centres [m], shape (steps + 1, n, 3).
        quaternions: Rotations (x, y, z, w), shape (steps + 1, n, 4).
        counts: Number of poses by kind: `tracked` (a frame has that time), `flight`, `carried`
            (supported), `bounce` (from both sides of a contact) and `straight` (a guess).
    """

    positions: Array
    quaternions: Array
    counts: dict[str, int]


def resample(
    times: Array,
    positions: Array,
    quaternions: Array,
    wanted: Array,
    *,
    scene: Scene,
    noise: float,
) -> Resampled:
    """Poses at the times `wanted`.

    Args:
        times: Times of the frames [s], rising, shape (k,), k at least 2.
        positions: Centres [m], shape (k, n, 3).
        quaternions: Rotations (x, y, z, w), shape (k, n, 4).
        wanted: Times from the first to the last of `times` [s], shape (m,).
        scene: Gives gravity and the radius of the smallest sphere.
        noise: Standard deviation of each coordinate [m].
    """
    gravity = np.asarray(scene.gravity, dtype=np.float64)
    radius = float(np.min(scene.radius))
    step = np.clip(np.searchsorted(times, wanted, side='right') - 1, 0, len(times) - 2)
    nearest = step + (times[step + 1] - wanted < wanted - times[step])
    same = np.abs(wanted - times[nearest]) <= _SAME
    spans = np.diff(times)
    kinds = _kinds(spans, positions, gravity, noise)
    means = np.diff(positions, axis=0) / spans[:, None, None]
    since = (wanted - times[step])[:, None, None]
    until = (times[step + 1] - wanted)[:, None, None]
    chord = positions[step] + since * means[step]
    kind = np.where(same[:, None], -1, kinds[step])
    parabola = chord - 0.5 * gravity * since * until
    found = np.where((kind == _FLIGHT)[..., None], parabola, chord)
    found[same] = positions[nearest[same]]
    bounces = 0
    for row, sphere in np.argwhere(kind == _STRUCK):
        place = _through_contact(
            step[row], sphere, wanted[row], times, positions, means, kinds, gravity, noise, radius
        )
        if place is not None:
            found[row, sphere] = place
            bounces += 1
    turn = rotation_between(quaternions[step], quaternions[step + 1])
    rotations = rotate_quaternions(quaternions[step], turn * since / spans[step][:, None, None])
    rotations[same] = quaternions[nearest[same]]
    struck = int((kind == _STRUCK).sum())
    counts = {
        'tracked': int((kind == -1).sum()),
        'flight': int((kind == _FLIGHT).sum()),
        'carried': int((kind == _CARRIED).sum()),
        'bounce': bounces,
        'straight': struck - bounces,
    }
    return Resampled(found, rotations, counts)


def _kinds(spans: Array, positions: Array, gravity: Array, noise: float) -> NDArray[np.int_]:
    """_FLIGHT, _CARRIED or _STRUCK, for each step and sphere, shape (k - 1, n)."""
    means = np.diff(positions, axis=0) / spans[:, None, None]
    before, after = spans[:-1, None, None], spans[1:, None, None]
    change = np.diff(means, axis=0)
    fall = 0.5 * gravity * (before + after)
    jumps = np.linalg.norm(np.stack([change - fall, change]), axis=-1)  # as flight, as carried
    spread = np.sqrt(before**-2 + (1 / before + 1 / after) ** 2 + after**-2)
    allowed = SIGMAS * noise * spread + _BENT * np.linalg.norm(gravity) * (before + after)
    jumps = np.where(jumps <= allowed[..., 0], jumps, np.inf)
    edge = np.full((2, 1, positions.shape[1]), np.inf)
    # a step agrees with the one before it or with the one after it
    either = np.minimum(
        np.concatenate([edge, jumps], axis=1), np.concatenate([jumps, edge], axis=1)
    )
    return np.where(np.isfinite(either).any(axis=0), either.argmin(axis=0), _STRUCK)


def _through_contact(
    step: int,
    sphere: int,
    wanted: float,
    times: Array,
    positions: Array,
    means: Array,
    kinds: NDArray[np.int_],
    gravity: Array,
    noise: float,
    radius: float,
) -> Array | None:
    """Position in a step with a contact [m], shape (3,); None where its two sides do not meet."""
    if step == 0 or step + 1 >= len(means):
        return None
    sides = kinds[step - 1, sphere], kinds[step + 1, sphere]
    if _STRUCK in sides:
        return None
    start, end = times[step], times[step + 1]
    falls = [gravity * (side == _FLIGHT) for side in sides]
    spans = times[step] - times[step - 1], times[step + 2] - times[step + 1]
    speeds = (
        means[step - 1, sphere] + 0.5 * falls[0] * spans[0],
        means[step + 1, sphere] - 0.5 * falls[1] * spans[1],
    )

    def forward(since: Array) -> Array:
        places: Array = positions[step, sphere] + speeds[0] * since + 0.5 * falls[0] * since**2
        return places

    def backward(until: Array) -> Array:
        places: Array = positions[step + 1, sphere] - speeds[1] * until + 0.5 * falls[1] * until**2
        return places

    moments = np.linspace(start, end, _MOMENTS)[:, None]
    apart = np.linalg.norm(forward(moments - start) - backward(end - moments), axis=1)
    met = int(apart.argmin())
    # noise of both sides, extrapolated over this step
    spread = noise * np.sqrt(2.0) * (1.0 + 2.0 * (end - start) / min(spans))
    # and the relative travel between two of the times tried
    coarse = float(np.linalg.norm(speeds[1] - speeds[0])) * (end - start) / _MOMENTS
    if apart[met] > _MEET * radius + SIGMAS * spread + coarse:
        return None
    if wanted <= moments[met, 0]:
        return forward(np.array([wanted - start]))
    return backward(np.array([end - wanted]))
