# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The engine does what the torch reference does, and finds what brute force finds."""

import warnings

import numpy as np
import pytest
from rigid_gns_core import load_simulator, Plane, Scene
from rigid_gns_core.kernels.neighbours import find_pairs
from rigid_gns_core.scenes.state import State

# One step in float32 arithmetic is good to 1e-6; solving contacts loses another digit.
ONE_STEP = 1e-5


def crowd(count, seed, width=6.0, height=8.0, speed=3.0):
    """Spheres without overlap, in a box of `width`."""
    draw = np.random.default_rng(seed)
    placed: list[np.ndarray] = []
    while len(placed) < count:
        place = draw.uniform(
            [-width / 2 + 1, -width / 2 + 1, 1], [width / 2 - 1, width / 2 - 1, height]
        )
        if all(np.linalg.norm(place - other) > 2.02 for other in placed):
            placed.append(place)
    shape = (count, 3)
    return State(
        positions=np.array(placed),
        velocities=draw.normal(0, speed, shape),
        angular_velocities=draw.normal(0, speed, shape),
    )


MIXED = {
    'mass': (0.5, 1.0, 4.0, 2.0, 1.0, 8.0),
    'restitution': (0.9, 0.3, 0.0, 0.7, 0.5, 0.8),
    'friction': (0.0, 0.4, 1.0, 0.2, 0.6, 0.5),
    'rolling_friction': (0.0, 0.02, 0.05, 0.01, 0.0, 0.03),
}
PLATE = Plane(
    point=(0.0, 0.0, 3.0), normal=(0.3, 0.0, 0.954), length_x=4.0, length_y=3.0, restitution=0.9
)
SCENES = {
    'box': (Scene(surfaces=Plane.box(8.0, 8.0)), crowd(14, 0, 8.0)),
    'mixed': (Scene(surfaces=Plane.box(6.0, 6.0), **MIXED), crowd(6, 1)),
    'plate': (Scene(surfaces=(Plane(), PLATE), rolling_friction=0.02), crowd(8, 2)),
    'space': (Scene(surfaces=(), gravity=(0.0, 0.0, 0.0)), crowd(10, 3, speed=8.0)),
}


def run(backend, scene, state, steps, **options):
    """States of a rollout, the start first."""
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # mixed materials are beyond the training's
        simulator = load_simulator('contact', backend=backend, **options)
        rollout = simulator.start(
            scene,
            state.positions,
            state.velocities,
            state.angular_velocities,
            quaternions=state.quaternions,
        )
    return [rollout.state, *(rollout.step() for _ in range(steps))]


def apart(one, other):
    """Largest difference of two states, in radii and radii per 0.1 s."""
    differences = (
        one.positions - other.positions,
        0.1 * (one.velocities - other.velocities),
        0.1 * (one.angular_velocities - other.angular_velocities),
        one.quaternions - other.quaternions,
    )
    return max(np.abs(difference).max() for difference in differences)


@pytest.mark.parametrize('name', SCENES)
@pytest.mark.parametrize('options', [{}, {'network': False}], ids=['network', 'law'])
def test_one_step_is_that_of_the_reference(name, options):
    scene, start = SCENES[name]
    states = run('engine', scene, start, 24, **options)
    for state in states[::2]:
        found, expected = (run(b, scene, state, 1, **options)[1] for b in ('engine', 'torch'))
        assert apart(found, expected) < ONE_STEP


def test_spheres_that_come_to_rest_sleep_and_wake_as_in_the_reference():
    # few contacts at a time, so rounding does not grow: a bounce to rest, then a sphere rolls in
    scene = Scene(surfaces=(Plane(),), restitution=0.4, rolling_friction=0.02)
    start = State(
        positions=np.array([[0.0, 0, 1.5], [2.5, 0, 1.0], [-30.0, 0.3, 1.0]]),
        velocities=np.array([[0.0, 0, 0], [0.0, 0, 0], [9.0, 0, 0]]),
        angular_velocities=np.array([[0.0, 0, 0], [0.0, 0, 0], [0.0, 9.0, 0]]),
    )
    found, expected = (run(backend, scene, start, 90) for backend in ('engine', 'torch'))
    assert np.ptp([state.positions[0, 0] for state in found]) > 1.0  # it was struck
    for one, other in zip(found, expected, strict=True):
        assert apart(one, other) < 1e-4


def test_the_thesis_network_is_that_of_the_reference():
    scene = Scene(surfaces=Plane.box(12.0, 12.0))
    start = crowd(20, 4, 12.0)
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # its materials
        found, expected = (
            load_simulator('gns', backend=backend).rollout(
                scene, start.positions, start.velocities, steps=1
            )
            for backend in ('engine', 'torch')
        )
    assert apart(found[1], expected[1]) < ONE_STEP


@pytest.mark.parametrize('seed', range(4))
def test_pairs_are_those_of_brute_force(seed):
    draw = np.random.default_rng(seed)
    count = (1, 40, 500, 900)[seed]
    positions = draw.uniform(-30, 30, (count, 3))
    # reaches over three decades: several levels of cells, some with few spheres
    extent = draw.choice([0.3, 1.0, 4.0], count) * draw.uniform(0.5, 1.5, count)
    extent[0] = 90.0
    awake = draw.random(count) < 0.8
    first, second = find_pairs(positions, extent, awake)
    distance = np.linalg.norm(positions[:, None] - positions[None], axis=-1)
    near = np.triu(distance <= extent[:, None] + extent[None], 1)
    near &= awake[:, None] | awake[None]
    np.testing.assert_array_equal(np.stack([first, second], 1), np.argwhere(near))


def test_the_same_start_gives_the_same_bytes():
    scene, start = SCENES['box']
    one, other = (run('engine', scene, start, 30)[-1] for _ in range(2))
    assert one.positions.tobytes() == other.positions.tobytes()
    assert one.quaternions.tobytes() == other.quaternions.tobytes()
