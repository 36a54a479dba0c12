# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contacts that a track shows: sudden changes of velocity.

To the samples around each interval a motion of constant acceleration is fitted, with a change of
velocity somewhere in the interval: p = p0 + v0 t + a t^2/2 + [t > 0] (d + u t). The interval is
that of a contact where the change u is many of its standard deviations, larger than what counts as
a blow, and more certain than in the intervals beside it. Away from surfaces and other spheres it
has to be twice as certain: there trackers are at fault more often than something unknown is met.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...data.tracks import Track
from ...scenes.plane import closest_points
from ...scenes.scene import Scene
from ...scenes.state import Array
from ...tracking.ball_model import BallModel
from ...tracking.held import held

# most and least samples on each side of an interval, and how far they may be from it [sqrt(r / g)]
_MOST, _LEAST, _REACH = 8, 3, 2.5
# least change of velocity [its standard deviations], near something and elsewhere; [sqrt(g r)]
_NEAR, _ELSEWHERE, _BLOW = 6.0, 12.0, 0.3


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
        near = np.zeros(max(len(times) - 1, 0), dtype=bool)
        if len(times) > 1:
            near = _near(track, sphere, scene, radii)
        found.append(
            contact_times(times, places, radius=radius, gravity=gravity, noise=noise, near=near)
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
) -> Array:
    """Times of the contacts of one sphere [s], rising, each in the middle of two samples.

    Args:
        times: Times of its samples [s], shape (k,).
        positions: Centres [m], shape (k, 3).
        radius: Radius [m].
        gravity: Size of gravity [m/s^2]; 0: 9.81, which only sets the scale of speed and time.
        noise: Standard deviation of each coordinate [m].
        near: Whether a surface or another sphere is near in an interval, shape (k - 1,).
    """
    gravity = gravity or 9.81
    reach = _REACH * float(np.sqrt(radius / gravity))
    blow = _BLOW * float(np.sqrt(radius * gravity))
    scores = np.zeros(max(len(times) - 1, 0))
    for index in range(_LEAST - 1, len(times) - _LEAST):
        begin, end = max(index + 1 - _MOST, 0), index + 1 + _MOST
        own = times[begin:end]
        used = (own >= times[index] - reach) & (own <= times[index + 1] + reach)
        before = int(used[: index + 1 - begin].sum())
        if before < _LEAST or int(used.sum()) - before < _LEAST:
            continue
        t = own[used] - 0.5 * (times[index] + times[index + 1])
        change, error = _change(t, positions[begin:end][used], noise)
        sigmas = _NEAR if near[index] else _ELSEWHERE
        if change > max(sigmas * error, blow):
            scores[index] = change / error
    found: list[int] = []
    for index in np.argsort(-scores, kind='stable'):
        if scores[index] <= 0:
            break
        if all(abs(int(index) - other) >= _LEAST for other in found):
            found.append(int(index))
    chosen = np.sort(np.array(found, dtype=np.int64))
    middles: Array = 0.5 * (times[chosen] + times[chosen + 1])
    return middles


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
