# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""How contacts couple at a body, beside blocks of the mass matrix in NumPy."""

import numba
import numpy as np
import pytest
from rigid_gns_core import Plane, Scene
from rigid_gns_core.engine.couplings import find_couplings, new_couplings, split_bodies
from rigid_gns_core.engine.world import world_of

from . import calls


@numba.njit(error_model='numpy')
def splits(world, contacts, law):
    size = len(contacts.a)
    couplings = new_couplings(len(world.radius))
    find_couplings(world, contacts, law, couplings)
    normal, friction, rolling = np.empty((size, 2)), np.empty((size, 2)), np.empty(size)
    split_bodies(couplings, law, np.ones((size, 2)), normal, friction, rolling)
    return normal, friction


def cluster(seed):
    """Spheres that touch a floor, a wall and each other; world, contacts and law."""
    rng = np.random.default_rng(seed)
    radius, mass = rng.uniform(0.5, 1.0, 6), rng.uniform(0.2, 5.0, 6)
    positions = np.c_[rng.uniform(-1.2, 1.2, (6, 2)), rng.uniform(0.4, 2.0, 6)]
    scene = Scene(
        surfaces=(Plane(), Plane(point=(-1.5, 0, 0), normal=(1.0, 0, 0))),
        radius=tuple(radius),
        mass=tuple(mass),
        friction=0.5,
    )
    world = world_of(scene, 6)
    contacts = calls.contacts(world, positions, np.zeros((6, 3)), 0.1, 0.01, 0.01)
    return world, contacts, calls.law(world, contacts)


def jacobian(world, contacts, law, k, across):
    """Velocities of all bodies by unit impulses at contact k, shape (1 or 2, 6 n)."""
    count, normal = len(world.restitution), contacts.normal[k]
    rows = np.zeros((2 if across else 1, 2 * count, 3))
    basis = np.linalg.svd(normal[None])[2][1:] if across else normal[None]
    for body, arm, sign in (
        (contacts.a[k], law.arm_a[k], 1.0),
        (contacts.b[k], law.arm_b[k], -1.0),
    ):
        if body < count:
            for row, way in zip(rows, basis, strict=True):
                row[body] = sign * way
                row[count + body] = -arm * np.cross(normal, way)
    return rows.reshape(len(rows), -1)


@pytest.mark.parametrize('seed', range(6))
def test_steps_of_all_contacts_at_once_do_not_overshoot(seed):
    world, contacts, law = cluster(seed)
    size = len(contacts.a)
    assert size > 4
    normal, friction = splits(world, contacts, law)
    inverse = np.repeat(np.r_[world.inverse_mass[:-1], world.inverse_inertia[:-1]], 3)
    mass = world.inverse_mass
    own = np.c_[mass[contacts.a], mass[contacts.b]]
    turning = np.c_[law.rotation_a, law.rotation_b]
    for split, across, each in ((normal, False, own), (friction, True, own + turning)):
        rows = np.concatenate([jacobian(world, contacts, law, k, across) for k in range(size)])
        matrix = rows @ (inverse[:, None] * rows.T)
        diagonal = np.repeat((split * each).sum(axis=1), 2 if across else 1)
        # D - A has no negative eigenvalue, so that a step of D^-1 never passes the solution
        assert np.linalg.eigvalsh(np.diag(diagonal) - matrix).min() > -1e-9


def test_contacts_at_right_angles_do_not_split_a_body():
    scene = Scene(surfaces=(Plane(), Plane(normal=(1.0, 0, 0))), radius=1.0, friction=0.5)
    world = world_of(scene, 1)
    contacts = calls.contacts(world, np.array([[1.0, 0, 1.0]]), np.zeros((1, 3)), 0.1, 0.01, 0.01)
    normal, friction = splits(world, contacts, calls.law(world, contacts))
    assert normal[:, 0] == pytest.approx(1.0)
    # friction: |c / m + r^2 / I| over 1 / m + r^2 / I, with c = 0
    assert friction[:, 0] == pytest.approx(1.0 + 2.5 / 3.5)
