# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Motion that a body will have: poses and twists at points in time, cubic between them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .state import Array, as_unit, LARGEST, rotate_quaternions, rotation_between
from ..errors import UserError

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

_WIDTHS = {'positions': 3, 'quaternions': 4, 'velocities': 3, 'angular_velocities': 3}
_UNIT = 1e-3  # of the length of a quaternion from 1
_NEXT, _LAST = [1, 2, 0], [2, 0, 1]


class Moments(NamedTuple):
    """A body at k times, world frame.

    positions: of its origin [m], shape (k, 3); quaternions: (x, y, z, w), shape (k, 4);
    velocities: of its origin [m/s], shape (k, 3); angular_velocities: [rad/s], shape (k, 3).
    """

    positions: Array
    quaternions: Array
    velocities: Array
    angular_velocities: Array


@dataclass(frozen=True)
class PlannedMotion:
    """Poses and twists of a body at two or more points in time, in the world frame.

    Between two points the position is the cubic with their positions and velocities (Hermite), and
    so is the rotation vector from the first. Two points of one time and place give a twist that
    jumps. Before the first point and after the last the body rests there.

    Args:
        times: Since the start of a rollout [s], not falling, shape (k,).
        positions: Of the origin of the body [m], shape (k, 3).
        quaternions: Rotations (x, y, z, w), shape (k, 4); less than half a turn from point to
            point.
        velocities: Of the origin [m/s], shape (k, 3).
        angular_velocities: [rad/s], shape (k, 3).

    Raises:
        UserError: Numbers of points differ, a number is not finite, times fall, or a quaternion is
            not of length 1.
    """

    times: tuple[float, ...]
    positions: tuple[Vector, ...]
    quaternions: tuple[Quaternion, ...]
    velocities: tuple[Vector, ...]
    angular_velocities: tuple[Vector, ...]

    def __post_init__(self) -> None:
        times = np.asarray(self.times, dtype=np.float64)
        if times.ndim != 1 or len(times) < 2:
            raise UserError('times of a plan have less than two points')
        if not (np.abs(times) <= LARGEST).all() or (np.diff(times) < 0).any():
            raise UserError('times of a plan are not finite, or fall')
        for name, width in _WIDTHS.items():
            values = np.asarray(getattr(self, name), dtype=np.float64)
            if values.shape != (len(times), width):
                raise UserError(
                    f'{name} of a plan have shape {values.shape}, expected {(len(times), width)}'
                )
            if not (np.abs(values) <= LARGEST).all():
                raise UserError(f'{name} of a plan are not finite')
        if (np.abs(np.linalg.norm(self.quaternions, axis=1) - 1.0) > _UNIT).any():
            raise UserError('a quaternion of a plan is not of length 1')

    @classmethod
    def of(cls, times: Array, moments: Moments) -> PlannedMotion:
        """Plan of arrays; see `Moments`."""
        return cls(
            tuple(times.tolist()),
            *(tuple(tuple(row) for row in values.tolist()) for values in moments),
        )

    @cached_property
    def moments(self) -> Moments:
        """What it gives, as arrays, which nobody changes."""
        return Moments(*(np.array(getattr(self, name), dtype=np.float64) for name in _WIDTHS))

    def at(self, times: Array) -> Moments:
        """The body at times since the start [s], shape (k,)."""
        knots, given = np.array(self.times), self.moments
        first, last = times < knots[0], times >= knots[-1]
        k = np.clip(np.searchsorted(knots, times, 'right') - 1, 0, len(knots) - 2)
        p, q, v, w = (values[k] for values in given)
        p1, q1, v1, w1 = (values[k + 1] for values in given)
        length = (knots[k + 1] - knots[k])[:, None]
        length = np.where(length > 0, length, 1.0)  # of points of one time, which are not met
        share = (np.clip(times, knots[0], knots[-1]) - knots[k])[:, None] / length
        way, velocity = _cubic(share, length, p1 - p, v, v1)
        turned = rotation_between(q, q1)
        # rates of the rotation vector at both ends
        turn, rate = _cubic(share, length, turned, w, _rate_of(turned, w1))
        found = Moments(
            p + way, rotate_quaternions(as_unit(q), turn), velocity, _spin_of(turn, rate)
        )
        for out, end in ((first, 0), (last, -1)):
            found.positions[out], found.quaternions[out] = (
                given.positions[end],
                as_unit(given.quaternions[end]),
            )
            found.velocities[out] = found.angular_velocities[out] = 0.0
        return found


def cross(a: Array, b: Array) -> Array:
    """Cross products of rows, shape (k, 3): np.cross takes four times as long for few."""
    found: Array = a[:, _NEXT] * b[:, _LAST] - a[:, _LAST] * b[:, _NEXT]
    return found


def _cubic(
    share: Array, length: Array, way: Array, begin: Array, end: Array
) -> tuple[Array, Array]:
    """Cubic from 0 to `way` with these rates at its ends, and its rate, at a share of `length`."""
    s, r = share, 1.0 - share
    value = s * s * (3.0 - 2.0 * s) * way + length * s * r * (r * begin - s * end)
    rate = 6.0 * s * r / length * way + r * (r - 2.0 * s) * begin + s * (s - 2.0 * r) * end
    return value, rate


def _spin_of(turn: Array, rate: Array) -> Array:
    """Angular velocity by the rate of a rotation vector, to third order in the turn."""
    across = cross(turn, rate)
    found: Array = rate + across / 2.0 + cross(turn, across) / 6.0
    return found


def _rate_of(turn: Array, spin: Array) -> Array:
    """Rate of a rotation vector by the angular velocity, to fourth order in the turn."""
    across = cross(turn, spin)
    found: Array = spin - across / 2.0 + cross(turn, across) / 12.0
    return found
