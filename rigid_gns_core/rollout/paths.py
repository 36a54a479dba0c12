# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Paths of rollouts between their steps: cubics, and two flights where a blow is in between."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scenes.air import Air
from ..scenes.scene import Scene
from ..scenes.state import Array, State

# a velocity changes in a step by more than flight makes it and this part of gravity: a blow. What
# rolls is held by gravity itself
_HELD, _OF_AIR, _ROUNDING = 1.5, 0.01, 1e-9
_VACUUM = Air(density=0.0, drag_coefficient=0.0)


class Pieces(NamedTuple):
    """Polynomials of the time since the start of a step: one until `split`, one after it.

    coefficients: Of 1, t, t^2, t^3 [m, s], shape (..., 2, 4, 3); split: [s], shape (...).
    """

    coefficients: Array
    split: Array


@dataclass(frozen=True)
class Paths:
    """Rollouts of one scene, and what is between their steps.

    Between two steps a cubic goes through both positions and velocities. Where the velocity
    changes more than in free flight there is a blow: the flight before it is continued, then the
    flight after it, from where they come nearest to each other.

    Args:
        positions: Centres at the steps [m], shape (s, steps + 1, n, 3).
        velocities: Of the instant [m/s], likewise.
        flights: Accelerations that free flight has at the steps [m/s^2], likewise.
        blows: Changes of velocity by blows in the steps [m/s], 0 where there is none, shape
            (s, steps, n, 3).
        dt: Time step [s].
        exact: Whether velocities are those of the instant; if not, paths are straight lines
            between steps, without blows.
    """

    positions: Array
    velocities: Array
    flights: Array
    blows: Array
    dt: float
    exact: bool

    @classmethod
    def of(cls, scene: Scene, states: State, dt: float, *, exact: bool) -> Paths:
        """Paths of rollouts, fields of shape (s, steps + 1, n, k); NaN from a divergence on."""
        positions, velocities = states.positions, states.velocities
        samples, frames, count = positions.shape[:3]
        blows = np.zeros((samples, frames - 1, count, 3))
        flights = np.zeros(positions.shape)
        if not (exact and count):
            return cls(positions, velocities, flights, blows, dt, exact)
        # imported late: what only loads a model needs no compiler
        from ..kernels.flight import accelerations

        rows = (scene.air or _VACUUM).flight(
            scene.per_sphere('radius', count), scene.per_sphere('mass', count), scene.gravity
        )
        accelerations(
            np.ascontiguousarray(velocities.reshape(-1, count, 3)),
            np.ascontiguousarray(states.angular_velocities.reshape(-1, count, 3)),
            rows,
            flights.reshape(-1, count, 3),
        )
        blows = np.diff(velocities, axis=1) - 0.5 * dt * (flights[:, 1:] + flights[:, :-1])
        sizes = np.linalg.norm(blows, axis=-1)
        bound = _HELD * dt * np.linalg.norm(scene.gravity)
        bound = bound + _OF_AIR * dt * np.linalg.norm(flights[:, :-1], axis=-1)
        bound += _ROUNDING * np.linalg.norm(velocities[:, :-1], axis=-1)
        blows = np.where((sizes > bound)[..., None], blows, 0.0)
        return cls(positions, velocities, flights, blows, dt, exact)

    @property
    def steps(self) -> int:
        """Number of steps."""
        return int(self.positions.shape[1]) - 1

    @property
    def struck(self) -> NDArray[np.bool_]:
        """Whether a step has a blow, shape (s, steps, n)."""
        return np.asarray((self.blows != 0.0).any(axis=-1))

    def part(self, chosen: slice) -> Paths:
        """Some of the rollouts."""
        names = ('positions', 'velocities', 'flights', 'blows')
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})

    def moved(self, positions: Array, velocities: Array) -> Paths:
        """Paths with another motion added, shapes (s, steps + 1, n, 3)."""
        return replace(
            self, positions=self.positions + positions, velocities=self.velocities + velocities
        )

    def at(self, times: Array) -> tuple[Array, Array]:
        """Positions [m] and velocities [m/s] at times since the start [s], shapes (s, k, n, 3).

        Times are up to the last step, shape (k,).
        """
        nearest = np.rint(times / self.dt).astype(int)
        if (np.abs(times - nearest * self.dt) < 1e-9 * self.dt).all():
            return self.positions[:, nearest], self.velocities[:, nearest]
        step = np.clip(np.floor(times / self.dt + 1e-9).astype(int), 0, max(self.steps - 1, 0))
        t, where = (times - step * self.dt)[:, None, None], (slice(None), step)
        p, v, square, cube = self._smooth(where)
        places = p + t * (v + t * (square + t * cube))
        speeds = v + t * (2 * square + 3 * t * cube)
        # few steps have a blow, and both of their pieces take as long as many without
        struck = np.nonzero(self.struck[where])
        t = t[struck[1], 0, 0]
        found, split = self.pieces((struck[0], step[struck[1]], struck[2]))
        chosen = np.where((t > split)[:, None, None], found[:, 1], found[:, 0])
        places[struck], speeds[struck] = value(chosen, t), slope(chosen, t)
        return places, speeds

    def _smooth(self, where: tuple[Any, ...]) -> tuple[Array, Array, Array, Array]:
        """Coefficients of 1, t, t^2, t^3 in steps without a blow; index as of `pieces`."""
        after = (where[0], np.asarray(where[1]) + 1, *where[2:])
        p, v, h = self.positions[where], self.velocities[where], self.dt
        q, w = self.positions[after], self.velocities[after]
        if not self.exact:
            zero = np.zeros(p.shape)
            return p, (q - p) / h, zero, zero
        square = 3 * (q - p) / h**2 - (2 * v + w) / h
        return p, v, square, 2 * (p - q) / h**3 + (v + w) / h**2

    def pieces(self, where: tuple[Any, ...]) -> Pieces:
        """Polynomials in the steps that are chosen by an index of (sample, step, sphere)."""
        after = (where[0], np.asarray(where[1]) + 1, *where[2:])
        p, v, a = self.positions[where], self.velocities[where], self.flights[where]
        q, w, b = self.positions[after], self.velocities[after], self.flights[after]
        h, blow = self.dt, self.blows[where]
        zero, smooth = np.zeros(p.shape), np.stack(self._smooth(where), axis=-2)
        if not self.exact:
            return Pieces(np.stack([smooth, smooth], axis=-3), np.full(p.shape[:-1], h))
        before = np.stack([p, v, 0.5 * a, zero], axis=-2)
        then = np.stack([q - w * h + 0.5 * b * h**2, w - b * h, 0.5 * b, zero], axis=-2)
        split, gap = np.zeros(p.shape[:-1]), before - then
        for _ in range(3):  # nearest to each other: Gauss-Newton steps of |gap|^2
            closing = slope(gap, split)
            size = np.maximum((closing**2).sum(axis=-1), 1e-300)
            split = np.clip(split - (value(gap, split) * closing).sum(axis=-1) / size, 0.0, h)
        struck = (blow != 0.0).any(axis=-1)
        two = np.stack([before, then], axis=-3)
        one = np.stack([smooth, smooth], axis=-3)
        return Pieces(
            np.where(struck[..., None, None, None], two, one), np.where(struck, split, h)
        )


def value(coefficients: Array, t: Array) -> Array:
    """Value of polynomials, shape (..., 4, k), at a time [s], shape (...)."""
    t, c = np.asarray(t)[..., None], coefficients
    found: Array = c[..., 0, :] + t * (c[..., 1, :] + t * (c[..., 2, :] + t * c[..., 3, :]))
    return found


def slope(coefficients: Array, t: Array) -> Array:
    """Derivative of polynomials, as `value`."""
    t, c = np.asarray(t)[..., None], coefficients
    found: Array = c[..., 1, :] + t * (2 * c[..., 2, :] + 3 * t * c[..., 3, :])
    return found
