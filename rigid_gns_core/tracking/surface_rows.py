# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Surfaces and obstacles of a scene as rows of `planes`, see `ball_surfaces`.

The first rows are the surfaces that stay, in their order. Then come the obstacles, then what
changes place. That is where the scene has it at time 0, and was before as its plan says, or where
its twist at the first of these times takes it back to.
"""

from __future__ import annotations

import numpy as np

from .ball_surfaces import (
    BEGIN,
    BELT,
    END,
    KIND,
    MOVES,
    PLANE,
    PUSH,
    SECTION,
    SECTION_END,
    SINCE,
    SOLID,
    SPIN,
    TWIST,
    VELOCITY,
)
from ..engine import world
from ..engine.planned_planes import motion_rows
from ..scenes.obstacle import Obstacle, Profile
from ..scenes.plane import Plane
from ..scenes.state import Array

# a planned motion is followed in pieces of this time [s], in each of which its twist changes at a
# constant rate, and for so long before time 0 at most
_PIECE, _LONGEST = 0.01, 2.0

Row = tuple[Plane, Array]


def fixed_rows(planes: tuple[Plane, ...], obstacles: tuple[Obstacle, ...]) -> list[Row]:
    """Surfaces that stay and obstacles, each with the plane that has its materials."""
    rows = [(plane, _plane_row(plane)) for plane in planes]
    for obstacle in obstacles:
        rows += [(plane, _plane_row(plane, profile)) for plane, profile in _bounds(obstacle)]
    return rows


def moving_rows(planes: tuple[Plane, ...]) -> list[Row]:
    """Planes that change place; those with two faces are there twice, those planned by pieces."""
    rows: list[Row] = []
    for plane in planes:
        pieces = _pieces(plane)
        rows += [(plane, piece) for piece in pieces]
        if not plane.is_half_space:
            back = pieces.copy()
            back[:, 6:12] *= -1.0
            rows += [(plane, piece) for piece in back]
    return rows


def at_time(rows: Array, now: float) -> Array:
    """Rows with time 0 at another time [s]."""
    moved = rows.copy()
    moving = rows[:, KIND] == MOVES
    for column in (SINCE, BEGIN, END):
        moved[moving, column] += now
    return moved


def of_rows(rows: list[Row]) -> Array:
    """Rows as one array, shape (rows, PLANE)."""
    return np.array([row for _, row in rows]).reshape(-1, PLANE)


def parts_of(obstacle: Obstacle) -> int:
    """Number of rows of an obstacle."""
    return len(_bounds(obstacle))


def _bounds(obstacle: Obstacle) -> tuple[tuple[Plane, Profile | None], ...]:
    """Plates of a box, or one solid: a ball that lies in a hole touches its rim once here."""
    return obstacle.parts if obstacle.shape == 'box' else obstacle.parts[:1]


def _plane_row(plane: Plane, profile: Profile | None = None) -> Array:
    row = np.zeros(PLANE)
    row[:3], row[3:12], row[12:KIND] = plane.point, plane.axes.ravel(), plane.half_lengths
    if profile is not None:
        row[KIND], row[SECTION:SECTION_END] = SOLID, (1.0, *profile)
    else:
        row[BELT : BELT + 3] = plane.surface_velocity
    return row


def _pieces(plane: Plane) -> Array:
    """Rows of one face of a plane that changes place: back with its first twist, then as planned.

    Shape (pieces, PLANE).
    """
    first = _plane_row(plane)
    if not plane.changes_place:
        return first[None]
    first[KIND], first[BEGIN], first[END] = MOVES, -np.inf, np.inf
    first[VELOCITY : VELOCITY + 3], first[SPIN : SPIN + 3] = plane.velocity, plane.angular_velocity
    if plane.plan is None:
        return first[None]
    past = min(max(-plane.plan.times[0], 0.0), _LONGEST)
    count = int(np.ceil(past / _PIECE))
    # not to the last bit, or the plan would not have begun
    h = past / count * (1.0 - 1e-12) if count else _PIECE
    planned = motion_rows(plane, h, -count, count + 1, 1)
    rows = np.tile(first, (count + 1, 1))
    rows[:, :3] = planned[:, world.POINT : world.POINT + 3]
    rows[:, 3:12] = planned[:, world.AXES : world.AXES + 9]
    for column, own in (
        (VELOCITY, world.VELOCITY), (SPIN, world.TURNING), (PUSH, world.PUSH),
        (TWIST, world.TWIST), (BELT, world.BELT),
    ):  # fmt: skip
        rows[:, column : column + 3] = planned[:, own : own + 3]
    rows[:, SINCE] = rows[:, BEGIN] = h * np.arange(-count, 1)
    rows[:-1, END] = rows[1:, BEGIN]
    before = rows[:1].copy()
    before[:, PUSH : TWIST + 3], before[:, BEGIN], before[:, END] = 0.0, -np.inf, rows[0, BEGIN]
    rows = np.concatenate([before, rows[:count]])
    rows[-1, END] = np.inf
    return rows
