# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Changes of a scene and its start that do not change the motion, and the way back from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from .scenes import Case
from ...scenes.plane import Plane, RANGES
from ...scenes.scene import Scene
from ...scenes.state import Array, State, Trajectory

_PER_SPHERE = tuple(RANGES)
_MOST_TILES = 3  # along each side of a plate


@dataclass(frozen=True)
class Change:
    """A changed scene and start; `back` maps their trajectory to that of the case."""

    name: str
    scene: Scene
    start: State
    back: Callable[[Trajectory], Trajectory] = lambda trajectory: trajectory


def changes_of(case: Case) -> list[Change]:
    """The case turned and moved, mirrored, in another order, and with its plates in tiles."""
    rng = np.random.default_rng([case.seed, case.number, 1])
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    axis = rng.normal(size=3)
    mirror = np.eye(3) - 2 * np.outer(axis, axis) / (axis @ axis)
    return [
        moved(case, 'turned', turn, rng.uniform(-10.0, 10.0, 3)),
        moved(case, 'mirrored', mirror, np.zeros(3)),
        permuted(case, rng),
        Change('tiled', tiled(case.scene, rng), case.start),
    ]


def nudged(case: Case, size: float, count: int) -> list[State]:
    """Starts with all centres and velocities moved by `size` [m, m/s] in random directions."""
    rng = np.random.default_rng([case.seed, case.number, 2])
    shape = case.start.positions.shape
    starts = []
    for _ in range(count):
        moves = rng.normal(size=(3, *shape))
        moves *= size / np.linalg.norm(moves, axis=-1, keepdims=True)
        state = case.start
        starts.append(
            replace(
                state,
                positions=state.positions + moves[0],
                velocities=state.velocities + moves[1],
                angular_velocities=state.angular_velocities + moves[2],
            )
        )
    return starts


def moved(case: Case, name: str, matrix: Array, shift: Array) -> Change:
    """Map everything by M p + s, M orthogonal; angular velocities are axial vectors."""
    sign = np.sign(np.linalg.det(matrix))

    def plane(of: Plane) -> Plane:
        return replace(
            of,
            point=tuple(matrix @ of.point + shift),
            normal=tuple(matrix @ of.normal),
            direction=tuple(matrix @ of.axes[0]),
        )

    def back(trajectory: Trajectory) -> Trajectory:
        return replace(
            trajectory,
            positions=(trajectory.positions - shift) @ matrix,
            velocities=trajectory.velocities @ matrix,
            angular_velocities=sign * trajectory.angular_velocities @ matrix,
        )

    scene = replace(
        case.scene,
        surfaces=tuple(plane(surface) for surface in case.scene.surfaces),
        gravity=tuple(matrix @ case.scene.gravity),
    )
    start = State(
        positions=case.start.positions @ matrix.T + shift,
        velocities=case.start.velocities @ matrix.T,
        angular_velocities=sign * case.start.angular_velocities @ matrix.T,
    )
    return Change(name, scene, start, back)


def permuted(case: Case, rng: np.random.Generator) -> Change:
    """Spheres and planes in another order."""
    order, planes = rng.permutation(len(case.start)), case.scene.surfaces
    own: dict[str, Any] = {
        name: tuple(np.asarray(value)[order])
        for name in _PER_SPHERE
        if isinstance(value := getattr(case.scene, name), tuple)
    }
    scene = replace(
        case.scene, surfaces=tuple(planes[k] for k in rng.permutation(len(planes))), **own
    )
    start = State(**{name: value[order] for name, value in vars(case.start).items()})
    where = np.argsort(order)

    def back(trajectory: Trajectory) -> Trajectory:
        arrays = {k: v[:, where] for k, v in vars(trajectory).items() if k != 'dt'}
        return replace(trajectory, **arrays)

    return Change('permuted', scene, start, back)


def tiled(scene: Scene, rng: np.random.Generator) -> Scene:
    """Scene with each plate cut at random across its finite sides, into a grid of tiles."""
    return replace(scene, surfaces=tuple(t for s in scene.surfaces for t in _tiles(s, rng)))


def _tiles(plane: Plane, rng: np.random.Generator) -> list[Plane]:
    return [
        replace(
            plane,
            point=tuple(plane.point + np.array([x, y]) @ plane.axes[:2]),
            length_x=length_x,
            length_y=length_y,
        )
        for x, length_x in _cuts(plane.length_x, rng)
        for y, length_y in _cuts(plane.length_y, rng)
    ]


def _cuts(length: float, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Middles and lengths of the parts of a side that is cut at random places."""
    if np.isinf(length):
        return [(0.0, length)]
    inner = rng.uniform(-0.5, 0.5, rng.integers(1, _MOST_TILES)) * length
    ends = np.sort([-length / 2, *inner, length / 2])
    return [((a + b) / 2, b - a) for a, b in pairwise(ends)]
