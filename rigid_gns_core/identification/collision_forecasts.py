# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Restitution and friction of two balls, by forecasts through their collisions.

Parabolas on both sides of a collision (`collisions`) need frames that are dense beside the time in
which a struck ball stops sliding. Forecasts need only the laws: each starts from the frames before
a collision, and is compared with those after it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal

import numpy as np

from .collisions import meetings
from ..data.tracks import Track
from ..prediction.load import load_simulator
from ..rollout.simulator import Simulator
from ..scenes.contact_law import ContactLaw
from ..scenes.scene import Scene
from ..scenes.state import Array
from ..tracking.state_estimate import estimate_state, StateEstimate

# frames before a collision and after it that count [s], and their least numbers
_BEFORE, _AFTER, _FEWEST, _LATER = 0.4, 0.35, 4, 3
# balls that approach each other slower tell little [m/s]
_SLOW = 0.3
# collisions that tell a value, at most so many, and the values that are tried
_TELL, _MOST = 6, 100
_TRIED = {'restitution': np.linspace(0.0, 1.0, 21), 'friction': np.linspace(0.0, 0.6, 13)}
# draws of collisions for the standard error
_DRAWS = 200
# as of a term: the logarithm of the error is lower by this at least, and by more than its error
_WORTH = 0.003

Name = Literal['restitution', 'friction']


@dataclass(frozen=True)
class Ahead:
    """A collision that is ahead of an estimate of two balls.

    Args:
        estimate: Of both, at the last frame before it.
        leads: Times of the frames after it, from the estimate [s], shape (k,).
        places: Centres there, NaN where a ball is not seen [m], shape (k, 2, 3).
    """

    estimate: StateEstimate
    leads: Array
    places: Array


def told_by_forecasts(
    scene: Scene, tracks: Sequence[Track], noise: float, name: Name
) -> tuple[float, float] | None:
    """Value of a contact of two balls with which forecasts are best, and its standard error.

    None: too few collisions are seen, balls differ, or forecasts are no better with it than with
    that of the scene by more than an error bar.

    Args:
        scene: Scene with learned laws.
        tracks: Tracks of several balls.
        noise: Standard deviation of a coordinate [m].
        name: Of the value.
    """
    if scene.sphere_count is not None:
        return None
    found = _ahead(scene, tracks, noise)
    if len(found) < _TELL:
        return None
    simulator, tried = load_simulator(), _TRIED[name]
    costs = np.stack(
        [_costs(simulator, with_value(scene, name, e), found, noise) for e in tried.tolist()]
    )
    before = _costs(simulator, scene, found, noise)
    best = int(costs.mean(axis=1).argmin())
    changes = costs[best] - before
    error = float(changes.std(ddof=1)) / np.sqrt(len(changes))
    if changes.mean() + error > -_WORTH:
        return None
    rng, draws = np.random.default_rng(0), np.empty(_DRAWS)
    for k in range(_DRAWS):
        chosen = rng.integers(0, len(found), len(found))
        draws[k] = _lowest(tried, costs[:, chosen].mean(axis=1))
    step = float(tried[1] - tried[0])
    return _lowest(tried, costs.mean(axis=1)), max(float(draws.std()), 0.3 * step)


def with_value(scene: Scene, name: Name, value: float) -> Scene:
    """The scene with another restitution or friction of two balls."""
    law = scene.sphere_contact or ContactLaw(
        restitution=float(np.mean(scene.restitution)) ** 2,
        friction=float(np.mean(scene.friction)) ** 2,
    )
    return replace(scene, sphere_contact=replace(law, **{name: value}))


def _lowest(tried: Array, costs: Array) -> float:
    """Value of the lowest cost, by a parabola through it and its neighbours."""
    k = int(costs.argmin())
    value, step = float(tried[k]), float(tried[1] - tried[0])
    if 0 < k < len(costs) - 1:
        left, low, right = (float(one) for one in costs[k - 1 : k + 2])
        bend = left - 2.0 * low + right
        value += 0.5 * step * (left - right) / bend if bend > 0.0 else 0.0
    return float(f'{np.clip(value, 0.0, tried[-1]):.4g}')


def _ahead(scene: Scene, tracks: Sequence[Track], noise: float) -> list[Ahead]:
    radius = float(np.mean(scene.radius))
    found: list[Ahead] = []
    for track in tracks:
        for pair in combinations(range(len(track.spheres)), 2):
            for time in meetings(track, pair, radius):
                one = _before(scene, track, pair, time, noise)
                if one is not None:
                    found.append(one)
    if len(found) > _MOST:
        found = [found[k] for k in np.linspace(0, len(found) - 1, _MOST).astype(int)]
    return found


def _before(
    scene: Scene, track: Track, pair: tuple[int, int], time: float, noise: float
) -> Ahead | None:
    """Estimate of two balls that are about to meet; None: they are seen too seldom, or slow."""
    times, both = track.times, list(pair)
    before = np.flatnonzero((times < time - 1e-9) & (times >= time - _BEFORE))
    after = np.flatnonzero((times > time + 1e-9) & (times <= time + _AFTER))
    seen = track.seen[:, both]
    if (seen[before].sum(axis=0) < _FEWEST).any() or (seen[after].sum(axis=0) < _LATER).any():
        return None
    if not seen[before[-1]].all():
        return None
    estimate = estimate_state(
        scene, times[before], track.positions[before][:, both], None, noise=noise
    )
    gap = estimate.state.positions[1] - estimate.state.positions[0]
    closing = estimate.state.velocities[1] - estimate.state.velocities[0]
    if -float(closing @ gap) < _SLOW * float(np.linalg.norm(gap)):
        return None
    return Ahead(estimate, times[after] - times[before[-1]], track.positions[after][:, both])


def _costs(simulator: Simulator, scene: Scene, found: Sequence[Ahead], noise: float) -> Array:
    """Mean logarithm of the error after each collision, shape (collisions,)."""
    costs = np.empty(len(found))
    for k, one in enumerate(found):
        forecast = simulator.forecast(scene, one.estimate, one.leads, 0, 0)
        off = np.linalg.norm(forecast.positions - one.places, axis=-1)
        costs[k] = np.nanmean(np.log(np.hypot(np.where(np.isinf(off), 1e3, off), noise)))
    return costs
