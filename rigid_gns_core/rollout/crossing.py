# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where and when spheres first cross a plane, over the samples of a forecast."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .paths import Paths, slope, value
from ..scenes.plane import Plane
from ..scenes.state import Array

# steps of Newton's method, each held within its bracket
_STEPS = 12


@dataclass(frozen=True)
class Branch:
    """Samples that touched the same things, in the same order, before they crossed.

    Args:
        probability: Share of all samples.
        touched: What they touched: 'surface 0', 'edge of surface 0', 'sphere', ...
        time: Mean time of crossing since the start [s].
        position: Mean of the centre then [m], shape (3,).
        velocity: Mean of the velocity then [m/s], shape (3,).
        covariance: Of time, position and velocity, shape (7, 7).
    """

    probability: float
    touched: tuple[str, ...]
    time: float
    position: Array
    velocity: Array
    covariance: Array


@dataclass(frozen=True)
class Crossing:
    """First crossings of a plane by the centres of spheres, in either direction.

    Means and covariances are of the samples that cross; NaN of a sphere of which none does, and
    covariances where the estimate has none. Those of positions are singular along the normal.
    Where a contact splits the future, `branches` holds each part, the most likely first.

    Args:
        probability: Share of the samples that cross within the horizon, shape (n,).
        time: Since the start [s], shape (n,).
        position: Centre [m], shape (n, 3).
        velocity: [m/s], shape (n, 3).
        covariance: Of time, position and velocity, shape (n, 7, 7).
        branches: Of each sphere.
    """

    probability: Array
    time: Array
    position: Array
    velocity: Array
    covariance: Array
    branches: tuple[tuple[Branch, ...], ...]

    def __len__(self) -> int:
        return len(self.branches)

    def __getitem__(self, sphere: int) -> Crossing:
        """That of one sphere: fields without the axis of spheres, and its own branches alone."""
        return Crossing(
            self.probability[sphere],
            self.time[sphere],
            self.position[sphere],
            self.velocity[sphere],
            self.covariance[sphere],
            (self.branches[sphere],),
        )

    @property
    def time_variance(self) -> Array:
        """Variance of the time [s^2], shape (n,)."""
        return self.covariance[..., 0, 0]

    @property
    def position_covariance(self) -> Array:
        """Covariance of the position [m^2], shape (n, 3, 3)."""
        return self.covariance[..., 1:4, 1:4]

    @property
    def velocity_covariance(self) -> Array:
        """Covariance of the velocity [m^2/s^2], shape (n, 3, 3)."""
        return self.covariance[..., 4:, 4:]

    @classmethod
    def of(
        cls,
        passages: Sequence[Passages],
        touched: Sequence[Sequence[Sequence[tuple[float, str]]]],
        known: NDArray[np.bool_],
    ) -> Crossing:
        """Crossing by the passages of each sphere.

        Args:
            passages: Of each sphere.
            touched: When each sample of each touched what.
            known: Whether the spread of a sphere is known; if not, its covariance is NaN.
        """
        parts = [_moments(one.values) for one in passages]
        branches = tuple(
            _branches(one, events) for one, events in zip(passages, touched, strict=True)
        )
        means = np.array([mean for mean, _ in parts]).reshape(-1, 7)
        covariances = np.array([covariance for _, covariance in parts]).reshape(-1, 7, 7)
        return cls(
            probability=np.array([one.crossed.mean() for one in passages]),
            time=means[:, 0],
            position=means[:, 1:4],
            velocity=means[:, 4:],
            covariance=np.where(known[:, None, None], covariances, np.nan),
            branches=branches,
        )


@dataclass(frozen=True)
class Passages:
    """First crossings of one sphere: of each sample whether, and time, position and velocity.

    Args:
        crossed: Shape (s,).
        values: Time [s], position [m], velocity [m/s], shape (s, 7), NaN where not crossed.
    """

    crossed: NDArray[np.bool_]
    values: Array


def first_passages(paths: Paths, sphere: int, plane: Plane, horizon: float) -> Passages:
    """First crossing of a plane by a sphere's centre in each rollout, until `horizon` [s]."""
    normal, point = np.asarray(plane.normal), np.asarray(plane.point)
    heights = (paths.positions[:, :, sphere] - point) @ normal
    rates = paths.velocities[:, :, sphere] @ normal
    # between steps of one sign it may turn back behind the plane, or be struck there
    may = heights[:, :-1] * heights[:, 1:] <= 0.0
    may |= rates[:, :-1] * rates[:, 1:] <= 0.0
    may |= paths.struck[:, :, sphere]
    sample, step = np.nonzero(may)
    found = paths.pieces((sample, step, np.full(len(sample), sphere)))
    lines = found.coefficients @ normal
    lines[..., 0] -= point @ normal
    who, times, late = _roots(lines, found.split, paths.dt)
    chosen = found.coefficients[who, late]
    places, speeds = value(chosen, times), slope(chosen, times)
    times = times + step[who] * paths.dt
    along = (places - point) @ plane.axes[:2].T
    good = (np.abs(along) <= plane.half_lengths).all(axis=1)
    good &= (times > 0.0) & (times <= horizon * (1.0 + 1e-12))
    numbers, first = np.unique(sample[who][good], return_index=True)
    values = np.full((len(heights), 7), np.nan)
    rows = np.column_stack([times, places, speeds])[good]
    values[numbers] = rows[first]
    return Passages(np.isin(np.arange(len(values)), numbers), values)


