# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forecasts from an estimated state at given times after it, which are not steps of the model."""

from __future__ import annotations

from dataclasses import dataclass
import warnings

import numpy as np

from .horizon import steps_of
from ..rollout.simulator import Simulator
from ..scenes.scene import Scene
from ..scenes.state import Array, State, Trajectory
from ..tracking.state_estimate import StateEstimate

# a velocity that changes more in a step than gravity [of it] and air [part of the speed] can
_FALL, _DRAG = 1.5, 0.1


@dataclass(frozen=True)
class LeadForecast:
    """Centres forecast for some times after a start.

    Args:
        positions: Centres by the estimated state [m], shape (k, n, 3), NaN after a divergence.
        covariance: Of these by samples of the state [m^2], shape (k, n, 3, 3); None: of no sample.
    """

    positions: Array
    covariance: Array | None


def forecast_at(
    simulator: Simulator,
    scene: Scene,
    estimate: StateEstimate,
    lead_times: Array,
    *,
    samples: int = 32,
    seed: int = 0,
) -> LeadForecast:
    """Forecast from an estimate.

    Args:
        simulator: Model.
        scene: Surfaces, spheres and gravity.
        estimate: State and its covariance; a sphere whose covariance is not finite is not varied.
        lead_times: Times after the state [s], rising, shape (k,).
        samples: Number of states drawn for the covariance; 0: none.
        seed: Seed of the draws.
    """
    steps = steps_of(float(lead_times[-1]), simulator.native_dt(scene))
    starts = [estimate.state, *_drawn(estimate, samples, seed)]
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # of a divergence, which is NaN here
        runs = simulator.rollout_batch(scene, starts, steps, workers=1)
    exact = simulator.velocities == 'given'
    gravity = np.asarray(scene.gravity)
    found = np.stack([positions_at(run, lead_times, gravity, exact=exact) for run in runs])
    if not samples:
        return LeadForecast(found[0], None)
    apart = found[1:] - found[1:].mean(axis=0)
    spread = np.einsum('skni,sknj->knij', apart, apart) / max(samples - 1, 1)
    unknown = ~np.isfinite(estimate.covariance).all(axis=(1, 2))
    spread[:, unknown] = np.nan
    if scene.tracker is not None:  # what the laws leave open on the way
        drift = scene.tracker.forecast_drift * np.asarray(lead_times) ** 3 / 3.0
        kicks = scene.tracker.forecast_impact**2 * kicks_at(runs[0], lead_times, gravity)
        spread += (drift[:, None] + kicks)[..., None, None] * np.eye(3)
    return LeadForecast(found[0], spread)


def positions_at(run: Trajectory, times: Array, gravity: Array, *, exact: bool) -> Array:
    """Centres of a rollout at times between its steps [m], shape (k, n, 3).

    Between two steps a cubic goes through both positions and velocities, exact for a parabola.
    Where the velocity changes more than gravity and air can change it there is a contact: the
    motion before it is continued, then the motion after it, from where they come nearest to each
    other.

    Args:
        run: Rollout.
        times: Times since its start [s], up to its last step, shape (k,).
        gravity: Acceleration of free flight [m/s^2], shape (3,).
        exact: Whether velocities are those of the instant; if not, positions are interpolated
            linearly.
    """
    dt = run.dt
    step = np.clip(np.floor(times / dt + 1e-9).astype(int), 0, max(run.steps - 1, 0))
    t = (times - step * dt)[:, None, None]
    s = t / dt
    p, q = run.positions[step], run.positions[step + 1]
    if not exact:
        linear: Array = (1 - s) * p + s * q
        return linear
    v, w = run.velocities[step], run.velocities[step + 1]
    cubic = (
        (1 + 2 * s) * (1 - s) ** 2 * p
        + s * (1 - s) ** 2 * dt * v
        + s**2 * (3 - 2 * s) * q
        + s**2 * (s - 1) * dt * w
    )
    # p + v t + g t^2/2 and q - w (dt - t) + g (dt - t)^2/2 differ by gap + closing t
    gap, closing = p - q + w * dt - 0.5 * gravity * dt**2, v - w + gravity * dt
    size = np.maximum((closing**2).sum(axis=-1, keepdims=True), 1e-300)
    met = np.clip(-(gap * closing).sum(axis=-1, keepdims=True) / size, 0.0, dt)
    before = p + v * t + 0.5 * gravity * t**2
    after = q - w * (dt - t) + 0.5 * gravity * (dt - t) ** 2
    speeds = np.maximum(*(np.linalg.norm(one, axis=-1, keepdims=True) for one in (v, w)))
    bound = _FALL * np.linalg.norm(gravity) * dt + _DRAG * speeds
    struck = np.linalg.norm(w - v, axis=-1, keepdims=True) > bound
    places: Array = np.where(struck, np.where(t <= met, before, after), cubic)
    return places


def kicks_at(run: Trajectory, times: Array, gravity: Array) -> Array:
    """Sum over impacts of (approach speed times time since)^2 [m^2], shape (k, n)."""
    before = run.velocities[:-1]
    changes = run.velocities[1:] - before - gravity * run.dt
    sizes = np.linalg.norm(changes, axis=-1)
    speeds = np.linalg.norm(run.velocities, axis=-1)
    bound = _FALL * np.linalg.norm(gravity) * run.dt
    struck = sizes > bound + _DRAG * np.maximum(speeds[:-1], speeds[1:])
    along = -(before * changes).sum(axis=-1) / np.maximum(sizes, 1e-300)
    approach = np.where(struck, np.maximum(along, 0.0), 0.0)
    middles = (np.arange(len(before)) + 0.5) * run.dt
    since = np.maximum(times[:, None] - middles, 0.0)
    return np.asarray(since**2 @ approach**2)


def _drawn(estimate: StateEstimate, samples: int, seed: int) -> list[State]:
    """States drawn from a normal distribution."""
    state, count = estimate.state, len(estimate.state)
    known = np.asarray(np.isfinite(estimate.covariance).all(axis=(1, 2)))
    covariance = np.where(known[:, None, None], estimate.covariance, 0.0)
    values, axes = np.linalg.eigh(covariance)
    root = axes * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    normal = np.random.default_rng(seed).normal(size=(samples, count, 9))
    moved = np.einsum('nij,snj->sni', root, normal)
    return [
        State(
            positions=state.positions + one[:, :3],
            quaternions=state.quaternions,
            velocities=state.velocities + one[:, 3:6],
            angular_velocities=state.angular_velocities + one[:, 6:],
        )
        for one in moved
    ]
