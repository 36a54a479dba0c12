# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where and when spheres first cross a plane, over the samples of a forecast."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .paths import Paths
from ..scenes.plane import Plane
from ..scenes.state import Array


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
            _branches(one, events, part)
            for one, events, part in zip(passages, touched, parts, strict=True)
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
    from ..kernels.passages import find_passages

    values = np.empty((len(paths.positions), 7))
    point, half = np.array(plane.point, np.float64), np.array(plane.half_lengths, np.float64)
    find_passages(paths.compiled, sphere, point, np.array(plane.axes), half, horizon, values)
    return Passages(np.isfinite(values[:, 0]), values)


def _moments(values: Array) -> tuple[Array, Array]:
    """Mean and covariance of the samples that are finite, shapes (7,) and (7, 7)."""
    known = values[np.isfinite(values[:, 0])]
    if not len(known):
        return np.full(7, np.nan), np.full((7, 7), np.nan)
    mean = known.mean(axis=0)
    apart = known - mean
    return mean, apart.T @ apart / max(len(known) - 1, 1)


def _branches(
    passages: Passages,
    touched: Sequence[Sequence[tuple[float, str]]],
    moments: tuple[Array, Array],
) -> tuple[Branch, ...]:
    """Branches of one sphere; `moments` are those of all its samples."""
    groups: dict[tuple[str, ...], list[int]] = {}
    for sample in np.flatnonzero(passages.crossed).tolist():
        until = passages.values[sample, 0]
        names = tuple(name for time, name in touched[sample] if time < until)
        groups.setdefault(names, []).append(sample)
    found = []
    for names, samples in groups.items():
        mean, covariance = moments if len(groups) == 1 else _moments(passages.values[samples])
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