def _roots(
    lines: Array, split: Array, dt: float
) -> tuple[NDArray[np.int64], Array, NDArray[np.int64]]:
    """Roots of polynomials in [0, split] and [split, dt], in the order of time.

    Args:
        lines: Coefficients, shape (m, 2, 4).
        split: Shape (m,).
        dt: End [s].

    Returns:
        Row of each root, its time, and which of the two polynomials it is of.
    """
    rows = len(lines)
    zero = np.zeros(rows)
    ends = np.stack([np.stack([zero, split], axis=1), np.stack([split, zero + dt], axis=1)], 1)
    turns = np.clip(_turns(lines), ends[..., :1], ends[..., 1:])
    knots = np.concatenate([ends[..., :1], np.sort(turns, axis=-1), ends[..., 1:]], axis=-1)
    four = lines[..., None, :]  # at the knots, shape (m, 2, 4)
    values = _at(four, knots)
    low, high = values[..., :-1], values[..., 1:]
    begin, end = knots[..., :-1], knots[..., 1:]
    crossing = (low * high < 0.0) | ((high == 0.0) & (low != 0.0))
    # the two do not meet exactly: a crossing may be between them
    between = values[:, 0, -1] * values[:, 1, 0] < 0.0
    row, piece, part = np.nonzero(crossing)
    times = _root(lines[row, piece], begin[row, piece, part], end[row, piece, part])
    extra = np.flatnonzero(between)
    row, times = np.concatenate([row, extra]), np.concatenate([times, split[extra]])
    piece = np.concatenate([piece, np.ones(len(extra), piece.dtype)])
    order = np.lexsort((times, row))
    return row[order].astype(np.int64), times[order], piece[order].astype(np.int64)


def _turns(lines: Array) -> Array:
    """Times at which the derivative is 0, 0 where there is none, shape (..., 2)."""
    a, b, c = 3.0 * lines[..., 3], 2.0 * lines[..., 2], lines[..., 1]
    root = np.sqrt(np.maximum(b * b - 4.0 * a * c, 0.0))
    # without cancellation: q / a and c / q
    q = -0.5 * (b + np.where(b < 0.0, -root, root))
    one = np.where(a != 0.0, q / np.where(a == 0.0, 1.0, a), 0.0)
    two = np.where(q != 0.0, c / np.where(q == 0.0, 1.0, q), 0.0)
    return np.stack([one, two], axis=-1)


def _at(lines: Array, t: Array) -> Array:
    found: Array = lines[..., 0] + t * (lines[..., 1] + t * (lines[..., 2] + t * lines[..., 3]))
    return found


def _root(lines: Array, low: Array, high: Array) -> Array:
    """Root between two times with values of unlike signs, shape (m,)."""
    begin = _at(lines, low)
    t = 0.5 * (low + high)
    for _ in range(_STEPS):
        there = _at(lines, t)
        left = there * begin > 0.0
        low, high = np.where(left, t, low), np.where(left, high, t)
        rate = lines[:, 1] + t * (2.0 * lines[:, 2] + 3.0 * t * lines[:, 3])
        step = t - there / np.where(rate == 0.0, np.inf, rate)
        t = np.where((step >= low) & (step <= high), step, 0.5 * (low + high))
    return t


def _moments(values: Array) -> tuple[Array, Array]:
    """Mean and covariance of the samples that are finite, shapes (7,) and (7, 7)."""
    known = values[np.isfinite(values[:, 0])]
    if not len(known):
        return np.full(7, np.nan), np.full((7, 7), np.nan)
    mean = known.mean(axis=0)
    apart = known - mean
    return mean, apart.T @ apart / max(len(known) - 1, 1)


def _branches(
    passages: Passages, touched: Sequence[Sequence[tuple[float, str]]]
) -> tuple[Branch, ...]:
    groups: dict[tuple[str, ...], list[int]] = {}
    for sample in np.flatnonzero(passages.crossed).tolist():
        until = passages.values[sample, 0]
        names = tuple(name for time, name in touched[sample] if time < until)
        groups.setdefault(names, []).append(sample)
    found = []
    for names, samples in groups.items():
        mean, covariance = _moments(passages.values[samples])
        found.append(
            Branch(
                probability=len(samples) / len(passages.crossed),
                touched=names,
                time=float(mean[0]),
                position=mean[1:4],
                velocity=mean[4:],
                covariance=covariance,
            )
        )
    return tuple(sorted(found, key=lambda branch: -branch.probability))
