# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""State of one ball at the last of some frames, through the contacts in between."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .ball_contact import FREE
from .ball_fit import fit_start
from .ball_model import BallModel, surface_under
from .ball_path import path
from .path_slopes import path_and_slopes
from .start_prior import StartPrior
from ..scenes.state import Array

# parts of a start that are fitted: p, v, w
ALL, WITHOUT_SPIN = np.ones(9), np.repeat([1.0, 1.0, 0.0], 3)
# how well a start is known beforehand: position [m] and velocity [m/s]; on a surface, off it
_LOOSE, _HELD = np.array([1e3] * 3 + [1e2] * 3), 1e-4
# time [s] and least number of the frames of the first guess, and least number of a window
_FIRST, _FEW, FEWEST = 0.06, 6, 4
# parts of the window that are tried, until one is met to this loss per coordinate: what the laws
# do not know, as a net or a racket, may be in it; and a loss at which another guess is made
_PARTS, _MET, _DOUBTED = (1.0, 0.6, 0.35, 0.15), 4.0, 1.5
_STEPS, _GROWTH, _GATE = 8, 2.0, 6.0
MOST_CONTACTS = 32


@dataclass(frozen=True)
class BallEstimate:
    """State of a ball at the last frame.

    Args:
        state: Position, velocity, angular velocity, shape (9,).
        covariance: Shape (9, 9).
        on: Surface that the ball is on, or FREE.
        loss: Huber's loss per coordinate; about 1 where the laws and the noise hold.
        begin: Time of the first frame that was used [s].
        contacts: Number of impacts in the window.
    """

    state: Array
    covariance: Array
    on: int
    loss: float
    begin: float
    contacts: int


def first_frames(times: Array) -> int:
    """Number of frames of a first guess."""
    return min(max(_FEW, int((times - times[0] <= _FIRST).sum())), len(times))


def first_guess(
    model: BallModel, times: Array, positions: Array, on: int, frames: int | None = None
) -> Array:
    """Position and velocity at the first frame, from a line under gravity, shape (6,)."""
    n = first_frames(times) if frames is None else min(frames, len(times))
    t = times[:n] - times[0]
    pull = model.gravity if on == FREE else np.zeros(3)
    line = np.stack([np.ones_like(t), t], axis=1)
    heights = positions[:n] - 0.5 * t[:, None] ** 2 * pull
    guess = np.linalg.lstsq(line, heights, rcond=None)[0].ravel()
    if on != FREE:
        normal = model.planes[on, 9:12]
        guess[:3] -= (normal @ (guess[:3] - model.planes[on, :3]) - model.radius) * normal
        guess[3:] -= normal @ guess[3:] * normal
    return guess


def prior_of_start(
    model: BallModel, guess: Array, on: int, spin: tuple[Array, Array] | None
) -> tuple[Array, Array]:
    """Mean and inverse covariance of a start, shapes (9,) and (9, 9).

    Args:
        model: Laws of the ball.
        guess: First guess of position and velocity, shape (6,).
        on: Surface that it is on, or FREE.
        spin: Mean and covariance of the spin; None: the ball does not spin, or rolls.
    """
    mean, precision = np.zeros(9), np.diag(np.concatenate([_LOOSE**-2, np.ones(3)]))
    if spin is not None:
        mean[6:] = spin[0]
        precision[6:, 6:] = np.linalg.inv(spin[1])
    if on != FREE:
        normal = model.planes[on, 9:12]
        mean[:3] = normal * (normal @ guess[:3])
        held = np.outer(normal, normal) / _HELD**2
        precision[:3, :3] += held
        precision[3:6, 3:6] += held
    return mean, precision


def estimate_ball(
    model: BallModel, noise: Array, prior: StartPrior | None, times: Array, positions: Array
) -> BallEstimate:
    """Estimate the state at the last frame.

    Args:
        model: Laws of the ball.
        noise: s, q, kappa of `model_error`.
        prior: Of the spin; None: the ball does not spin in the air, and rolls on a surface.
        times: Rising times of the frames in which it was seen [s], shape (m,), `FEWEST` or more.
        positions: Centres [m], shape (m, 3).
    """
    times, positions = np.ascontiguousarray(times), np.ascontiguousarray(positions)
    best, quality = None, np.inf
    for part in _PARTS:
        inside = times >= times[-1] - part * (times[-1] - times[0]) - 1e-9
        if best is not None and inside.sum() < _FEW:
            break
        one = _estimate(model, noise, prior, times[inside], positions[inside])
        if (
            best is None
            and one[1] > _DOUBTED
            and _begins_near(model, times[inside], positions[inside])
        ):
            # an impact may be in the frames of the first guess
            other = _estimate(model, noise, prior, times[inside], positions[inside], FEWEST)
            one = other if other[1] < one[1] else one
        # half as good at most, since fewer frames are met more easily
        if best is None or one[1] < 0.5 * quality:
            best, quality = one
        if quality < _MET:
            break
    assert best is not None
    return best


