# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Restitution of two balls by forecasts, of a tracker too slow and noisy for parabolas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core import ContactLaw, load_simulator, Plane, Scene, State
from rigid_gns_core.data.tracks import Track
from rigid_gns_core.identification.collision_forecasts import told_by_forecasts, with_value
from rigid_gns_core.identification.collisions import shown_collisions
from rigid_gns_core.scenes.tracker import Tracker

RADIUS, NOISE = 0.0535, 3e-3
SCENE = Scene(
    surfaces=Plane(contact=ContactLaw(restitution=0.2, friction=0.4, rolling_friction=0.04)),
    radius=RADIUS,
    mass=0.9,
    sphere_contact=ContactLaw(restitution=0.8, friction=0.1),
    tracker=Tracker(noise=NOISE),
)


@pytest.fixture(scope='module')
def tracks() -> list[Track]:
    """Balls that roll into another at rest, which grips at once, about 30 times a second."""
    simulator, rng = load_simulator(), np.random.default_rng(1)
    starts = []
    for _ in range(16):
        speed = rng.uniform(1.2, 2.5)
        starts.append(
            State(
                positions=[[0.0, 0.0, RADIUS], [0.7, rng.uniform(-0.5, 0.5) * RADIUS, RADIUS]],
                velocities=[[speed, 0.0, 0.0], [0.0, 0.0, 0.0]],
                angular_velocities=[[0.0, speed / RADIUS, 0.0], [0.0, 0.0, 0.0]],
            )
        )
    found = []
    for number, run in enumerate(simulator.rollout_batch(SCENE, starts, 50, workers=1)):
        times = np.arange(0.0, 50 * run.dt, 1 / 30)
        chosen = np.searchsorted(run.dt * np.arange(51), times - 0.5 * run.dt)
        places = run.positions[chosen] + rng.normal(0.0, NOISE, (len(chosen), 2, 3))
        found.append(Track(f'{number}', run.dt * chosen, places, None, ('0', '1')))
    return found


def test_forecasts_tell_a_restitution_that_parabolas_do_not(tracks: list[Track]) -> None:
    assert not len(shown_collisions(tracks, RADIUS))
    told = told_by_forecasts(with_value(SCENE, 'restitution', 0.36), tracks, NOISE, 'restitution')
    assert told is not None
    value, error = told
    # 16 collisions, each to about 0.1
    assert abs(value - 0.8) < 0.1 and 0.01 < error < 0.2


def test_a_restitution_that_forecasts_as_well_stays(tracks: list[Track]) -> None:
    assert told_by_forecasts(SCENE, tracks, NOISE, 'restitution') is None
    other = with_value(SCENE, 'restitution', 0.36)
    assert told_by_forecasts(other, tracks[:3], NOISE, 'restitution') is None
    unlike = replace(SCENE, radius=(RADIUS, RADIUS))
    assert told_by_forecasts(unlike, tracks, NOISE, 'restitution') is None


def test_forecasts_tell_a_friction(tracks: list[Track]) -> None:
    told = told_by_forecasts(with_value(SCENE, 'friction', 0.5), tracks, NOISE, 'friction')
    assert told is not None
    value, error = told
    # blows off the middle by up to half a radius, each told to about 0.2
    assert abs(value - 0.1) < 0.15 and 0.005 < error < 0.15
    assert told_by_forecasts(SCENE, tracks, NOISE, 'friction') is None
