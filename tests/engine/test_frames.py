# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames of few spheres that only fly, beside the way that all frames can go."""

import numpy as np
import pytest
from rigid_gns_core import Air, load_simulator, Plane, Scene, State

TABLE = Plane(direction=(1.0, 0.0, 0.0), length_x=20.0, length_y=12.0)
AIR = Air(drag_coefficient=0.4, lift_coefficient=0.4, wind=(3.0, 0.0, 0.0), density=0.5)


def test_what_flies_past_a_racket_is_to_the_bit_what_all_frames_give():
    """A sphere that lies on a floor beside it sends all frames the long way."""
    racket = Plane(
        normal=(1.0, 0.0, 0.3),
        direction=(0.0, 1.0, 0.0),
        length_x=4.0,
        length_y=4.0,
        velocity=(6.0, 0.0, 1.0),
        angular_velocity=(0.0, 2.0, 1.0),
    )
    scene = Scene(surfaces=(racket, Plane((0.0, 0.0, -20.0))), air=AIR, mass=50.0)
    simulator = load_simulator()
    rng = np.random.default_rng(6)
    touched = 0
    for _ in range(10):
        positions = rng.uniform([0.0, -2.0, -3.0], [9.0, 2.0, 4.0], (1, 3))
        velocities, spins = rng.normal(size=(2, 1, 3)) * 4.0
        alone = simulator.rollout(scene, positions, velocities, spins, steps=30)
        both = simulator.rollout(
            scene,
            np.concatenate([positions, [[-500.0, 0.0, -19.0]]]),
            np.concatenate([velocities, np.zeros((1, 3))]),
            np.concatenate([spins, np.zeros((1, 3))]),
            steps=30,
        )
        np.testing.assert_array_equal(alone.positions[:, 0], both.positions[:, 0])
        np.testing.assert_array_equal(alone.velocities[:, 0], both.velocities[:, 0])
        changes = np.linalg.norm(np.diff(alone.velocities, axis=0), axis=-1)
        touched += int((changes > 3.0).any())
    assert touched > 2


@pytest.mark.parametrize('air', [None, AIR])
@pytest.mark.parametrize('count', [1, 2])
def test_what_only_flies_is_to_the_bit_what_all_frames_give(air, count):
    """A sphere that sleeps far away sends all others the long way, and changes nothing.

    Spheres of 1 m over a table with ends, a floor and a wall, at up to 20 m/s: near misses of
    faces and of ends are among them.
    """
    floor, wall = Plane((0.0, 0.0, -20.0)), Plane((14.0, 0.0, 0.0), (-1.0, 0.0, 0.0))
    scene = Scene(surfaces=(TABLE, floor, wall), air=air, mass=50.0, restitution=0.9)
    simulator = load_simulator()
    # it has lain still for long enough that it sleeps
    far = simulator.rollout(scene, [[-500.0, 0.0, -19.0]], steps=60)
    assert not far.velocities[-1].any()
    rng = np.random.default_rng(5)
    touched = 0
    for _ in range(12):
        positions = rng.uniform([-12.0, -8.0, -6.0], [12.0, 8.0, 9.0], (count, 3))
        velocities = rng.normal(size=(count, 3)) * 8.0
        spins = rng.normal(size=(count, 3)) * 5.0
        alone = simulator.rollout(scene, positions, velocities, spins, steps=60)
        lying = State(
            positions=np.concatenate([positions, far.positions[-1]]),
            velocities=np.concatenate([velocities, np.zeros((1, 3))]),
            angular_velocities=np.concatenate([spins, np.zeros((1, 3))]),
        )
        both = simulator.rollout(scene, **vars(lying), steps=60)
        assert not both.velocities[20:, -1].any()
        np.testing.assert_array_equal(alone.positions, both.positions[:, :-1])
        np.testing.assert_array_equal(alone.velocities, both.velocities[:, :-1])
        np.testing.assert_array_equal(alone.quaternions, both.quaternions[:, :-1])
        changes = np.linalg.norm(np.diff(alone.velocities, axis=0), axis=-1)
        touched += int((changes > 3.0).any())
    assert touched > 3