def _begins_near(model: BallModel, times: Array, positions: Array) -> bool:
    """Whether the ball comes within a radius of a surface in the first frames."""
    places = positions[: first_frames(times) + FEWEST]
    return any(
        float(((places - plane[:3]) @ plane[9:12]).min()) < 2.0 * model.radius
        for plane in model.planes
    )


def _estimate(
    model: BallModel,
    noise: Array,
    prior: StartPrior | None,
    times: Array,
    positions: Array,
    frames: int | None = None,
) -> tuple[BallEstimate, float]:
    """Estimate from all frames of a window, and its loss with that of dropped frames.

    `frames` is the number of those of the first guess; None: as many as show a velocity.
    """
    on = surface_under(model, times, positions, float(noise[0]))
    first = first_frames(times) if frames is None else frames
    guess = first_guess(model, times, positions, on, first)
    spin = None if prior is None else prior.at(guess[:3], guess[3:])
    mean, precision = prior_of_start(model, guess, on, spin)
    start = np.concatenate([guess, mean[6:]])
    weights = np.ones(len(times))
    information, end, covariance = np.zeros((9, 9)), np.zeros(9), np.zeros((9, 9))
    loss, contacts, on_end = fit_start(
        start,
        mean,
        precision,
        WITHOUT_SPIN if prior is None else ALL,
        times[0],
        times,
        positions,
        model.ball,
        model.planes,
        model.laws,
        on,
        noise,
        first,
        _GROWTH,
        _STEPS,
        _GATE,
        weights,
        information,
        end,
        covariance,
        np.zeros((MOST_CONTACTS, 3)),
    )
    if on_end != FREE:  # the drift beside the path is no motion off the surface
        normal = model.planes[on_end, 9:12]
        end[3:6] -= normal @ end[3:6] * normal
    estimate = BallEstimate(end, covariance, on_end, loss, float(times[0]), contacts)
    return estimate, loss + 4.0 * float((weights == 0.0).mean())


@dataclass(frozen=True)
class BallForecast:
    """Path of a ball after an estimate.

    Args:
        states: Position, velocity, angular velocity, shape (k, 9).
        covariances: Of the states, by that of the estimate, shape (k, 9, 9).
        impacts: Time, surface and approach speed of each impact, shape (impacts, 3).
    """

    states: Array
    covariances: Array
    impacts: Array


def forecast_ball(
    model: BallModel, estimate: BallEstimate, begin: float, stamps: Array
) -> BallForecast:
    """Forecast from an estimate at a time to rising stamps [s], shape (k,)."""
    count = len(stamps)
    states, slopes = np.zeros((count, 9)), np.zeros((count, 9, 9))
    impacts = np.zeros((MOST_CONTACTS, 3))
    start, change = estimate.state.copy(), np.eye(9)
    if estimate.on != FREE:  # the path takes what comes to the spin of rolling
        normal = model.planes[estimate.on, 9:12]
        start[6:] -= np.cross(normal, start[3:6]) / model.radius
        change[6:, 3:6] = -_crossing(normal) / model.radius
    found, _ = path_and_slopes(
        start,
        ALL,
        begin,
        np.ascontiguousarray(stamps),
        model.ball,
        model.planes,
        model.laws,
        estimate.on,
        states,
        slopes,
        impacts,
    )
    covariance = change @ estimate.covariance @ change.T
    spread = slopes @ covariance @ slopes.transpose(0, 2, 1)
    return BallForecast(states, spread, impacts[: min(found, MOST_CONTACTS)])


def sampled_covariances(
    model: BallModel, estimate: BallEstimate, begin: float, stamps: Array, samples: int, seed: int
) -> Array:
    """Covariances of the positions at stamps by paths from drawn states [m^2], shape (k, 3, 3).

    Where some paths meet a surface and others do not, slopes do not show how far they part.
    """
    values, axes = np.linalg.eigh(estimate.covariance)
    root = axes * np.sqrt(np.maximum(values, 0.0))
    drawn = estimate.state + np.random.default_rng(seed).normal(size=(samples, 9)) @ root.T
    if estimate.on != FREE:
        normal = model.planes[estimate.on, 9:12]
        drawn[:, 6:] -= np.cross(normal, drawn[:, 3:6]) / model.radius
    stamps = np.ascontiguousarray(stamps)
    places = np.empty((samples, len(stamps), 3))
    states, impacts = np.zeros((len(stamps), 9)), np.zeros((MOST_CONTACTS, 3))
    laws = (model.ball, model.planes, model.laws)
    for one, start in zip(places, drawn, strict=True):
        path(start, begin, stamps, *laws, estimate.on, states, impacts)
        one[:] = states[:, :3]
    apart = places - places.mean(axis=0)
    spread: Array = np.einsum('ska,skb->kab', apart, apart) / (samples - 1)
    return spread


def _crossing(vector: Array) -> Array:
    """Matrix of the product of a vector and another."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
