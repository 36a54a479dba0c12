# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What spheres touch in rollouts, and when: it tells the branches of a future apart."""

from __future__ import annotations

import numpy as np
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
    found: list[Touches] = [[] for _ in range(len(paths.positions))]
    sample, step = np.nonzero(paths.struck[:, :, sphere])
    if not len(sample):
        return found
    from ..kernels.between_steps import find_meetings

    places, since = np.empty((len(sample), 3)), np.empty(len(sample))
    find_meetings(paths.compiled, sample, step, sphere, places, since)
    radius = float(scene.per_sphere('radius', paths.positions.shape[2])[sphere])
    times = step * paths.dt + since
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
    gaps = np.empty((len(places), len(surfaces) + len(obstacles)))
    out = np.zeros(gaps.shape, dtype=np.bool_)
    if surfaces:
        # of each plane, where it was at the start
        arms = places[:, None] - np.array([plane.point for plane in surfaces])
        push = np.broadcast_to(blows[:, None], arms.shape)
        if any(plane.changes_place for plane in surfaces):
            push = push.copy()
        for k, plane in enumerate(surfaces):
            if plane.changes_place:
                turn, gone = _moved(plane, times)
                arms[:, k] = turn.inv().apply(arms[:, k] - gone)
                push[:, k] = turn.inv().apply(blows)
        axes = np.array([plane.axes[:2] for plane in surfaces])
        ends = np.array([plane.half_lengths for plane in surfaces])
        along = np.einsum('mkc,kac->mka', arms, axes)
        ways = arms - np.einsum('mka,kac->mkc', np.clip(along, -ends, ends), axes)
        lengths = np.linalg.norm(ways, axis=2)
        cosines = (ways * push).sum(axis=2)
        cosines /= np.maximum(lengths * np.linalg.norm(push, axis=2), 1e-300)
        gaps[:, : len(surfaces)] = np.where(cosines > _COSINE, np.abs(lengths - radius), np.inf)
        out[:, : len(surfaces)] = (np.abs(along) > ends).any(axis=2)
    for k, obstacle in enumerate(obstacles, len(surfaces)):
        distance, normal = obstacle.closest(places)
        cosines = (normal * blows).sum(axis=1)
        cosines /= np.maximum(np.linalg.norm(blows, axis=1), 1e-300)
        gaps[:, k] = np.where(cosines > _COSINE, np.abs(distance - radius), np.inf)
    nearest = gaps.argmin(axis=1)
    rows = np.arange(len(places))
    met, beyond = gaps[rows, nearest] <= _NEAR * radius, out[rows, nearest]
    known = [f'surface {k}' for k in range(len(surfaces))]
    known += [f'obstacle {k}' for k in range(len(obstacles))]
    return [
        (f'edge of {known[k]}' if past else known[k]) if touch else 'sphere'
        for k, touch, past in zip(nearest.tolist(), met.tolist(), beyond.tolist(), strict=True)
    ]


def _moved(plane: Plane, times: Array) -> tuple[Rotation, Array]:
    """How a plane has turned at times, shape (m,), and where its point has gone, shape (m, 3)."""
    if plane.plan is None:
        turns = Rotation.from_rotvec(times[:, None] * plane.angular_velocity)
        return turns, times[:, None] * plane.velocity
    origin, then = plane.plan.at(np.zeros(1)), plane.plan.at(times)
    turn = Rotation.from_quat(then.quaternions) * Rotation.from_quat(origin.quaternions[0]).inv()
    arm = np.asarray(plane.point) - origin.positions[0]
    return turn, then.positions + turn.apply(arm) - plane.point
