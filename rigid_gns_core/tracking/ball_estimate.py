# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""State of one ball at the last of some frames, through the contacts in between."""

from __future__ import annotations

from dataclasses import dataclass
import math

import numpy as np

from .ball_contact import FREE
from .ball_model import BallModel
from .ball_path import path, start_of
from .ball_window import estimate_window, MOST_CONTACTS
from .jit import plain
from .pair_blow import Crossed
from .path_slopes import path_and_slopes
from .start_guess import ALL, first_frames, guess_start, prior_of_guess
from .start_prior import StartPrior
from ..scenes.state import Array


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


def first_guess(
    model: BallModel, times: Array, positions: Array, on: int, frames: int | None = None
) -> Array:
    """Position and velocity at the first frame, from a line under gravity, shape (6,)."""
    times, guess = plain(times), np.zeros(6)
    n = first_frames(times) if frames is None else frames
    guess_start(model.ball, model.planes, times, plain(positions), on, n, guess)
    return guess


def prior_of_start(
    model: BallModel, guess: Array, on: int, spin: tuple[Array, Array] | None
) -> tuple[Array, Array]:
    """Mean and inverse covariance of a start, shapes (9,) and (9, 9).

    Args:
        model: Laws of the ball.
        guess: Position and velocity, shape (6,).
        on: Surface that the ball is on, or FREE.
        spin: Mean and covariance of the spin; None: the ball does not spin, or rolls.
    """
    mean, precision = np.zeros(9), np.zeros((9, 9))
    given = (np.zeros(3), np.eye(3)) if spin is None else (plain(spin[0]), plain(spin[1]))
    prior_of_guess(model.planes, guess, on, spin is not None, *given, mean, precision)
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
    times, positions = plain(times), plain(positions)
    state, covariance = np.zeros(9), np.zeros((9, 9))
    windows = StartPrior.of_any_spin(model.radius).windows if prior is None else prior.windows
    on, loss, begin, contacts = estimate_window(
        model.ball,
        model.planes,
        model.laws,
        plain(noise),
        windows,
        prior is not None,
        np.zeros(4),
        Crossed(math.inf, np.zeros(9), np.zeros((9, 9))),
        times,
        positions,
        state,
        covariance,
    )
    return BallEstimate(state, covariance, on, loss, float(times[begin]), contacts)


@dataclass(frozen=True)
class BallForecast:
    """Path of a ball after an estimate.

    Args:
        states: Position, velocity, angular velocity, shape (k, 9).
        covariances: Of the states, by that of the estimate, shape (k, 9, 9).
        slopes: Of the states over that of the estimate, shape (k, 9, 9).
        impacts: Time, surface and approach speed of each impact, shape (impacts, 3).
    """

    states: Array
    covariances: Array
    slopes: Array
    impacts: Array


def forecast_ball(
    model: BallModel, estimate: BallEstimate, begin: float, stamps: Array
) -> BallForecast:
    """Forecast from an estimate at a time to rising stamps [s], shape (k,)."""
    count = len(stamps)
    states, slopes = np.zeros((count, 9)), np.zeros((count, 9, 9))
    impacts = np.zeros((MOST_CONTACTS, 3))
    start, change = np.zeros(9), np.zeros((9, 9))
    start_of(plain(estimate.state), model.planes, estimate.on, model.radius, start, change)
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
    slopes = slopes @ change
    spread = slopes @ estimate.covariance @ slopes.transpose(0, 2, 1)
    return BallForecast(states, spread, slopes, impacts[: min(found, MOST_CONTACTS)])


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
        normal, moving = model.planes[estimate.on, 9:12], model.belt(estimate.on)
        drawn[:, 6:] -= np.cross(normal, drawn[:, 3:6] - moving) / model.radius
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
