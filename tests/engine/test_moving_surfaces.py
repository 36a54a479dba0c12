# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Surfaces that move, where closed forms do not reach: heaps, and strokes that are very fast."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core import load_simulator, Plane, Scene, Simulator, UserError

V = np.array([0.7, -0.4, 0.9])


@pytest.fixture(scope='module')
def laws() -> Simulator:
    return load_simulator('laws')


def heap(rng: np.random.Generator) -> np.ndarray:
    """Centres of 12 spheres of 1 m, apart, above a small box."""
    grid = np.stack(np.meshgrid([-2.2, 0.0, 2.2], [-1.2, 1.2], [1.5, 4.0]), axis=-1)
    return grid.reshape(-1, 3) + rng.uniform(-0.05, 0.05, (12, 3))


def test_a_heap_in_a_box_that_moves_is_the_heap_in_a_box_at_rest() -> None:
    laws = load_simulator('laws', guard=False)  # which knows no frame but that of the world
    scene = Scene(surfaces=Plane.box(7.2, 5.2), restitution=0.6, friction=0.5)
    moving = replace(scene, surfaces=tuple(replace(plane, velocity=V) for plane in scene.surfaces))
    rng = np.random.default_rng(0)
    places, speeds = heap(rng), 3.0 * rng.normal(size=(12, 3))
    still = laws.rollout(scene, places, speeds, steps=12)
    carried = laws.rollout(moving, places, speeds + V, steps=12)
    apart = carried.positions - still.positions - still.times[:, None, None] * V
    assert np.abs(apart).max() < 1e-12  # of places of 5 m, over 12 frames of blows


def test_a_belt_gives_no_more_than_its_speed(laws: Simulator) -> None:
    belt = Plane(surface_velocity=(3.0, 0.0, 0.0))
    scene = Scene(surfaces=(belt, *Plane.box(40.0, 5.2)[1:]), restitution=0.3, friction=0.5)
    run = laws.rollout(scene, heap(np.random.default_rng(1)), steps=60)
    speeds = np.linalg.norm(run.velocities, axis=-1)
    mean = run.velocities[-1, :, 0].mean()
    assert np.isfinite(run.positions).all() and run.positions[..., 2].min() > 0.99
    assert 0.5 < mean < 3.0  # they are carried along
    assert speeds[40:].max() < 6.0


def test_no_centre_passes_a_racket_however_fast(laws: Simulator) -> None:
    for speed in (10.0, 100.0, 1000.0):
        racket = Plane(
            (-5.0, 0.0, 0.0),
            (1.0, 0.0, 0.0),
            length_x=40.0,
            length_y=40.0,
            velocity=(speed, 0.0, 0.0),
        )
        scene = Scene(surfaces=(racket,), gravity=0.0, restitution=1.0, friction=0.0)
        run = laws.rollout(scene, [(0.0, 0.0, 0.0), (2.5, 0.5, 0.0)], steps=20)
        ahead = run.positions[..., 0] - (speed * run.times - 5.0)[:, None]
        assert ahead.min() > 0.99
        # along x the two exchange what they have: the first one that is hit leaves at 2 V
        assert run.velocities[-1, :, 0].max() <= 2.0 * speed * (1.0 + 1e-9)


def test_a_surface_that_moves_wakes_what_rests(laws: Simulator) -> None:
    wall = Plane((-12.0, 0.0, 0.0), (1.0, 0.0, 0.0), velocity=(1.0, 0.0, 0.0))
    scene = Scene(surfaces=(Plane(), wall), restitution=0.5, friction=0.5)
    run = laws.rollout(scene, [(0.0, 0.0, 1.0)], steps=200)
    assert run.positions[-1, 0, 0] > 20.0 - 12.0 + 1.0 - 1e-6


@pytest.mark.parametrize(
    ('given', 'message'),
    [
        ({'velocity': (np.nan, 0.0, 0.0)}, 'velocity of a plane .* three finite numbers'),
        ({'angular_velocity': (1.0, 0.0)}, 'angular_velocity of a plane'),
        ({'surface_velocity': (1.0, 0.0, 0.1)}, 'along its normal; a belt moves along itself'),
    ],
)
def test_wrong_motions_are_named(given: dict, message: str) -> None:
    with pytest.raises(UserError, match=message):
        Plane(**given)
