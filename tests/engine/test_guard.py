# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""The energy guard, beside energies and momenta in NumPy."""

import numpy as np
import pytest
from rigid_gns_core import load_simulator, Plane, Scene
from rigid_gns_core.closed_form import laws
from rigid_gns_core.engine.spheres import Spheres
from rigid_gns_core.engine.world import world_of
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from . import calls

DT = 0.1
FALL = np.array([0.0, 0.0, -9.81])


def spheres(positions, velocities, spins):
    quaternions = np.tile([0.0, 0, 0, 1], (len(positions), 1))
    return Spheres(
        positions=positions,
        quaternions=quaternions,
        velocities=velocities,
        angular_velocities=spins,
    )


def energy(state, members, mass, radius, gravity):
    return laws.energy(
        state.positions[members],
        state.velocities[members],
        state.angular_velocities[members],
        mass[members],
        radius[members],
        np.asarray(gravity),
    )


def momenta(state, members, mass, radius):
    """Linear momentum, and angular momentum about the centre of mass."""
    x, m = state.positions[members], mass[members]
    linear, angular = laws.momenta(
        x, state.velocities[members], state.angular_velocities[members], m, radius[members]
    )
    return linear, angular - np.cross(m @ x / m.sum(), linear)


def drawn(seed, count=24, gravity=(0.0, 0.0, -9.81)):
    """Two states of islands, and what is known of them."""
    rng = np.random.default_rng(seed)
    mass, radius = rng.uniform(0.5, 2, count), rng.uniform(0.5, 1, count)
    scene = Scene(surfaces=(), gravity=gravity, mass=tuple(mass), radius=tuple(radius))
    before = spheres(*(rng.normal(size=(count, 3)) * k for k in (3.0, 2.0, 2.0)))
    after = spheres(
        before.positions + 0.01 * rng.normal(size=(count, 3)),
        before.velocities * rng.uniform(0.6, 1.3, (count, 1)) + 0.2 * rng.normal(size=(count, 3)),
        before.angular_velocities * rng.uniform(0.6, 1.3, (count, 1)),
    )
    one, other = rng.integers(0, count, (2, count // 2))
    other[::3] = -1
    keep = one != other
    one, other = one[keep], other[keep]
    free = other >= 0
    graph = coo_array((np.ones(free.sum()), (one[free], other[free])), shape=(count, count))
    _, label = connected_components(graph, directed=False)
    touched = np.union1d(one, other[free])
    parts = [np.intersect1d(np.flatnonzero(label == k), touched) for k in range(label.max() + 1)]
    grounded = [bool(np.isin(part, one[~free]).any()) for part in parts]
    islands = [(p, g) for p, g in zip(parts, grounded, strict=True) if len(p)]
    for members, is_grounded in islands:
        if not is_grounded:  # whatever happens in it, its centre of mass flies its parabola
            m, was = mass[members], before.velocities[members]
            way = DT * (m @ was) / m.sum() + 0.5 * DT**2 * np.asarray(gravity)
            moved = m @ (after.positions - before.positions)[members] / m.sum()
            after.positions[members] += way - moved
    alone = np.setdiff1d(np.arange(count), touched)
    made = calls.islands(count, one, other)
    return scene, mass, radius, before, after, made, islands, alone


@pytest.mark.parametrize('seed', range(8))
@pytest.mark.parametrize('gravity', [(0.0, 0.0, 0.0), (0.0, 0.0, -9.81)])
def test_no_island_gains_energy_and_free_ones_keep_momenta(seed, gravity):
    scene, mass, radius, before, after, made, islands, alone = drawn(seed, gravity=gravity)
    held, acted, removed = calls.limited(world_of(scene, len(mass)), before, after, made, DT)
    taken, slowed = 0.0, 0
    for members, grounded in islands:
        old, new, end = (energy(s, members, mass, radius, gravity) for s in (before, after, held))
        assert end <= old + 1e-11 * (abs(old) + 1.0)
        if grounded:
            if new > old:  # all speeds by one factor, and no more than has to be
                slowed, taken = slowed + 1, taken + new - old
                moving = energy(after, members, mass, radius, (0.0, 0.0, 0.0))
                factor = np.sqrt(max(0.0, 1.0 - (new - old) / moving))
                np.testing.assert_allclose(
                    held.velocities[members], factor * after.velocities[members], rtol=1e-9
                )
                if new - old <= moving:
                    assert end == pytest.approx(old, rel=1e-9)
            else:
                np.testing.assert_array_equal(held.velocities[members], after.velocities[members])
            continue
        # in the air: what gravity gives, and no more
        linear, angular = momenta(before, members, mass, radius)
        linear = linear + DT * np.asarray(gravity) * mass[members].sum()
        now = momenta(held, members, mass, radius)
        np.testing.assert_allclose(now[0], linear, atol=1e-11)
        np.testing.assert_allclose(now[1], angular, atol=1e-11)
        np.testing.assert_array_equal(held.positions[members], after.positions[members])
    assert acted >= slowed
    assert removed >= taken - 1e-9
    for name in ('positions', 'velocities', 'angular_velocities'):  # no contact, no guard
        values = getattr(held, name)[alone]
        np.testing.assert_array_equal(values, getattr(after, name)[alone])


def test_guard_lets_losses_alone():
    scene, mass, _, before, _, made, islands, _ = drawn(0, gravity=(0.0, 0.0, 0.0))
    slower = before._replace(
        velocities=0.9 * before.velocities, angular_velocities=0.9 * before.angular_velocities
    )
    grounded = np.concatenate([part for part, is_grounded in islands if is_grounded])
    held, _, _ = calls.limited(world_of(scene, len(mass)), before, slower, made, DT)
    np.testing.assert_array_equal(held.velocities[grounded], slower.velocities[grounded])


def test_an_island_that_was_lifted_stays_where_it_was():
    scene = Scene(gravity=(0.0, 0.0, -9.81))
    start = np.array([[0.0, 0, 1], [2.0, 0, 1]])
    before = spheres(start, np.zeros((2, 3)), np.zeros((2, 3)))
    lifted = spheres(start + [0, 0, 0.1], np.full((2, 3), 0.01), np.zeros((2, 3)))
    made = calls.islands(2, np.array([0, 0]), np.array([1, -1]))
    held, acted, removed = calls.limited(world_of(scene, 2), before, lifted, made, DT)
    np.testing.assert_array_equal(held.positions, start)
    np.testing.assert_array_equal(held.velocities, np.zeros((2, 3)))
    assert acted == 1
    assert removed == pytest.approx(2 * 9.81 * 0.1 + 3 * 0.01**2)


def violent():
    """Twenty elastic spheres in a tight box, and how they go."""
    rng = np.random.default_rng(3)
    grid = np.stack(np.meshgrid(*[np.arange(3)] * 3), -1).reshape(-1, 3)[:20]
    scene = Scene(surfaces=Plane.box(7, 7, 7), restitution=1.0, friction=0.0)
    velocities, spins = 12.0 * rng.normal(size=(20, 3)), 3.0 * rng.normal(size=(20, 3))
    return scene, 2.2 * grid - [2.2, 2.2, -1.2], velocities, spins


@pytest.mark.parametrize('size', [(1, 1), (2, 3), (8, 4)])
def test_energy_never_rises_however_coarsely_it_is_solved(size):
    substeps, rounds = size
    simulator = load_simulator(substeps=substeps, rounds=rounds)
    scene, *start = violent()
    t = simulator.rollout(scene, *start, steps=40)
    energies = laws.energy(
        t.positions, t.velocities, t.angular_velocities, np.ones(20), np.ones(20), FALL
    )
    assert np.diff(energies).max() < 1e-11 * energies[0]


def test_without_the_guard_energy_may_rise():
    scene, *start = violent()
    stepper = load_simulator(substeps=1, rounds=1, guard=False).start(scene, *start).stepper
    t = load_simulator(substeps=1, rounds=1, guard=False).rollout(scene, *start, steps=40)
    energies = laws.energy(
        t.positions, t.velocities, t.angular_velocities, np.ones(20), np.ones(20), FALL
    )
    assert np.diff(energies).max() > 1e-3 * energies[0]
    stepper.step()
    assert stepper.acted == 0


def test_the_guard_tells_how_often_it_acted():
    scene, *start = violent()
    stepper = load_simulator(substeps=1, rounds=1).start(scene, *start).stepper
    for _ in range(20):
        stepper.step()
    assert stepper.frames == 20 and stepper.acted > 0 and stepper.removed > 0
