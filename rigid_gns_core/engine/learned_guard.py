# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Energy guard of soft contacts: what an overlap stores may come back, and no more.

A soft ball that is seen in the middle of a bounce has given its energy to the contact. With the
stiffness k that a network was trained with, per effective mass m, an overlap o stores at most
m k o^2 / 2. Each sphere has a store, which an island's loss of energy fills up to that, and which
is empty where nothing overlaps; an island may gain what its spheres have stored. So the sum of
kinetic and potential energy and of the stores never rises, whatever the weights. With k = 0 it is
the guard of the laws.
"""

from __future__ import annotations

import numpy as np

from .broad_phase import Candidates
from .guard import energy_of, limit_energy, limit_energy_beyond
from .islands import groups_of, Islands
from .learned_contacts import overlap_of
from .spheres import Spheres
from .world import World
from ..kernels.jit import compiled
from ..scenes.state import Array


@compiled
def limit_energy_of_soft(
    world: World,
    before: Spheres,
    islands: Islands,
    candidates: Candidates,
    stiffness: float,
    dt: float,
    stored_out: Array,
    after_out: Spheres,
) -> tuple[int, float]:
    """As `guard.limit_energy`; `stored_out` are the stores of the spheres, shape (n,)."""
    if stiffness <= 0:
        return limit_energy(world, before, islands, dt, after_out)
    stored, after = stored_out, after_out
    done = limit_energy_beyond(world, before, islands, dt, stored, after)
    most, groups = stores(world, after.positions, candidates, stiffness), groups_of(islands)
    held = stored.copy()
    stored[:] = 0.0
    for island in range(len(groups.grounded)):
        members = groups.members[groups.start[island] : groups.start[island + 1]]
        left, room = 0.0, 0.0
        for i in members:
            kinetic, potential = energy_of(world, after, i)
            kinetic_before, potential_before = energy_of(world, before, i)
            left += held[i] + islands.work[i]
            left += kinetic_before + potential_before - kinetic - potential
            room += most[i]
        if left > 0 and room > 0:
            share = min(1.0, left / room)
            for i in members:
                stored[i] = share * most[i]
    return done


@compiled
def stores(world: World, positions: Array, candidates: Candidates, stiffness: float) -> Array:
    """Most that the overlaps of each sphere store; half of one of two spheres is each one's."""
    most = np.zeros(len(positions))
    for c in range(len(candidates.a)):
        a, b = candidates.a[c], candidates.b[c]
        overlap = overlap_of(world, candidates, c, positions)
        mass = 1.0 / (world.inverse_mass[a] + world.inverse_mass[b])
        energy = 0.5 * mass * stiffness * overlap**2
        if candidates.plane[c] < 0:
            most[a] += 0.5 * energy
            most[b] += 0.5 * energy
        else:
            most[a] += energy
    return most
