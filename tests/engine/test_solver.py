# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the solver converges to, beside Gauss' principle; and what holds after any iteration."""

import numpy as np
import pytest
from rigid_gns_core import Scene
from rigid_gns_core.engine.world import world_of
from scipy.optimize import nnls

from . import calls

H = 0.0125
FALL = np.array([0.0, 0.0, -9.81])


def heap(seed, layers=3):
    """Spheres that touch those around, on a floor, with small velocities."""
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(np.arange(3), np.arange(2), np.arange(layers)), -1).reshape(-1, 3)
    positions = 2.0 * grid + [0, 0, 1.0]
    velocities = 0.3 * rng.normal(size=positions.shape)
    return positions, velocities, rng.uniform(0.5, 3.0, len(positions))


def solve(scene, positions, velocities, iterations, spins=None, h=H):
    spins = np.zeros_like(positions) if spins is None else spins
    world = world_of(scene, len(positions))
    return calls.solved(world, positions, velocities, spins, 0.1, h, iterations)


def jacobian(contacts, count):
    """Rows that make separation velocities of all velocities, shape (c, 3 n)."""
    rows = np.zeros((len(contacts.a), count + 1, 3))
    each = np.arange(len(contacts.a))
    rows[each, contacts.a] += contacts.normal
    rows[each, contacts.b] -= contacts.normal
    return rows[:, :count].reshape(len(rows), -1)


@pytest.mark.parametrize('seed', range(4))
def test_perfectly_plastic_contacts_obey_gauss_principle(seed):
    # of all velocities that do not approach, those nearest to the free ones, weighed by mass:
    # a quadratic program, whose dual is a non-negative least squares
    positions, velocities, mass = heap(seed)
    short = 1e-6  # in a longer step, spheres that part are still in the air at its end
    count = len(positions)
    scene = Scene(restitution=0.0, friction=0.0, rolling_friction=0.0, mass=tuple(mass))
    contacts, _, impulses, bodies, change = solve(scene, positions, velocities, 4000, h=short)
    assert change < 1e-9
    rows, root = jacobian(contacts, count), np.sqrt(np.repeat(mass, 3))
    free = (velocities + short * FALL).ravel()
    dual, _ = nnls((rows / root).T, -root * free, maxiter=10_000)
    expected = free + rows.T @ dual / np.repeat(mass, 3)
    found = bodies.velocity[:count].ravel()
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=9.81 * short)
    # complementarity: pushes or parts, never both
    separation = rows @ found
    assert separation.min() > -9.81 * short
    assert (impulses.normal * separation).max() < 1e-8
    assert (impulses.normal > 1e-3).sum() > 5


@pytest.mark.parametrize('seed', range(3))
@pytest.mark.parametrize('iterations', [1, 4, 30])
def test_bodies_move_by_the_impulses_of_their_contacts(seed, iterations):
    positions, velocities, mass = heap(seed)
    count = len(positions)
    scene = Scene(restitution=0.6, friction=0.9, rolling_friction=0.04, mass=tuple(mass))
    spins = 2.0 * np.random.default_rng(seed + 10).normal(size=(count, 3))
    contacts, law, impulses, bodies, _ = solve(scene, positions, velocities, iterations, spins)
    linear, angular = np.zeros((count + 1, 3)), np.zeros((count + 1, 3))
    whole = impulses.normal[:, None] * contacts.normal + impulses.tangential
    for k, (a, b) in enumerate(zip(contacts.a, contacts.b, strict=True)):
        linear[a] += whole[k]
        linear[b] -= whole[k]
        torque = np.cross(-contacts.normal[k], impulses.tangential[k])
        angular[a] += law.arm_a[k] * torque + impulses.rolling[k]
        angular[b] += law.arm_b[k] * torque
    np.testing.assert_allclose(
        (bodies.velocity - bodies.free_velocity)[:count],
        linear[:count] / mass[:, None],
        atol=1e-12,
    )
    np.testing.assert_allclose(
        (bodies.angular_velocity - bodies.free_angular_velocity)[:count],
        angular[:count] / (0.4 * mass)[:, None],
        atol=1e-12,
    )


