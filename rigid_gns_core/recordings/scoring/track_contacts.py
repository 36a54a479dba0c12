# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contacts that a track shows: sudden changes of velocity.

To the samples around each interval a motion of constant acceleration is fitted, with a change of
velocity somewhere in the interval: p = p0 + v0 t + a t^2/2 + [t > 0] (d + u t). The interval is
that of a contact where the change u is many of its standard deviations, larger than what counts as
a blow, and more certain than in the intervals beside it. Away from surfaces and other spheres it
has to be twice as certain: there trackers are at fault more often than something unknown is met.

Two contacts within the same samples hide each other, as in a corner. So the interval is that of a
contact, too, where the sphere came straight to a plane at rest until then and leaves it since.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...data.tracks import Track
from ...scenes.plane import closest_points
from ...scenes.scene import Scene
from ...scenes.state import Array
from ...tracking.ball_model import BallModel
from ...tracking.held import held

# most and least samples on each side of an interval, how far they may be from it [sqrt(r / g)];
# the least ones may be farther, since some trackers say nothing of a slow ball until it has moved
_MOST, _LEAST, _REACH, _FAR = 8, 3, 2.5, 5.0
# least change of velocity [its standard deviations], near something and elsewhere; [sqrt(g r)]
_NEAR, _ELSEWHERE, _BLOW = 6.0, 12.0, 0.3
# where a sphere turns at a plane, the line of before leads to it up to this [radii]
_MEETS = 0.15
# beyond the ends of a plane its closest point is this far from the normal [radii]
_ON = 1e-6


def contacts_of(track: Track, scene: Scene, radii: Array, noise: float) -> list[Array]:
    """Times of the contacts of each sphere of a track [s], rising, in the middle of two samples.

    Args:
        track: The track.
        scene: Surfaces and gravity.
        radii: Radius of each of its spheres [m], shape (n,).
        noise: Standard deviation of each coordinate [m].
    """
    gravity = float(np.linalg.norm(scene.gravity))
    found = []
    for sphere, radius in enumerate(radii.tolist()):
        times, places = track.samples(sphere)
        near, gaps = np.zeros(max(len(times) - 1, 0), dtype=bool), np.zeros((0, len(times)))
        if len(times) > 1:
            near = _near(track, sphere, scene, radii)
            gaps = _gaps(scene, places, radius)
        found.append(
            contact_times(
                times, places, radius=radius, gravity=gravity, noise=noise, near=near, gaps=gaps
            )
        )
    return found


def held_times(track: Track, scene: Scene, noise: float) -> list[Array]:
    """Times of the frames in which each sphere of a track is held [s], rising, see `held`."""
    count = len(track.spheres)
    masses = scene.per_sphere('mass', count)
    found = []
    for sphere in range(count):
        times, places = track.samples(sphere)
        model = BallModel.of(scene, sphere, count)
        found.append(times[held(model, float(masses[sphere]), times, places, noise)])
    return found


def contact_times(
    times: Array,
    positions: Array,
    *,
    radius: float,
    gravity: float,
    noise: float,
    near: NDArray[np.bool_],
    gaps: Array,
) -> Array:
    """Times of the contacts of one sphere [s], rising, each in the middle of two samples.

    Args:
        times: Times of its samples [s], shape (k,).
        positions: Centres [m], shape (k, 3).
        radius: Radius [m].
        gravity: Size of gravity [m/s^2]; 0: 9.81, which only sets the scale of speed and time.
        noise: Standard deviation of each coordinate [m].
        near: Whether a surface or another sphere is near in an interval, shape (k - 1,).
        gaps: From each plane at rest [m], NaN beyond its ends, shape (planes, k).
    """
    gravity = gravity or 9.81
    scale = float(np.sqrt(radius / gravity))
    blow = _BLOW * float(np.sqrt(radius * gravity))
    scores = np.zeros(max(len(times) - 1, 0))
    for index in range(_LEAST - 1, len(times) - _LEAST):
        begin, end = max(index + 1 - _MOST, 0), min(index + 1 + _MOST, len(times))
        own = times[begin:end]
        # of the last of before and the first of after
        away = np.maximum(times[index] - own, own - times[index + 1])
        least = np.abs(np.arange(begin, end) - index - 0.5) < _LEAST
        used = away <= np.where(least, _FAR, _REACH) * scale
        if not used[least].all():
            continue
        t = own[used] - 0.5 * (times[index] + times[index + 1])
        change, error = _change(t, positions[begin:end][used], noise)
        sigmas = _NEAR if near[index] else _ELSEWHERE
        if change > max(sigmas * error, blow):
            scores[index] = change / error
    found: list[int] = []
    for gap in gaps:
        turns = _turns(times, gap, noise, blow, _MEETS * radius, _FAR * scale)
        found += _apart(turns, [])
    found += _apart(scores, found)
    chosen = np.unique(np.array(found, dtype=np.int64))
    middles: Array = 0.5 * (times[chosen] + times[chosen + 1])
    return middles


