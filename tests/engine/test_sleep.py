# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""Who sleeps, who wakes, and that sleepers keep their place and their support."""

import numpy as np
import pytest
from rigid_gns_core import load_simulator, Plane, Scene, State
from rigid_gns_core.closed_form import laws
from rigid_gns_core.engine.sleep import all_awake
from rigid_gns_core.engine.spheres import Spheres
from rigid_gns_core.engine.world import world_of

from . import calls

DT, G = 0.1, 9.81
LIMIT = 1.6e-3 * np.sqrt(G)  # m/s, of a sphere of 1 m
NOTHING = np.zeros(0, np.int64)


def stepper(scene, positions, velocities=None, spins=None, **options):
    state = State(positions=positions, velocities=velocities, angular_velocities=spins)
    return load_simulator(**options).stepper(scene, state)


def spheres(positions, velocities, spins=None):
    count = len(positions)
    return Spheres(
        positions=positions.copy(),
        quaternions=np.tile([0.0, 0, 0, 1], (count, 1)),
        velocities=velocities.copy(),
        angular_velocities=np.zeros((count, 3)) if spins is None else spins.copy(),
    )


def quiet(frames, contacts, velocities, spins=None, drift=0.0):
    """Sleepers after so many frames in which nothing changes but a drift [m] per frame."""
    count = len(velocities)
    sleepers, radius = all_awake(np.ones(count), G), np.ones(count)
    positions = np.c_[3.0 * np.arange(count), np.zeros(count), np.ones(count)]
    made = calls.islands(count, *map(np.array, contacts))
    for frame in range(frames):
        state = spheres(positions + [frame * drift, 0, 0], velocities, spins)
        calls.rested(radius, made, DT, state, sleepers)
    return sleepers, state


FLOOR = ([0, 1, 2], [1, -1, -1])  # 0 and 1 touch, 1 and 2 are on the floor


def test_an_island_sleeps_after_six_quiet_frames():
    slow = np.full((3, 3), 0.5 * LIMIT / np.sqrt(3.0))
    for frames, asleep in ((5, False), (6, True)):
        sleepers, state = quiet(frames, FLOOR, slow)
        assert sleepers.asleep.tolist() == [asleep] * 3
        assert (np.abs(state.velocities).max() == 0) == asleep
    assert sleepers.island[0] == sleepers.island[1] != sleepers.island[2]


@pytest.mark.parametrize(
    ('change', 'asleep'),
    [
        ({'velocities': (0, 1.1)}, [False, False, True]),  # one too fast keeps its island awake
        ({'velocities': (2, 1.1)}, [True, True, False]),
        ({'spins': (0, 1.1)}, [False, False, True]),  # so does one whose surface is
        ({'contacts': ([0], [1])}, [False, False, False]),  # in the air nothing sleeps
        ({'contacts': ([0, 1], [1, -1])}, [True, True, False]),  # nor what touches nothing
        ({'drift': 0.3 * LIMIT * DT}, [False, False, False]),  # or creeps
        ({'drift': 0.1 * LIMIT * DT}, [True, True, True]),
    ],
)
def test_who_sleeps(change, asleep):
    velocities, spins = np.zeros((3, 3)), np.zeros((3, 3))
    for name, values in (('velocities', velocities), ('spins', spins)):
        if name in change:
            sphere, factor = change[name]
            values[sphere, 1] = factor * LIMIT
    sleepers, _ = quiet(
        8, change.get('contacts', FLOOR), velocities, spins, change.get('drift', 0.0)
    )
    assert sleepers.asleep.tolist() == asleep


def test_a_sleeper_wakes_with_its_island_where_one_awake_may_touch_it():
    sleepers, _ = quiet(8, ([0, 1, 2], [1, -1, -1]), np.zeros((3, 3)))
    positions = np.array([[0.0, 0, 1], [3.0, 0, 1], [6.0, 0, 1], [-9.0, 0, 1]])
    whole = all_awake(np.ones(4), G)
    for name in ('asleep', 'island'):
        getattr(whole, name)[:3] = getattr(sleepers, name)
    whole.islands[0] = sleepers.islands[0]
    world, velocities = world_of(Scene(), 4), np.zeros((4, 3))
    # 7 m to go at v: the reach is v dt + g dt^2, and a hundredth of the radii
    velocities[3, 0] = 68.0
    assert calls.woken(world, positions, velocities, DT, whole).tolist() == [False] * 3 + [True]
    velocities[3, 0] = 70.0
    awake = calls.woken(world, positions, velocities, DT, whole)
    assert awake.tolist() == [True, True, False, True]  # the island of the third is another
    assert not whole.asleep[:2].any() and whole.asleep[2]


