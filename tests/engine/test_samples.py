# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Samples of a scene, eight at a time and without a search, beside a rollout of each alone.

A rollout alone goes the way of all frames, so that equal bytes say that no shortcut changes any.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core import Air, load_scene, load_simulator, Plane, Scene, State
from rigid_gns_core.scenes.contact_law import ContactLaw

TABLE = Plane(direction=(1.0, 0.0, 0.0), length_x=12.0, length_y=8.0)
WALL = Plane((7.0, 0.0, 0.0), (-1.0, 0.0, 0.0))
FLOOR = Plane((0.0, 0.0, -6.0))
AIR = Air(drag_coefficient=0.4, lift_coefficient=0.4, density=0.5)
SOFT = ContactLaw(restitution=0.5, friction=0.2, rolling_friction=0.02, spinning_friction=0.1)

SCENES = {
    'vacuum': Scene(surfaces=(TABLE, FLOOR, WALL), restitution=0.9),
    'dull': Scene(surfaces=(FLOOR, WALL), restitution=0.5, rolling_friction=0.05),
    'no gravity': Scene(surfaces=(TABLE, FLOOR, WALL), gravity=(0.0, 0.0, 0.0)),
    'air': Scene(surfaces=(TABLE, FLOOR), air=AIR, mass=50.0),
    'spin decay': Scene(surfaces=(TABLE, FLOOR), air=replace(AIR, spin_decay=0.3), mass=50.0),
    'wind': Scene(surfaces=(TABLE, FLOOR), air=replace(AIR, wind=(3.0, 1.0, 0.0)), mass=50.0),
    'heavy drag': Scene(surfaces=(FLOOR,), air=replace(AIR, wind=(9.0, 0.0, 0.0)), mass=0.2),
    'light': Scene(surfaces=(FLOOR,), air=replace(AIR, spin_decay=0.3), mass=3.0),
    'law': Scene(surfaces=(replace(FLOOR, contact=SOFT),), air=AIR, mass=50.0),
    'slope': Scene(surfaces=(Plane((0.0, 0.0, -6.0), (0.3, 0.0, 1.0)),), restitution=0.6),
    'sizes': Scene(surfaces=(FLOOR, TABLE), radius=(1.0, 0.3), mass=(1.0, 0.1)),
    'nothing': Scene(surfaces=()),
}


def drawn(count: int, samples: int, seed: int) -> State:
    """Starts about a table, some of them on it, some without spin; shapes (s, n, k)."""
    rng = np.random.default_rng(seed)
    spread = np.array([9.0 * count, 4.0, 4.0])
    positions = rng.uniform(-spread, spread, (samples, count, 3)) + [0.0, 0.0, 3.0]
    spins = rng.normal(size=(samples, count, 3)) * 4.0
    spins[::3] = 0.0
    quaternions = rng.normal(size=(samples, count, 4))
    quaternions /= np.linalg.norm(quaternions, axis=-1, keepdims=True)
    velocities = rng.normal(size=(samples, count, 3)) * [5.0, 5.0, 3.0]
    velocities[::5] = 0.0
    return State.unchecked(positions, quaternions, velocities, spins)


def assert_as_alone(scene: Scene, starts: State, steps: int) -> State:
    simulator = load_simulator()
    found = simulator.rollout_samples(scene, starts, steps)
    for k in range(len(starts.positions)):
        own = State(**{name: values[k] for name, values in vars(starts).items()})
        alone = simulator.rollout(scene, **vars(own), steps=steps)
        for name in vars(starts):
            np.testing.assert_array_equal(getattr(found, name)[k], getattr(alone, name), name)
    return found


@pytest.mark.parametrize('count', [1, 2])
@pytest.mark.parametrize('name', SCENES)
def test_samples_are_to_the_bit_rollouts_alone(name: str, count: int) -> None:
    scene = SCENES[name]
    if count == 1 and name == 'sizes':
        scene = replace(scene, radius=0.3, mass=0.1)
    found = assert_as_alone(scene, drawn(count, 11, seed=count), 60)
    if scene.surfaces and name != 'no gravity':  # what is compared is not flight alone
        changes = np.linalg.norm(np.diff(found.velocities, axis=1), axis=-1)
        assert (changes > 2.0).any(axis=(1, 2)).sum() > 2


def test_samples_of_eight_balls_that_meet() -> None:
    starts = drawn(8, 9, seed=3)
    starts.positions[..., 0] /= 4.0
    assert_as_alone(SCENES['dull'], starts, 40)


def test_a_ball_that_bounces_rolls_and_rests_on_a_table() -> None:
    scene = load_scene('table_tennis')
    rng = np.random.default_rng(2)
    starts = State.unchecked(
        np.array([-1.0, 0.0, 0.05]) + rng.normal(size=(19, 1, 3)) * [0.3, 0.3, 0.02],
        np.tile([0.0, 0.0, 0.0, 1.0], (19, 1, 1)),
        np.array([1.5, 0.0, 0.0]) + rng.normal(size=(19, 1, 3)) * 0.3,
        rng.normal(size=(19, 1, 3)) * 60.0,
    )
    starts.positions[-1], starts.velocities[-1] = [0.0, 0.0, 0.02], 0.0
    starts.angular_velocities[-1] = 0.0
    found = assert_as_alone(scene, starts, 140)
    assert not found.velocities[-1].any()  # it lay there
    assert (found.positions[:, -1, 0, 2] < 0.0).any()  # one fell over the end


def test_threads_change_nothing() -> None:
    starts, simulator = drawn(1, 600, seed=4), load_simulator()
    one = simulator.rollout_samples(SCENES['air'], starts, 12, workers=1)
    two = simulator.rollout_samples(SCENES['air'], starts, 12, workers=2)
    for name in vars(starts):
        assert getattr(one, name).tobytes() == getattr(two, name).tobytes()
