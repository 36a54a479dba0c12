# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forecasts from an estimated state, with samples of what is not known of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from .crossing import Crossing, first_passages
from .model_error import drawn_motion, spread_at
from .paths import Paths
from .touches import Touches, touches_of
from ..errors import shown, UserError
from ..scenes.plane import Plane
from ..scenes.regions import NORMAL
from ..scenes.scene import Scene
from ..scenes.state import Array, State
from ..scenes.values import checked_floats, checked_number


class Estimate(Protocol):
    """A state and its covariance, as `tracking.estimate_state` gives them.

    covariance: of position [m], velocity [m/s] and angular velocity [rad/s] of each sphere, shape
    (n, 9, 9); a sphere whose covariance is not finite is not varied.
    """

    @property
    def state(self) -> State: ...  # noqa: D102
    @property
    def covariance(self) -> Array: ...  # noqa: D102


@dataclass(frozen=True)
class Future:
    """One branch of the future of a sphere: samples that touch the same things in one order.

    Args:
        probability: Share of all samples.
        touched: What they touch within the horizon: 'surface 0', 'edge of surface 0', 'sphere'.
        positions: Mean centres at the lead times [m], shape (k, 3).
        covariance: Of these [m^2], shape (k, 3, 3).
    """

    probability: float
    touched: tuple[str, ...]
    positions: Array
    covariance: Array


@dataclass(frozen=True)
class Forecast:
    """Motion of n spheres at k times after a start; `Simulator.forecast` makes it.

    Args:
        scene: Surfaces and spheres.
        lead_times: Times after the start [s], shape (k,).
        positions: Centres by the rollout of the estimated state itself [m], shape (k, n, 3); NaN
            after a divergence.
        velocities: Likewise [m/s].
        covariance: Of the positions [m^2], shape (k, n, 3, 3): of the samples, and of what the
            laws leave open, where the scene has a tracker. 0 where a state was given, NaN where
            the estimate has no finite one.
        samples: Centres by drawn states [m], shape (samples, k, n, 3).
        paths: Of the samples, between the steps too.
    """

    scene: Scene
    lead_times: Array
    positions: Array
    velocities: Array
    covariance: Array
    samples: Array
    paths: Paths

    def region(self, probability: float) -> Array:
        """Size of the region about each position that holds what happens with a probability.

        Args:
            probability: Between 0 and 1.

        Returns:
            r [deviations] at the lead times, shape (k,): the region is off^T C^-1 off <= r^2 with
            C of `covariance`. It is as learned from left-out tracks where the scene has a tracker
            that knows it, or else that of a normal distribution.

        Raises:
            UserError: The probability is out of range.
        """
        probability = checked_number('probability', probability, -np.inf)
        if not 0.0 < probability < 1.0:
            raise UserError(f'probability is {probability}, expected more than 0 and less than 1')
        tracker = self.scene.tracker
        regions = NORMAL if tracker is None else tracker.regions or NORMAL
        return regions.radii(probability, self.lead_times)

    @cached_property
    def touches(self) -> tuple[list[Touches], ...]:
        """What each sphere touches, and when [s], in each of its samples."""
        count = self.positions.shape[1]
        return tuple(touches_of(self.paths, self.scene, sphere) for sphere in range(count))

    def crossing(self, plane: Plane) -> Crossing:
        """First crossing of a plane by each sphere's centre, up to the last lead time.

        Args:
            plane: With or without ends; crossed in either direction, beyond its ends never.
        """
        if not isinstance(plane, Plane):
            raise UserError(f'plane is {shown(plane)}, expected Plane(...)')
        if plane.changes_place:
            raise UserError(
                f'the plane to cross moves, by {plane.velocity} m/s and {plane.angular_velocity} '
                'rad/s; give one that stays'
            )
        horizon, count = float(self.lead_times[-1]), self.positions.shape[1]
        passages = [first_passages(self.paths, k, plane, horizon) for k in range(count)]
        known = np.asarray(np.isfinite(self.covariance).all(axis=(0, 2, 3)))
        return Crossing.of(passages, self.touches, known)

    def splits(self, sphere: int) -> bool:
        """Whether the future of a sphere has several branches."""
        return len(self._groups(sphere)) > 1

    def _groups(self, sphere: int) -> dict[tuple[str, ...], list[int]]:
        """Samples by what they touch, in its order."""
        groups: dict[tuple[str, ...], list[int]] = {}
        for sample, events in enumerate(self.touches[sphere]):
            names = tuple(name for time, name in events if time <= self.lead_times[-1])
            groups.setdefault(names, []).append(sample)
        return groups

    def branches(self, sphere: int) -> tuple[Future, ...]:
        """The branches of the future of a sphere, the most likely first."""
        total = len(self.paths.positions)
        found = []
        for names, chosen in self._groups(sphere).items():
            own = self.samples[:total][chosen][:, :, sphere]
            mean = own.mean(axis=0)
            found.append(Future(len(chosen) / total, names, mean, spread_of(own)))
        return tuple(sorted(found, key=lambda branch: -branch.probability))


