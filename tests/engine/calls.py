# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""Ways into compiled functions that Python itself must not call."""

from __future__ import annotations

import numba
import numpy as np
from rigid_gns_core.engine.broad_phase import find_candidates
from rigid_gns_core.engine.contact_law import law_of, target_of
from rigid_gns_core.engine.contacts import find_contacts, gap_of
from rigid_gns_core.engine.flight import Paths
from rigid_gns_core.engine.guard import limit_energy
from rigid_gns_core.engine.impulses import no_impulses
from rigid_gns_core.engine.islands import connect, groups_of, no_islands
from rigid_gns_core.engine.overlap import push_out
from rigid_gns_core.engine.sleep import put_to_sleep, wake
from rigid_gns_core.engine.solver import solve
from rigid_gns_core.engine.spheres import copy_spheres
from rigid_gns_core.engine.step import _bodies, Motion
from rigid_gns_core.engine.warm_start import impulses_of, with_sleepers

njit = numba.njit(error_model='numpy')


@njit
def candidates(world, positions, velocities, dt, awake):
    """See `find_candidates`."""
    return find_candidates(world, positions, velocities, dt, awake)


@njit
def contacts(world, positions, velocities, dt, h, lookback):
    """Contacts among all candidates of a frame; see `find_contacts`."""
    everyone = np.ones(len(positions), np.bool_)
    found = find_candidates(world, positions, velocities, dt, everyone)
    chosen = np.ones(len(found.a), np.bool_)
    return find_contacts(
        world, Paths(positions, velocities, world.pull), found, chosen, h, lookback
    )


@njit
def gaps(world, positions, found):
    """Gap of each contact where the spheres are now, shape (c,)."""
    values = np.empty(len(found.a))
    for k in range(len(values)):
        values[k], _ = gap_of(world, positions, found, k)
    return values


@njit
def law(world, found):
    """See `law_of`."""
    return law_of(world, found)


@njit
def target(e, h, time, gap, approach_speed, acceleration, coupling):
    """See `target_of`."""
    return target_of(e, e, 1.0, h, time, gap, approach_speed, acceleration, coupling)


@njit
def solved(world, positions, velocities, spins, dt, h, iterations):
    """Contacts of a substep, their law, impulses and bodies, from a cold start."""
    everyone = np.ones(len(positions), np.bool_)
    around = find_candidates(world, positions, velocities, dt, everyone)
    chosen = np.ones(len(around.a), np.bool_)
    found = find_contacts(world, Paths(positions, velocities, world.pull), around, chosen, h, h)
    coefficients = law_of(world, found)
    motion = Motion(positions, velocities, spins, everyone)
    bodies = _bodies(motion, world.pull, h)
    start, impulses = no_impulses(len(found.a)), no_impulses(len(found.a))
    group = np.arange(len(found.a))
    change = solve(
        world=world,
        contacts=found,
        law=coefficients,
        group=group,
        start=start,
        lasting=start,
        accelerations=world.pull,
        h=h,
        nominal_h=h,
        iterations=iterations,
        tolerance=0.0,
        shared=True,
        bodies_out=bodies,
        impulses_out=impulses,
    )
    return found, coefficients, impulses, bodies, change


@njit
def islands(count, a, b):
    """Islands of contacts of spheres a and b; b -1: with a surface."""
    made = no_islands(count)
    for k in range(len(a)):
        connect(made, a[k], b[k])
    return made


@njit
def groups(made):
    """See `groups_of`."""
    return groups_of(made)


@njit
def limited(world, before, after, made, dt):
    """State that the guard leaves, islands it slowed, and the energy that it took."""
    held = copy_spheres(after)
    acted, removed = limit_energy(world, before, made, dt, held)
    return held, acted, removed


@njit
def pushed_out(world, positions, velocities, dt):
    """Positions after overlaps were undone, and gaps of the contacts there."""
    everyone = np.ones(len(positions), np.bool_)
    around = find_candidates(world, positions, velocities, dt, everyone)
    chosen = np.ones(len(around.a), np.bool_)
    found = find_contacts(
        world, Paths(positions, velocities, world.pull), around, chosen, 0.0, 0.0
    )
    moved = positions.copy()
    push_out(world, found, moved)
    return moved


@njit
def woken(world, positions, velocities, dt, sleepers):
    """Who is awake in the frame to come; sleepers are changed."""
    _, awake = wake(world, positions, velocities, dt, sleepers)
    return awake


@njit
def rested(radius, made, dt, spheres, sleepers):
    """Put to sleep what has been quiet; spheres and sleepers are changed."""
    put_to_sleep(radius, made, dt, spheres, sleepers)


@njit
def warm(warm_start, key):
    """See `impulses_of`."""
    return impulses_of(warm_start, key)


@njit
def slept(new, old, awake, planes):
    """See `with_sleepers`."""
    return with_sleepers(new, old, awake, planes)
