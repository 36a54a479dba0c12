# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A ball that was struck at rest slides without spin: against the closed form of sliding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core import ContactLaw, Plane, Scene
from rigid_gns_core.scenes.tracker import Tracker
from rigid_gns_core.tracking import estimate_state

RADIUS, FRICTION, SPEED, RATE, NOISE = 0.03, 0.2, 2.0, 50.0, 3e-4
SCENE = Scene(
    surfaces=(Plane(contact=ContactLaw(restitution=0.8, friction=FRICTION)),),
    radius=RADIUS,
    mass=0.2,
    tracker=Tracker(noise=NOISE, drift=1e-5, memory=0.8),
)


def estimated(rolls: float, since: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and spin so long after a ball struck another; the striker stays where it was then.

    Args:
        rolls: Velocity along the blow at which the struck one rolled before [m/s].
        since: Time from the blow to the last frame [s].
        seed: Of the noise.
    """
    times = np.arange(-0.4, since + 1e-9, 1.0 / RATE)
    after = np.maximum(times, 0.0)
    places = np.zeros((len(times), 2, 3))
    places[..., 2] = RADIUS
    places[:, 0, 0] = rolls * np.minimum(times, 0.0)
    places[:, 0, 0] += SPEED * after - 0.5 * FRICTION * 9.81 * after**2
    places[:, 1, 0] = -2.0 * RADIUS + 3.0 * np.minimum(times, 0.0)
    places += np.random.default_rng(seed).normal(0.0, NOISE, places.shape)
    state = estimate_state(SCENE, times + 1.0, places).state
    return state.velocities[0], state.angular_velocities[0]


@pytest.mark.parametrize('rolls', [0.0, 0.5])
@pytest.mark.parametrize('seed', [0, 1, 2])
def test_a_ball_that_was_struck_keeps_the_spin_that_it_had(rolls: float, seed: int) -> None:
    """It slides from 2 m/s until its spin is that of rolling, 0.29 s after: 0.15 s tell nothing.

    Taken to roll it would spin by 1 m/s at the equator faster. The prior has a deviation of 0.4.
    """
    since = 0.15
    velocity, spin = estimated(rolls, since, seed)
    sliding = FRICTION * 9.81 * since
    assert abs(velocity[0] - (SPEED - sliding)) < 0.05
    assert abs(spin[1] * RADIUS - (rolls + 2.5 * sliding)) < 0.45


@pytest.mark.parametrize('seed', [0, 1, 2])
def test_two_frames_after_a_blow_tell_a_velocity(seed: int) -> None:
    """Two frames are 0.02 s apart: 0.02 m/s of deviation; the spin is that of before, and slides.

    A ball of which nothing else is known was taken not to spin, or to roll: 0.6 m/s off.
    """
    velocity, spin = estimated(0.5, 0.045, seed)
    sliding = FRICTION * 9.81 * 0.04
    assert abs(velocity[0] - (SPEED - sliding)) < 0.1
    assert abs(spin[1] * RADIUS - (0.5 + 2.5 * sliding)) < 0.45


@pytest.mark.parametrize('frames', [2, 3, 4])
@pytest.mark.parametrize('seed', [0, 1, 2])
def test_a_blow_where_a_cushion_is_does_not_hide_behind_it(frames: int, seed: int) -> None:
    """A path that bounces off the cushion explains the jump, but not where the ball is by now.

    Of the frames since, two tell the velocity to 0.02 m/s, as above; five deviations are allowed.
    """
    cushion = Plane((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), contact=SCENE.surfaces[0].contact)
    scene = replace(SCENE, surfaces=(*SCENE.surfaces, cushion))
    before, after, blow = np.array([2.9, 1.8]), np.array([-1.65, -0.62]), np.array([0.96, 0.5])
    times = (np.arange(-20, frames) + 0.5) / RATE
    places = np.full((len(times), 1, 3), RADIUS)
    places[:, 0, :2] = blow + np.where(times[:, None] < 0.0, before, after) * times[:, None]
    places += np.random.default_rng(seed).normal(0.0, NOISE, places.shape)
    estimate = estimate_state(scene, times + 1.0, places)
    assert np.abs(estimate.state.velocities[0, :2] - after).max() < 0.11