def spread_of(samples: Array) -> Array:
    """Covariance of samples (s, ..., 3), shape (..., 3, 3)."""
    # imported late: what only loads a model needs no compiler
    from ..kernels.samples import find_covariances

    found = np.empty((*samples.shape[1:], 3))
    rows = np.require(samples, np.float64, ['C', 'W']).reshape(len(samples), -1, 3)
    find_covariances(rows, found.reshape(-1, 3, 3))
    return found


def checked_times(lead_times: ArrayLike) -> Array:
    """Lead times [s], shape (k,).

    Raises:
        UserError: There are none, or they are negative, not finite or do not rise.
    """
    times = checked_floats('lead_times', lead_times)
    if times.ndim != 1 or not len(times) or not np.isfinite(times).all() or times[0] < 0:
        raise UserError(
            f'lead_times are {lead_times!r}, expected one or more times from 0 s on, as [0.2, 0.4]'
        )
    if not (np.diff(times) > 0).all():
        raise UserError('lead_times do not rise, expected increasing ones; sort them')
    return times


def drawn_starts(start: State | Estimate, samples: int, seed: int) -> State:
    """The estimated state, and states drawn from the normal distribution about it.

    Args:
        start: State alone, or with its covariance.
        samples: Number of draws; none are made of a state alone.
        seed: Of the draws.

    Returns:
        Fields of shape (1 + samples, n, k).

    Raises:
        UserError: The number of samples is 1 or negative, or the covariance has another shape.
    """
    if samples < 0 or samples == 1:
        raise UserError(f'samples is {samples}, expected 0, or 2 or more')
    if not hasattr(start, 'state') and not isinstance(start, State):
        raise UserError(
            f'estimate is {shown(start)}, expected what estimate_state returns, or State(...)'
        )
    if isinstance(start, State):
        return State.unchecked(*(values[None] for values in vars(start).values()))
    state, count = start.state, len(start.state)
    covariance = np.asarray(start.covariance, dtype=np.float64)
    if covariance.shape != (count, 9, 9):
        raise UserError(
            f'covariance of the estimate has shape {covariance.shape}, expected ({count}, 9, 9)'
        )
    if not samples:
        return State.unchecked(*(values[None] for values in vars(state).values()))
    known = np.asarray(np.isfinite(covariance).all(axis=(1, 2)))
    values, axes = np.linalg.eigh(np.where(known[:, None, None], covariance, 0.0))
    root = axes * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    normal = _draws(seed, samples, count)
    moved = np.concatenate([np.zeros((1, count, 9)), np.einsum('nij,snj->sni', root, normal)])
    return State.unchecked(
        state.positions + moved[..., :3],
        np.tile(state.quaternions, (samples + 1, 1, 1)),
        state.velocities + moved[..., 3:6],
        state.angular_velocities + moved[..., 6:],
    )


@lru_cache(maxsize=4)
def _draws(seed: int, samples: int, count: int) -> Array:
    """Standard normal numbers, shape (samples, count, 9), the same for forecasts in a row."""
    found = np.random.default_rng(seed).normal(size=(samples, count, 9))
    found.flags.writeable = False
    return found


def forecast_of(
    scene: Scene, start: State | Estimate, paths: Paths, times: Array, samples: int, seed: int
) -> Forecast:
    """Forecast from rollouts of `drawn_starts`; arguments as of `Simulator.forecast`."""
    positions, velocities = paths.at(times)
    if isinstance(start, State):
        shape = (*positions[0].shape, 3)
        drawn = np.broadcast_to(positions, (max(samples, 1), *positions.shape[1:]))
        return Forecast(scene, times, positions[0], velocities[0], np.zeros(shape), drawn, paths)
    nominal, drawn = paths.part(slice(0, 1)), paths.part(slice(1, None))
    if not samples:
        nothing = np.full((*positions[0].shape, 3), np.nan)
        found = positions[1:]
        return Forecast(scene, times, positions[0], velocities[0], nothing, found, nominal)
    found, spread = positions[1:], spread_of(positions[1:])
    if scene.tracker is not None:
        open_ = spread_at(nominal, times, scene.tracker)[0]
        spread = spread + open_[..., None, None] * np.eye(3)
        # of another stream than the starts
        generator = np.random.default_rng([seed, 1])
        drawn = drawn.moved(*drawn_motion(drawn, scene.tracker, generator))
        found, _ = drawn.at(times)
    unknown = np.asarray(~np.isfinite(np.asarray(start.covariance)).all(axis=(1, 2)))
    spread = np.where(unknown[:, None, None], np.nan, spread)
    return Forecast(scene, times, positions[0], velocities[0], spread, found, drawn)
