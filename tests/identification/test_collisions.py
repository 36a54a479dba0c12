# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Restitution of two balls and the lean of walls, from synthetic tracks whose values are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core import ContactLaw, load_simulator, Plane, Scene, State
from rigid_gns_core.data.tracks import Track
from rigid_gns_core.identification.collisions import shown_collisions
from rigid_gns_core.identification.parameters import Laws

RADIUS = 0.03
SCENE = Scene(
    surfaces=Plane(contact=ContactLaw(restitution=0.5, friction=0.2, rolling_friction=0.01)),
    radius=RADIUS,
    mass=0.2,
    sphere_contact=ContactLaw(restitution=0.9, friction=0.05),
)


def collisions(count: int, noise: float) -> list[Track]:
    """Shots on a ball at rest, which the tracker leaves out before it moves; every frame."""
    simulator = load_simulator()
    rng = np.random.default_rng(0)
    starts = []
    for _ in range(count):
        aim = rng.uniform(-1.2, 1.2) * RADIUS
        speed = rng.uniform(0.8, 2.5)
        starts.append(
            State(
                positions=[[0.0, 0.0, RADIUS], [0.45, aim, RADIUS]],
                velocities=[[speed, 0.0, 0.0], [0.0, 0.0, 0.0]],
                angular_velocities=[[0.0, speed / RADIUS, 0.0], [0.0, 0.0, 0.0]],
            )
        )
    tracks = []
    for number, run in enumerate(simulator.rollout_batch(SCENE, starts, 60, workers=1)):
        places = run.positions + rng.normal(0.0, noise, run.positions.shape)
        places[..., 2] = RADIUS
        rests = np.linalg.norm(run.positions[:, 1] - run.positions[0, 1], axis=1) < 1e-9
        rests[0] = False  # it is told once
        places[rests, 1] = np.nan
        tracks.append(Track(f'{number}', np.arange(61) * run.dt, places, None, ('0', '1')))
    return tracks


@pytest.fixture(scope='module')
def shown() -> np.ndarray:
    return shown_collisions(collisions(24, 0.2e-3), RADIUS)


def test_collisions_show_their_restitution(shown: np.ndarray) -> None:
    assert len(shown) >= 12
    # 0.2 mm at 58 Hz are 30 mm/s in a velocity at the end of six frames, of 1 m/s and more
    assert abs(np.median(shown[:, 1]) - 0.9) < 0.03
    assert (shown[:, 0] > 0.3).all() and (shown[:, 1] <= 1.0).all()


def test_balls_that_pass_each_other_show_nothing() -> None:
    times = np.arange(60) / 50.0
    places = np.zeros((60, 2, 3))
    places[:, 0, 0], places[:, 1, 0] = times, 1.2 - times
    places[:, 1, 1] = 3.0 * RADIUS
    assert not len(shown_collisions([Track('0', times, places, None, ('0', '1'))], RADIUS))


def test_lean_turns_walls_over_the_ball_and_leaves_the_floor() -> None:
    wall = Plane((0.0, 0.0, 0.05), (1.0, 0.0, 0.0), contact=ContactLaw(restitution=0.7))
    laws = Laws(replace(SCENE, surfaces=(*SCENE.surfaces, wall)))
    floor, leaning = laws.surfaces_at({'contact 1.lean': 0.2, 'contact 0.lean': 0.2})
    assert floor.normal == (0.0, 0.0, 1.0)
    np.testing.assert_allclose(leaning.normal, np.array([1.0, 0.0, -0.2]) / np.sqrt(1.04))
    assert laws.start_of('contact 1.lean').unit == 'rad'
    rows = laws.models_at({'contact 1.lean': 0.2})[0]
    np.testing.assert_allclose(rows.planes[1, 9:12], leaning.normal)
    # laws are as before
    np.testing.assert_array_equal(rows.laws, laws.models[0].laws)
    assert laws.scene_at({'contact 1.lean': 0.2}).surfaces[1].normal == leaning.normal
