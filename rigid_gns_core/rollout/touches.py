# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What spheres touch in rollouts, and when: it tells the branches of a future apart."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from .paths import Paths
from ..scenes.plane import Plane
from ..scenes.scene import Scene
from ..scenes.state import Array

# a blow is of a surface that is within this of touching [radii], and pushes within this angle of
# the way to the sphere; else another sphere gave it
_NEAR, _COSINE = 0.25, 0.3
# blows of one thing in steps that follow each other are one touch: it settles
_APART = 2.5

Touches = list[tuple[float, str]]


def touches_of(paths: Paths, scene: Scene, sphere: int) -> list[Touches]:
    """Time [s] and name of what a sphere touched, in each rollout; see `Branch.touched`."""
    from ..kernels.between_steps import find_meetings

    samples, steps = len(paths.positions), paths.steps
    found: list[Touches] = [[] for _ in range(samples)]
    which, meetings = np.empty((samples * steps, 2), np.int64), np.empty((samples * steps, 4))
    count = find_meetings(paths.compiled, sphere, which, meetings)
    if not count:
        return found
    sample, step = which[:count].T
    places, times = meetings[:count, :3], meetings[:count, 3]
    radius = float(scene.per_sphere('radius', paths.positions.shape[2])[sphere])
    names = _names(scene, times, places, paths.blows[sample, step, sphere], radius)
    for row, time, name in zip(sample.tolist(), times.tolist(), names, strict=True):
        own = found[row]
        if own and own[-1][1] == name and time - own[-1][0] < _APART * paths.dt:
            continue
        own.append((time, name))
    return found


def _names(scene: Scene, times: Array, places: Array, blows: Array, radius: float) -> list[str]:
    """Name of what each blow at a centre [m], shape (m, 3), came from."""
    surfaces, obstacles = scene.surfaces, scene.obstacles
    if not (surfaces or obstacles):
        return ['sphere'] * len(places)
    gaps, out = _from_planes(surfaces, times, places, blows, radius)
    for obstacle in obstacles:
        distance, normal = obstacle.closest(places)
        cosines = (normal * blows).sum(axis=1)
        cosines /= np.maximum(np.linalg.norm(blows, axis=1), 1e-300)
        gap = np.where(cosines > _COSINE, np.abs(distance - radius), np.inf)
        gaps, out = np.column_stack([gaps, gap]), np.column_stack([out, np.zeros(len(gap), bool)])
    nearest = gaps.argmin(axis=1)
    rows = np.arange(len(places))
    met, beyond = gaps[rows, nearest] <= _NEAR * radius, out[rows, nearest]
    known = [f'surface {k}' for k in range(len(surfaces))]
    known += [f'obstacle {k}' for k in range(len(obstacles))]
    return [
        (f'edge of {known[k]}' if past else known[k]) if touch else 'sphere'
        for k, touch, past in zip(nearest.tolist(), met.tolist(), beyond.tolist(), strict=True)
    ]


def _from_planes(
    surfaces: tuple[Plane, ...], times: Array, places: Array, blows: Array, radius: float
) -> tuple[Array, NDArray[np.bool_]]:
    """See `find_gaps`, shapes (m, surfaces)."""
    from ..kernels.samples import find_gaps

    gaps = np.empty((len(places), len(surfaces)))
    out = np.zeros(gaps.shape, dtype=np.bool_)
    if not surfaces:
        return gaps, out
    arms = places[:, None] - np.array([plane.point for plane in surfaces])
    pushes = np.repeat(blows[:, None], len(surfaces), axis=1)
    for k, plane in enumerate(surfaces):
        if plane.changes_place:  # as they would be where the plane was at the start
            turn, gone = _moved(plane, times)
            arms[:, k] = turn.inv().apply(arms[:, k] - gone)
            pushes[:, k] = turn.inv().apply(blows)
    axes = np.array([plane.axes[:2] for plane in surfaces])
    half = np.array([plane.half_lengths for plane in surfaces])
    find_gaps(arms, pushes, axes, half, radius, _COSINE, gaps, out)
    return gaps, out


def _moved(plane: Plane, times: Array) -> tuple[Rotation, Array]:
    """How a plane has turned at times, shape (m,), and where its point has gone, shape (m, 3)."""
    if plane.plan is None:
        turns = Rotation.from_rotvec(times[:, None] * plane.angular_velocity)
        return turns, times[:, None] * plane.velocity
    origin, then = plane.plan.at(np.zeros(1)), plane.plan.at(times)
    turn = Rotation.from_quat(then.quaternions) * Rotation.from_quat(origin.quaternions[0]).inv()
    arm = np.asarray(plane.point) - origin.positions[0]
    return turn, then.positions + turn.apply(arm) - plane.point
