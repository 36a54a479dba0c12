# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""Ways into compiled functions that Python itself must not call."""

from __future__ import annotations

import numba
import numpy as np
from rigid_gns_core.engine.broad_phase import find_candidates
from rigid_gns_core.engine.contact_law import find_law, new_law, target_of
from rigid_gns_core.engine.contacts import Contacts, find_impacts
from rigid_gns_core.engine.flight import fly, Paths
from rigid_gns_core.engine.free_groups import without_free_groups
from rigid_gns_core.engine.groups import contacts_by_island, find_islands, sort_contacts
from rigid_gns_core.engine.guard import limit_energy
from rigid_gns_core.engine.impulses import no_impulses
from rigid_gns_core.engine.islands import connect, groups_of, no_islands
from rigid_gns_core.engine.motion import Motion
from rigid_gns_core.engine.overlap import gap_of, push_out
from rigid_gns_core.engine.sleep import put_to_sleep, wake
from rigid_gns_core.engine.solver import solve, solve_isolated
from rigid_gns_core.engine.spheres import copy_spheres
from rigid_gns_core.engine.step import _free_motion
from rigid_gns_core.engine.warm_start import impulses_of, with_sleepers
from rigid_gns_core.engine.workspace import new_workspace

njit = numba.njit(error_model='numpy')


@njit
def candidates(world, positions, velocities, dt, awake):
    """See `find_candidates`."""
    return find_candidates(world, positions, velocities, dt, awake, 0.0)


@njit
def candidates_that_may_touch(world, spheres, dt, near):
    """Those of `candidates` that `without_free_groups` keeps, and the state if all fly."""
    everyone = np.ones(len(spheres.positions), np.bool_)
    after = copy_spheres(spheres)
    fly(world, spheres, ~everyone, everyone, dt, after)
    found = find_candidates(world, spheres.positions, spheres.velocities, dt, everyone, 0.0)
    return without_free_groups(world, found, spheres, after, everyone, dt, near), after


@njit
def taken(found, size):
    """The first contacts of a workspace, in arrays of their own."""
    return Contacts(
        candidate=found.candidate[:size].copy(),
        a=found.a[:size].copy(),
        b=found.b[:size].copy(),
        plane=found.plane[:size].copy(),
        normal=found.normal[:size].copy(),
        time=found.time[:size].copy(),
        gap=found.gap[:size].copy(),
        speculative_gap=found.speculative_gap[:size].copy(),
        approach_speed=found.approach_speed[:size].copy(),
        acceleration=found.acceleration[:size].copy(),
        turning_speed=found.turning_speed[:size].copy(),
        crossing_time=found.crossing_time[:size].copy(),
        rest_gap=found.rest_gap[:size].copy(),
    )


@njit
def narrow_phase(world, positions, velocities, dt, h, lookback):
    """Workspace with the contacts among all candidates of a frame, and how many there are."""
    everyone = np.ones(len(positions), np.bool_)
    around = find_candidates(world, positions, velocities, dt, everyone, 0.0)
    work = new_workspace(len(positions), 1, around)
    paths = Paths(positions, velocities, world.flight)
    find_impacts(world, paths, around, work.every_pair, work.every, h, lookback, work.impacts)
    size, islands = contacts_by_island(
        around, work.everyone, work.every_pair, work.impacts, work.order, work.contacts
    )
    return work, size, islands


@njit
def contacts(world, positions, velocities, dt, h, lookback):
    """Contacts among all candidates of a frame."""
    work, size, _ = narrow_phase(world, positions, velocities, dt, h, lookback)
    return taken(work.contacts, size)


@njit
def contacts_without(world, positions, velocities, dt, h, island):
    """The same without those of an island of several (0: with all), and where islands begin."""
    everyone = np.ones(len(positions), np.bool_)
    around = find_candidates(world, positions, velocities, dt, everyone, 0.0)
    work = new_workspace(len(positions), 1, around)
    paths = Paths(positions, velocities, world.flight)
    find_impacts(world, paths, around, work.every_pair, work.every, h, h, work.impacts)
    order = work.order
    size, count = find_islands(around, work.everyone, work.every_pair, work.impacts, order)
    for c in range(size):
        if island > 0 and order.label[c] == island:
            order.label[c] = -1
    size = sort_contacts(around, work.impacts, size, count, order, work.contacts)
    return taken(work.contacts, size), order.begin.copy()


@njit
def gaps(world, positions, found):
    """Gap of each contact where the spheres are now, shape (c,)."""
    values = np.empty(len(found.a))
    for k in range(len(values)):
        values[k], _ = gap_of(world, positions, found, k)
    return values


@njit
def law(world, found):
    """See `find_law`."""
    coefficients = new_law(len(found.a))
    find_law(world, found, coefficients)
    return coefficients


@njit
def target(e, h, time, gap, approach_speed, acceleration, coupling):
    """See `target_of`."""
    return target_of(e, e, 1.0, h, time, gap, approach_speed, acceleration, coupling)


@njit
def solved(world, positions, velocities, spins, dt, h, iterations):
    """Contacts of a substep, their law, impulses and bodies, from a cold start."""
    work, size, islands = narrow_phase(world, positions, velocities, dt, h, h)
    found = taken(work.contacts, size)
    coefficients, begin = law(world, found), work.order.begin
    motion = Motion(
        positions, velocities, spins, np.ones(len(positions), np.bool_), np.zeros(len(positions))
    )
    _free_motion(motion, world.flight, work.everyone, h, work.bodies)
    start, impulses, change = no_impulses(size), no_impulses(size), 0.0
    solve_isolated(
        world, found, coefficients, begin[1], world.flight, h, h, work.state, work.bodies, impulses
    )
    for island in range(1, islands + 1):
        last = solve(
            world=world,
            contacts=found,
            law=coefficients,
            start=start,
            first=begin[island],
            last=begin[island + 1],
            accelerations=world.flight,
            h=h,
            nominal_h=h,
            iterations=iterations,
            couplings_out=work.couplings,
            pivots_out=work.pivots,
            blocks_out=work.blocks,
            state_out=work.state,
            bodies_out=work.bodies,
            impulses_out=impulses,
        )
        change = max(change, last)
    return found, coefficients, impulses, work.bodies, change


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
    work, size, _ = narrow_phase(world, positions, velocities, dt, 0.0, 0.0)
    moved = positions.copy()
    push_out(world, taken(work.contacts, size), work.overlaps, moved, no_islands(len(positions)))
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