def _apart(scores: Array, before: Sequence[int]) -> list[int]:
    """Intervals of the largest scores above 0, none within `_LEAST` of another or one before."""
    found: list[int] = []
    for index in np.argsort(-scores, kind='stable').tolist():
        if scores[index] <= 0:
            break
        if all(abs(index - other) >= _LEAST for other in (*before, *found)):
            found.append(index)
    return found


def _turns(times: Array, gap: Array, noise: float, blow: float, meets: float, far: float) -> Array:
    """Change of the speed towards a plane in each interval in which the sphere turns [m/s].

    0 where it does not.
    """
    changes = np.zeros(max(len(times) - 1, 0))
    for index in range(_LEAST - 1, len(times) - _LEAST):
        first, last = index + 1 - _LEAST, index + _LEAST
        before, after = times[index] - times[first], times[last] - times[index + 1]
        if max(before, after) > far:
            continue
        comes = (gap[first] - gap[index]) / before
        leaves = (gap[last] - gap[index + 1]) / after
        error = noise * float(np.sqrt(2.0)) / min(before, after)
        reached = gap[index] - comes * (times[index + 1] - times[index])
        # false where a gap is NaN
        sure = min(comes, leaves) > _NEAR * error and comes + leaves > blow
        if sure and reached <= meets and gap[index] >= -meets:
            # of intervals beside each other that in which the line meets the plane
            inside = reached <= 0.0 <= gap[index]
            changes[index] = (comes + leaves) * (1.0 if inside else 0.5)
    return changes


def _gaps(scene: Scene, places: Array, radius: float) -> Array:
    """Distances of a sphere from each plane at rest [m], NaN beyond its ends, shape (m, k)."""
    planes = tuple(plane for plane in scene.surfaces if not plane.changes_place)
    if not planes:
        return np.zeros((0, len(places)))
    points, _ = closest_points(planes, places)
    apart = np.linalg.norm(points - places[:, None], axis=-1)
    across = np.abs(np.einsum('kmc,mc->km', points - places[:, None], [p.normal for p in planes]))
    return np.where(apart - across < _ON * radius, apart - radius, np.nan).T


def _near(track: Track, sphere: int, scene: Scene, radii: Array) -> NDArray[np.bool_]:
    """Whether a surface or another sphere is within a radius and a step of it, shape (k - 1,)."""
    times, places = track.samples(sphere)
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    gaps = np.full(len(times), np.inf)
    if scene.surfaces:
        points, _ = closest_points(scene.surfaces, places)
        apart = np.linalg.norm(points - places[:, None], axis=-1).min(axis=1)
        gaps = apart - radii[sphere]
    for obstacle in scene.obstacles:
        gaps = np.minimum(gaps, obstacle.closest(places)[0] - radii[sphere])
    for other in range(len(radii)):
        seen_at, seen = track.samples(other)
        if other == sphere or not len(seen_at):
            continue
        there = np.stack([np.interp(times, seen_at, axis) for axis in seen.T], axis=1)
        apart = np.linalg.norm(there - places, axis=1)
        gaps = np.minimum(gaps, apart - radii[sphere] - radii[other])
    near: NDArray[np.bool_] = np.minimum(gaps[:-1], gaps[1:]) <= radii[sphere] + steps
    return near


def _change(t: Array, places: Array, noise: float) -> tuple[float, float]:
    """Change of velocity at t = 0, and its standard deviation [m/s]."""
    span = float(t[-1] - t[0])
    s = t / span
    late = s > 0
    basis = np.stack([np.ones_like(s), s, s**2, late, late * s], axis=1)
    inverse = np.linalg.pinv(basis)
    solution = inverse @ places
    left = places - basis @ solution
    free = max(len(t) - 5, 1)
    sigma = max(noise, float(np.sqrt((left**2).sum() / (3 * free))))
    change = float(np.linalg.norm(solution[4])) / span
    return change, sigma * float(np.linalg.norm(inverse[4])) / span
