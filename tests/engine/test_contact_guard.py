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

"""The energy guard, sleep, and starts that overlap, for any weights."""

import numpy as np
import pytest
from rigid_gns_core import Plane, Scene, State
from rigid_gns_core.closed_form import laws
from rigid_gns_core.gns.config import ContactConfig
from rigid_gns_core.models.contact.candidates import find_candidates
from rigid_gns_core.models.contact.geometry import find_contacts
from rigid_gns_core.models.contact.guard import Guard
from rigid_gns_core.models.contact.islands import Islands
from rigid_gns_core.models.contact.network import ContactNetwork
from rigid_gns_core.models.contact.overlap import push_out
from rigid_gns_core.models.contact.stepper import ContactStepper
from rigid_gns_core.models.contact.world import World
import torch

GRAVITY = np.array([0.0, 0.0, -9.81])


def stepper(scene, positions, velocities=None, spins=None, *, std=0.5, size=(2, 3), **options):
    """Return a rollout in the units of the model, with random weights."""
    torch.manual_seed(0)
    config = ContactConfig(substeps=size[0], rounds=size[1], width=8)
    network = ContactNetwork(config).eval()
    with torch.no_grad():
        for parameter in network.heads.parameters():
            parameter.normal_(std=std)
    state = State(positions=positions, velocities=velocities, angular_velocities=spins)
    return ContactStepper(network, config, scene, state, 0.1, **options)


def violent(**options):
    rng = np.random.default_rng(3)
    grid = np.stack(np.meshgrid(*[np.arange(3)] * 3), -1).reshape(-1, 3)[:20]
    walls = Plane.box(7, 7, 7)
    scene = Scene(surfaces=walls, restitution=1.0, friction=0.0, rolling_friction=0.0)
    velocities, spins = 12.0 * rng.normal(size=(20, 3)), 3.0 * rng.normal(size=(20, 3))
    return stepper(scene, 2.2 * grid - [2.2, 2.2, -1.2], velocities, spins, **options)


def energy_of(state, mass, gravity):
    return laws.energy(
        state.positions, state.velocities, state.angular_velocities, mass, np.ones(20), gravity
    )


@pytest.mark.parametrize('std', [0.5, 3.0])
@pytest.mark.parametrize('dtype', [torch.float64, torch.float32])
def test_no_island_gains_energy(dtype, std):
    moving = violent(dtype=dtype, std=std)
    guard, worst = moving.guard, []
    hold = guard.hold

    def watched(before, after, islands):
        held = hold(before, after, islands)
        (k, p), (k0, p0) = guard.energy(held), guard.energy(before)
        # the guard works in float64 on what float32 contacts gave
        worst.append((islands.sum(k + p - k0 - p0) / islands.sum(k + k0 + abs(p) + abs(p0))).max())
        return held

    guard.hold = watched
    for _ in range(15):
        moving.step()
    assert len(worst) == guard.frames == 15
    assert max(worst) < 1e-12
    assert guard.acted > 0 and guard.removed > 0


def test_without_the_guard_energy_may_rise():
    moving = violent(guard=False, std=3.0)
    energies = [energy_of(moving.state, np.ones(20), GRAVITY)]
    for _ in range(15):
        moving.step()
        energies.append(energy_of(moving.state, np.ones(20), GRAVITY))
    assert moving.guard is None
    assert np.diff(energies).max() > 1e-3 * energies[0]


def islands(label, grounded):
    label = np.asarray(label)
    touched = np.ones(len(label), dtype=bool)
    return Islands(label, int(label.max()) + 1, touched, np.asarray(grounded))


def random_state(rng, count, speed):
    return State(
        positions=rng.normal(size=(count, 3)) * 3.0,
        velocities=rng.normal(size=(count, 3)) * speed,
        angular_velocities=rng.normal(size=(count, 3)) * speed,
    )


def test_guard_takes_energy_but_no_momentum_from_free_islands():
    rng = np.random.default_rng(0)
    mass, radius = rng.uniform(0.5, 2, 7), rng.uniform(0.5, 1, 7)
    scene = Scene(surfaces=(), gravity=(0.0, 0.0, 0.0), mass=tuple(mass), radius=tuple(radius))
    guard = Guard(scene, 7, 0.1)
    before, after = random_state(rng, 7, 3.0), random_state(rng, 7, 3.1)
    after = State(
        positions=before.positions,
        velocities=before.velocities + after.velocities * 0.1,
        angular_velocities=1.2 * before.angular_velocities,
    )
    parts = islands([0, 0, 0, 1, 1, 1, 1], [False, False])
    held = guard.hold(before, after, parts)
    gain = parts.sum(guard.energy(held)[0] - guard.energy(before)[0])
    assert (gain < 1e-11).all()  # float64 sums
    for members in (slice(0, 3), slice(3, 7)):
        one, other = (
            laws.momenta(
                s.positions[members],
                s.velocities[members],
                s.angular_velocities[members],
                mass[members],
                radius[members],
            )
            for s in (before, held)
        )
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-11)
    assert guard.acted > 0 and guard.removed > 0
    assert guard.frames == 1


