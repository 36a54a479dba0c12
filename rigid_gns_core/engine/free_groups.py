# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Groups of spheres in which nothing can touch in a frame: they fly, without substeps.

Candidates hold whatever contacts do to spheres in a frame, so that they connect all that a blow
may lead to one another. In a group of spheres so connected the first blow is on a path of free
flight. Where no such path leads to a contact, there is no first one, and so none.
"""

from __future__ import annotations

import numpy as np

from .broad_phase import Candidates, linked_to
from .clearance import flies_clear_of_surface, fly_clear_of_each_other, margin_of_flight
from .spheres import Spheres
from .world import World
from ..kernels.jit import compiled
from ..kernels.neighbours import Flags
from ..kernels.vector import row


@compiled
def without_free_groups(
    world: World,
    candidates: Candidates,
    before: Spheres,
    after: Spheres,
    awake: Flags,
    dt: float,
    near: float,
) -> Candidates:
    """Candidates of the groups in which something may touch.

    Args:
        world: What does not move.
        candidates: Of all awake spheres.
        before: State at the start of the frame.
        after: State at its end if all fly.
        awake: Spheres that are awake, shape (n,).
        dt: Length of the frame.
        near: Gap within which bodies are speculative contacts.
    """
    count = len(before.positions)
    margin, meets = np.empty(count), np.zeros(count, np.bool_)
    for i in range(count):
        velocity, last = row(before.velocities, i), row(after.velocities, i)
        light, margin[i] = margin_of_flight(world, i, velocity, last, dt)
        margin[i] += near
        meets[i] = not light
    for k in range(len(candidates.a)):
        a, b, plane = candidates.a[k], candidates.b[k], candidates.plane[k]
        if meets[a]:
            continue
        if plane >= 0:
            meets[a] = not flies_clear_of_surface(world, plane, before, after, a, margin[a], dt)
        elif not meets[b]:
            meets[a] = not fly_clear_of_each_other(before, after, a, b, margin[a] + margin[b])
    found, _ = linked_to(candidates, meets, ~awake)
    return found