@pytest.mark.parametrize('seed', range(3))
@pytest.mark.parametrize('iterations', [1, 4, 30])
def test_no_impulse_is_beyond_its_law(seed, iterations):
    positions, velocities, mass = heap(seed)
    scene = Scene(restitution=0.6, friction=0.7, rolling_friction=0.04, mass=tuple(mass))
    spins = 2.0 * np.random.default_rng(seed + 10).normal(size=positions.shape)
    contacts, law, impulses, _, _ = solve(scene, positions, velocities, iterations, spins)
    assert (impulses.normal >= 0).all() and impulses.normal.max() > 0
    across = np.linalg.norm(impulses.tangential, axis=1)
    # Coulomb's cone, and the torque of rolling friction, up to rounding
    assert (across <= law.friction * impulses.normal * (1 + 1e-12)).all()
    rolling = (
        impulses.rolling
        - np.sum(impulses.rolling * contacts.normal, axis=1, keepdims=True) * contacts.normal
    )
    limit = law.rolling * impulses.normal * (1 + 1e-12)
    assert (np.linalg.norm(rolling, axis=1) <= limit).all()
    assert (np.abs(np.sum(impulses.rolling * contacts.normal, axis=1)) <= limit).all()
    assert np.abs(np.sum(impulses.tangential * contacts.normal, axis=1)).max() < 1e-12


def slips(contacts, law, bodies):
    """Tangential velocity of each contact, shape (c, 3)."""
    v, w = bodies.velocity, bodies.angular_velocity
    a, b, n = contacts.a, contacts.b, contacts.normal
    relative = v[a] - v[b]
    relative = relative - np.sum(relative * n, axis=1, keepdims=True) * n
    return relative - np.cross(law.arm_a[:, None] * w[a] + law.arm_b[:, None] * w[b], n)


@pytest.mark.parametrize('seed', range(3))
def test_friction_sticks_inside_its_cone_and_opposes_slip_on_it(seed):
    positions, velocities, mass = heap(seed)
    scene = Scene(restitution=0.0, friction=0.7, rolling_friction=0.0, mass=tuple(mass))
    contacts, law, impulses, bodies, change = solve(scene, positions, 3 * velocities, 4000)
    assert change < 1e-8
    slip, size = slips(contacts, law, bodies), np.linalg.norm(impulses.tangential, axis=1)
    limit = law.friction * impulses.normal
    pressed = impulses.normal > 1e-4
    sticks, slides = pressed & (size < 0.999 * limit), pressed & (size >= 0.999 * limit)
    assert sticks.sum() > 2 and slides.sum() > 2
    assert np.linalg.norm(slip[sticks], axis=1).max() < 1e-5
    moving = slides & (np.linalg.norm(slip, axis=1) > 1e-4)
    along = np.sum(impulses.tangential[moving] * slip[moving], axis=1)
    speed = np.linalg.norm(slip[moving], axis=1)
    np.testing.assert_allclose(along, -limit[moving] * speed, rtol=1e-3)


def test_one_iteration_is_exact_for_contacts_that_share_no_body():
    positions = np.array([[0.0, 0, 1], [10.0, 0, 1], [20.0, 0, 8], [22.0, 0, 8]])
    velocities = np.array([[1.0, 0, -2.0], [0, 3.0, -0.5], [1.0, 0.5, 0], [-1.0, 0, 0]])
    scene = Scene(restitution=0.9, friction=0.5, rolling_friction=0.01)
    one = solve(scene, positions, velocities, 1)
    many = solve(scene, positions, velocities, 50)
    assert len(one[0].a) == 3
    np.testing.assert_allclose(one[2].normal, many[2].normal, rtol=1e-13)
    np.testing.assert_allclose(one[2].tangential, many[2].tangential, atol=1e-13)


def test_a_stack_carries_its_weight():
    # N of each contact is the weight above it, times the length of the substep
    count = 6
    positions = np.c_[np.zeros((count, 2)), 1.0 + 2.0 * np.arange(count)]
    mass = np.linspace(1.0, 2.0, count)
    scene = Scene(restitution=0.0, mass=tuple(mass))
    contacts, _, impulses, bodies, _ = solve(scene, positions, np.zeros((count, 3)), 3000)
    above = 9.81 * H * np.cumsum(mass[::-1])[::-1]
    upper = np.where(contacts.plane >= 0, 0, np.maximum(contacts.a, contacts.b))
    np.testing.assert_allclose(impulses.normal, above[upper], rtol=1e-8)
    rest = bodies.velocity
    assert np.abs(rest[:count]).max() < 1e-8


def test_order_of_contacts_does_not_matter():
    positions, velocities, _ = heap(5)
    scene = Scene(restitution=0.5, friction=0.6)
    order = np.random.default_rng(0).permutation(len(positions))
    plain = solve(scene, positions, velocities, 12)[3]
    other = solve(scene, positions[order], velocities[order], 12)[3]
    count = len(positions)
    for name in ('velocity', 'angular_velocity', 'displacement'):
        np.testing.assert_allclose(
            getattr(other, name)[:count], getattr(plain, name)[:count][order], atol=1e-12
        )
