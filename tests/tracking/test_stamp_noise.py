# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stamps that jitter: what a start loses by them is what jitter times speed explains."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
from rigid_gns_core import ContactLaw, Plane, Scene
from rigid_gns_core.messages.poses import PoseArrayFrame
from rigid_gns_core.tracking import estimate_state
from rigid_gns_core.tracking.ball_contact import FREE
from rigid_gns_core.tracking.ball_model import BallModel
from rigid_gns_core.tracking.ball_path import path
from rigid_gns_core.tracking.kinks import kinks
from rigid_gns_core.tracking.rejected_frame import RejectedFrame
from rigid_gns_core.tracking.stamp_noise import with_stamp_noise
from tracking_windows import tracking_window

RATE, NOISE, LEAD, TRIALS = 240.0, 1e-3, 0.1, 30
SCENE = Scene(
    surfaces=(Plane(contact=ContactLaw(restitution=0.8, friction=0.3)),), radius=0.02, mass=0.0027
)
# position and velocity of a ball that flies throughout, and of one that rolls
FLYING, ROLLING = [0.0, 0.0, 1.0, 3.0, 0.3, 2.0], [0.0, 0.0, 0.02, 1.5, 0.2, 0.0]


def path_of(start: list[float], times: np.ndarray) -> np.ndarray:
    """Centres [m], shape (m, 3)."""
    model, found = BallModel.of(SCENE), np.zeros((len(times), 9))
    on = 0 if start[5] == 0.0 else FREE
    laws = (model.ball, model.planes, model.laws)
    path(np.array([*start, 0.0, 0.0, 0.0]), 0.0, times, *laws, on, found, np.zeros((8, 3)))
    return found[:, :3]


def seen(start: list[float], jitter: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Stamps [s] and noisy centres [m] of half a second."""
    rng = np.random.default_rng(seed)
    times = np.arange(round(0.5 * RATE)) / RATE
    places = path_of(start, times) + rng.normal(0.0, NOISE, (len(times), 3))
    return times + rng.normal(0.0, jitter, len(times)) + 0.05, places


def by_node(stamps: np.ndarray, places: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Time, position and velocity of a start of the node, to which frames come in order."""
    target = tracking_window(scene=SCENE)
    for k, (stamp, place) in enumerate(zip(stamps, places, strict=True)):
        poses = np.array([[*place, 0.0, 0.0, 0.0, 1.0]])
        frame = PoseArrayFrame(10**12 + round(stamp * 1e9), 'world', poses)
        with contextlib.suppress(RejectedFrame):
            target.add(frame, 10**12 + round(k / RATE * 1e9))
    stamp_ns, state = target.start()
    return (stamp_ns - 10**12) * 1e-9, state.positions[0], state.velocities[0]


def offline(stamps: np.ndarray, places: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """The same by `estimate_state`."""
    order = np.argsort(stamps)
    state = estimate_state(SCENE, stamps[order], places[order, None]).state
    return float(stamps.max()), state.positions[0], state.velocities[0]


@pytest.mark.parametrize('estimate', [by_node, offline])
@pytest.mark.parametrize('start', [FLYING, ROLLING])
@pytest.mark.parametrize('jitter', [0.0, 1e-3, 3e-3])
def test_jitter_costs_what_its_way_explains(estimate, start: list[float], jitter: float) -> None:
    """Error after 0.1 s, against that of a line through the N = 96 frames of the memory.

    Its position is off by 2 s / sqrt(N), its velocity by sqrt(12 / N) s / T, with s^2 that of the
    noise and of jitter times speed; together, correlated as they are, by less than their sum.
    """
    speed = float(np.linalg.norm(start[3:]))
    count, memory = 96, 0.4
    sigma = np.hypot(NOISE, jitter * speed)
    bound = (2.0 + np.sqrt(12.0) * LEAD / memory) / np.sqrt(count) * sigma
    errors = []
    for seed in range(TRIALS):
        stamps, places = seen(start, jitter, seed)
        time, position, velocity = estimate(stamps, places)
        pull = np.array(SCENE.gravity if start is FLYING else (0.0, 0.0, 0.0))
        ahead = position + LEAD * velocity + 0.5 * LEAD**2 * pull
        true = path_of(start, np.array([time - 0.05 + LEAD]))[0]
        errors.append(float(np.linalg.norm(ahead - true)))
    # the distance of three axes: 1.5 deviations in the median, 4 once in a thousand
    assert np.median(errors) < 2.0 * bound
    assert max(errors) < 5.0 * bound


@pytest.mark.parametrize('jitter', [0.0, 1e-3, 3e-3])
def test_the_noise_along_the_motion_is_told(jitter: float) -> None:
    stamps, places = seen(FLYING, jitter, 0)
    order = np.argsort(stamps)
    found = with_stamp_noise(np.ascontiguousarray(stamps[order]), places[order], NOISE)
    if not jitter:
        assert NOISE <= found < 1.4 * NOISE
    else:  # the speed is 3.6 m/s at first, 4.2 at last; third differences that overlap tell it
        assert 0.6 < found / np.hypot(NOISE, 3.6 * jitter) < 1.5


def test_irregular_stamps_that_are_true_are_no_noise() -> None:
    rng = np.random.default_rng(0)
    times = np.cumsum(rng.uniform(0.3, 1.7, 96)) / RATE
    places = path_of(FLYING, times) + rng.normal(0.0, NOISE, (96, 3))
    # a deviation from 93 values that overlap is off by a tenth or two
    assert with_stamp_noise(times, places, NOISE) < 1.4 * NOISE


@pytest.mark.parametrize('jitter', [1e-3, 3e-3])
def test_jitter_is_no_blow(jitter: float) -> None:
    model = BallModel.of(SCENE)
    for seed in range(TRIALS):
        stamps, places = seen(FLYING, jitter, seed)
        order = np.argsort(stamps)
        times = np.ascontiguousarray(stamps[order])
        noise = with_stamp_noise(times, places[order], NOISE)
        assert not len(kinks(model, times, places[order], noise))
