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

"""No contact is missed, and none is looked for that cannot be."""

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core import load_simulator
from rigid_gns_core.models.contact.candidates import find_candidates, join
from rigid_gns_core.scenes.plane import closest_points
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.state import State

DT = 0.1
GRAVITY = np.array([0.0, 0.0, -9.81])
BOX = Plane.box(14.0, 14.0, 9.0)


def reaches(velocities):
    """Return the least that must be looked for: any direction at this speed, and the fall."""
    return np.linalg.norm(velocities, axis=1) * DT + 0.5 * 9.81 * DT**2


def crowd(seed, count=60):
    rng = np.random.default_rng(seed)
    positions = rng.uniform(-6, 6, (count, 3)) + [0, 0, 6]
    velocities = rng.normal(size=(count, 3)) * rng.exponential(5.0, (count, 1))
    return positions, velocities, rng.uniform(0.2, 1.0, count)


def pairs(found):
    return list(zip(found.first.tolist(), found.second.tolist(), strict=True))


def find(positions, velocities, radius, surfaces=(), awake=None):
    return find_candidates(positions, velocities, radius, surfaces, GRAVITY, DT, awake)


@pytest.mark.parametrize('seed', range(4))
def test_none_within_reach_is_missed(seed):
    positions, velocities, radius = crowd(seed)
    if seed % 2:
        velocities = 0.01 * velocities  # the other way of looking: all reach about as far
        radius = np.full(60, 0.7)
    found = find(positions, velocities, radius, BOX)
    reach = reaches(velocities)
    gap = np.linalg.norm(positions[:, None] - positions, axis=-1) - np.add.outer(radius, radius)
    near = np.argwhere(np.triu(gap <= np.add.outer(reach, reach), 1))
    listed = pairs(found)
    assert len(near) > 5
    assert {tuple(pair) for pair in near.tolist()} <= set(listed)
    assert listed == sorted(set(listed))
    assert (found.first < found.second).all()
    points, _ = closest_points(BOX, positions)
    away = np.linalg.norm(positions[:, None] - points, axis=-1)
    near = np.argwhere(away <= (radius + reach)[:, None])
    others = list(zip(found.sphere.tolist(), found.plane.tolist(), strict=True))
    assert len(near) > 0
    assert {tuple(pair) for pair in near.tolist()} <= set(others)
    assert others == sorted(set(others))


def test_one_fast_sphere_brings_no_pairs_of_others():
    positions, velocities, radius = crowd(9)
    velocities *= 0.1
    before = set(pairs(find(positions, velocities, radius)))
    velocities[7] = [400.0, 0, 0]
    after = set(pairs(find(positions, velocities, radius)))
    assert {pair for pair in after if 7 not in pair} == {pair for pair in before if 7 not in pair}
    assert len(after) > len(before)


def test_what_sleeps_is_left_out():
    positions, velocities, radius = crowd(11)
    awake = np.zeros(60, dtype=bool)
    assert len(find(positions, velocities, radius, BOX, awake)) == 0
    awake[::4] = True
    found = find(positions, np.zeros((60, 3)), radius, BOX, awake)
    assert len(found.first) and awake[np.c_[found.first, found.second]].any(axis=1).all()
    assert awake[found.sphere].all()
    everyone = set(pairs(find(positions, np.zeros((60, 3)), radius)))
    # sleepers do not fall, hence reach less far than the others
    assert set(pairs(found)) <= everyone


def test_side_by_side_and_empty():
    positions, velocities, radius = crowd(1)
    found = find(positions, velocities, radius, BOX)
    both = join([found, found.shifted(60, 5)])
    assert len(both) == 2 * len(found)
    np.testing.assert_array_equal(both.first, np.r_[found.first, found.first + 60])
    np.testing.assert_array_equal(both.plane, np.r_[found.plane, found.plane + 5])
    assert len(find(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), BOX)) == 0
    assert len(find(positions[:1], velocities[:1], radius[:1])) == 0


def struck(wall, gap, mass, speed, substeps, backend):
    """Highest x of a light sphere `gap` from a wall at x = 0 that a fast one strikes."""
    scene = Scene(
        surfaces=(wall,), gravity=(0.0, 0.0, 0.0), mass=(1.0, mass), restitution=1.0, friction=0.0
    )
    start = State(
        positions=np.array([[-4.0 - gap, 0, 0], [-1.0 - gap, 0.2, 0]]),
        velocities=np.array([[speed, 0, 0], [0, 0, 0]]),
    )
    law = load_simulator('contact', network=False, substeps=substeps, rounds=6, backend=backend)
    stepper = law.stepper(scene, start)
    states = [stepper.step() for _ in range(6)]
    assert np.linalg.norm(states[-1].velocities[1]) > 5.0  # it was struck
    return max(state.positions[1, 0] for state in states)


WALL = Plane(normal=(-1.0, 0.0, 0.0))
PLATE = replace(WALL, length_x=40.0, length_y=40.0)


@pytest.mark.parametrize('wall', [WALL, PLATE], ids=['wall', 'plate'])
@pytest.mark.parametrize('gap', [0.02, 0.1, 0.5, 0.9])
@pytest.mark.parametrize('backend', ['engine', 'torch'])
def test_a_struck_sphere_that_outruns_its_reach_stays_inside(wall, gap, backend):
    # 30 r/s after the blow: 0.8 r in a substep
    assert struck(wall, gap, 0.3, 20.0, 4, backend) < -1.0 + 1e-3


@pytest.mark.parametrize('backend', ['engine', 'torch'])
@pytest.mark.parametrize('gap', [0.02, 0.5])
def test_a_plate_holds_what_crosses_it_in_a_substep(gap, backend):
    assert struck(PLATE, gap, 0.3, 20.0, 2, backend) < -1.0 + 1e-3


@pytest.mark.parametrize('wall', [WALL, PLATE], ids=['wall', 'plate'])
@pytest.mark.parametrize('backend', ['engine', 'torch'])
def test_candidates_follow_a_blow_in_the_last_substep(wall, backend):
    assert struck(wall, 0.9, 0.3, 20.0, 2, backend) < -1.0 + 1e-3