def test_guard_lets_falling_energy_alone_and_slows_grounded_islands():
    rng = np.random.default_rng(1)
    guard, parts = Guard(Scene(), 4, 0.1), islands([0, 0, 1, 1], [True, True])
    before = random_state(rng, 4, 2.0)
    slower = State(positions=before.positions, velocities=0.9 * before.velocities)
    held = guard.hold(before, slower, parts)
    np.testing.assert_array_equal(held.velocities, slower.velocities)
    faster = State(positions=before.positions, velocities=5.0 * before.velocities)
    held = guard.hold(before, faster, parts)
    total = [parts.sum(sum(guard.energy(s))) for s in (before, held)]
    np.testing.assert_allclose(total[0], total[1], rtol=1e-12)
    assert guard.acted == 2 and guard.frames == 2


def layer(side=4):
    grid = 2.0 * np.stack(np.meshgrid(*[np.arange(side)] * 2), -1).reshape(-1, 2)
    return np.c_[grid, np.ones(side**2)]


def test_spheres_at_rest_stay_and_sleep_until_they_are_struck():
    start = layer()
    resting = stepper(Scene(), start)
    for _ in range(100):
        resting.step()
    assert np.abs(resting.state.positions - start).max() <= 1e-3
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
        thrown.step()
    assert not thrown.sleepers.asleep.any()
    assert np.linalg.norm(thrown.state.velocities[:16], axis=1).max() > 0.1


def test_a_sphere_that_gathers_speed_slowly_does_not_sleep():
    angle = np.radians(0.5)
    plane = Plane(normal=(np.sin(angle), 0.0, np.cos(angle)), friction=1.0)
    rolling = stepper(Scene(surfaces=(plane,), rolling_friction=0.0), [plane.normal])
    for _ in range(25):
        rolling.step()
        assert not rolling.sleepers.asleep.any()
    expected = 2.5 * laws.incline_acceleration(angle, 0.5, 0.0, 9.81)
    assert np.linalg.norm(rolling.state.velocities) == pytest.approx(expected, rel=1e-3)


def test_a_woken_pile_keeps_its_support():
    third = np.sqrt(3.0)
    pile = [[0, 0, 1], [2, 0, 1], [1, third, 1], [1, 1 / third, 1 + 2 * np.sqrt(2 / 3)]]
    # a visitor rolls past, within reach but without a touch: 0.3 r away
    positions = np.array([*pile, [-2.3, -5.0, 1.0]])
    velocities, spins = np.zeros((5, 3)), np.zeros((5, 3))
    velocities[4], spins[4] = [0.0, 4.0, 0.0], [-4.0, 0.0, 0.0]
    moving = stepper(Scene(friction=1.0), positions, velocities, spins)
    wake, awake = moving.sleepers.wake, []

    def watched(candidates):
        flags = wake(candidates)
        awake.append(bool(flags[:4].all()))
        return flags

    moving.sleepers.wake = watched
    for _ in range(20):
        state = moving.step()
        assert np.linalg.norm(state.velocities[:4], axis=1).max() < 1e-3
    slept = awake.index(False)
    assert any(awake[slept:]) and not awake[-1]  # woken on the way, and asleep again
    assert np.abs(state.positions[:4] - positions[:4]).max() < 1e-3


def least_gap(positions):
    apart = np.linalg.norm(positions[:, None] - positions, axis=-1)
    np.fill_diagonal(apart, np.inf)
    return apart.min() - 2.0


@pytest.mark.parametrize(
    ('positions', 'scene'),
    [
        ([[0.0, 0, 5], [1.0, 0.3, 5]], Scene(surfaces=(), gravity=(0.0, 0.0, 0.0))),
        ([[0.0, 0, 5], [0.0, 0, 5]], Scene(surfaces=(), gravity=(0.0, 0.0, 0.0))),
        ([[0.0, 0, 5]] * 5, Scene(surfaces=(), gravity=(0.0, 0.0, 0.0))),
        ([[0.0, 0, 0.0]], Scene()),
        ([[0.0, 0, -3.0]], Scene()),
        ([[0.0, 0, 1], [0.0, 0, 1]], Scene()),
    ],
    ids=['overlap', 'same point', 'five in one', 'half below', 'below', 'same on the floor'],
)
def test_overlapping_starts_are_pushed_apart_at_rest(positions, scene):
    moving = stepper(scene, positions)
    for _ in range(3):
        state = moving.step()
        if len(state) > 1:
            assert least_gap(state.positions) > -1e-5
        if scene.surfaces:
            assert state.positions[:, 2].min() > 1.0 - 1e-5
        assert np.abs(state.velocities).max() < 1e-9
        assert np.abs(state.angular_velocities).max() < 1e-9


def test_a_crowded_start_in_a_box_comes_apart():
    positions = np.random.default_rng(0).uniform(-1.5, 1.5, (8, 3)) + [0, 0, 1]
    moving = stepper(Scene(surfaces=Plane.box(8, 8)), positions)
    for _ in range(15):
        state = moving.step()
    assert least_gap(state.positions) > -0.1
    assert state.positions[:, 2].min() > 0.9


def test_rounding_does_not_change_how_overlaps_are_undone():
    ends = []
    for height in (1.0, np.nextafter(1.0, 0.0)):
        positions = np.array([[0.0, 0, height], [0.0, 0, 2.999]])
        still, scene = np.zeros((2, 3)), Scene()
        found = find_candidates(positions, still, np.ones(2), scene.surfaces, GRAVITY, 0.1)
        world, p, v = World.of(scene, 2), torch.from_numpy(positions), torch.from_numpy(still)
        ends.append(push_out(world, p, find_contacts(world, p, v, found, 0.0, 0.0)).numpy())
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)