def test_woken_spheres_wake_those_that_they_may_touch():
    sleepers = all_awake(np.ones(4), G)
    sleepers.asleep[:3] = True
    sleepers.island[:3] = [0, 1, 2]
    sleepers.islands[0] = 3
    positions = np.array([[0.0, 0, 1], [2.05, 0, 1], [9.0, 0, 1], [-2.05, 0, 1]])
    awake = calls.woken(world_of(Scene(), 4), positions, np.zeros((4, 3)), DT, sleepers)
    assert awake.tolist() == [True, True, False, True]


def layer(side=4):
    grid = 2.0 * np.stack(np.meshgrid(*[np.arange(side)] * 2), -1).reshape(-1, 2)
    return np.c_[grid, np.ones(side**2)]


def test_spheres_at_rest_stay_and_sleep_until_they_are_struck():
    start = layer()
    resting = stepper(Scene(), start)
    for _ in range(100):
        state = resting.step()
    assert np.abs(state.positions - start).max() <= 1e-3
    assert resting.sleepers.asleep.all()
    thrown = stepper(
        Scene(),
        np.r_[start, [[-12.0, 3.0, 1.0]]],
        np.r_[np.zeros((16, 3)), [[6.0, 0, 0]]],
        np.r_[np.zeros((16, 3)), [[0, 6.0, 0]]],
    )
    for _ in range(8):
        thrown.step()
    assert thrown.sleepers.asleep[:16].all() and not thrown.sleepers.asleep[16]
    for _ in range(10):
        state = thrown.step()
    assert not thrown.sleepers.asleep.any()
    assert np.linalg.norm(state.velocities[:16], axis=1).max() > 0.1


def test_sleep_changes_nothing_that_moves():
    # a bounce to rest, then a sphere rolls in: the same with sleep and without, but for creep
    scene = Scene(surfaces=(Plane(),), restitution=0.4, rolling_friction=0.02)
    positions = [[0.0, 0, 1.5], [2.5, 0, 1.0], [-30.0, 0.3, 1.0]]
    velocities, spins = np.zeros((3, 3)), np.zeros((3, 3))
    velocities[2, 0] = spins[2, 1] = 9.0
    ends = []
    for sleep in (True, False):
        moving = stepper(scene, positions, velocities, spins, sleep=sleep)
        states, slept = [], False
        for _ in range(90):
            states.append(moving.step())
            slept |= bool(moving.sleepers.asleep[:2].any())
        assert slept == sleep
        ends.append(states)
    assert np.ptp([state.positions[0, 0] for state in ends[0]]) > 1.0  # it was struck
    for one, other in zip(*ends, strict=True):
        np.testing.assert_allclose(one.positions, other.positions, atol=1e-4)


def test_a_sphere_that_gathers_speed_slowly_does_not_sleep():
    angle = np.radians(0.5)
    plane = Plane(normal=(np.sin(angle), 0.0, np.cos(angle)), friction=1.0)
    rolling = stepper(Scene(surfaces=(plane,), rolling_friction=0.0), [plane.normal])
    for _ in range(25):
        state = rolling.step()
        assert not rolling.sleepers.asleep.any()
    expected = 2.5 * laws.incline_acceleration(angle, 0.5, 0.0, 9.81)
    assert np.linalg.norm(state.velocities) == pytest.approx(expected, rel=1e-3)


def test_a_woken_pile_keeps_its_support():
    third = np.sqrt(3.0)
    pile = [[0, 0, 1], [2, 0, 1], [1, third, 1], [1, 1 / third, 1 + 2 * np.sqrt(2 / 3)]]
    # a visitor rolls past, within reach but without a touch: 0.3 r away
    positions = np.array([*pile, [-2.3, -5.0, 1.0]])
    velocities, spins = np.zeros((5, 3)), np.zeros((5, 3))
    velocities[4], spins[4] = [0.0, 4.0, 0.0], [-4.0, 0.0, 0.0]
    moving = stepper(Scene(friction=1.0), positions, velocities, spins)
    for _ in range(25):
        state = moving.step()
        assert np.linalg.norm(state.velocities[:4], axis=1).max() < 1e-3
    assert moving.sleepers.islands[0] > 1  # woken on the way ..
    assert moving.sleepers.asleep[:4].all()  # .. and asleep again
    assert np.abs(state.positions[:4] - positions[:4]).max() < 1e-3
