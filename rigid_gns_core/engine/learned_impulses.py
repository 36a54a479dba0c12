# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a residual network does to the bodies of a contact: bounded, equal and opposite.

With the outputs y of a contact, its scale S, normal n and slip t, and r the mean radius of its
bodies (the radius, on a surface):

    p = S (tanh y0 n + tanh y1 t)               impulse at the contact point
    d = S dt (tanh y2 n + tanh y3 t)            displacement times mass, as of a later impulse
    l = S r (tanh y4 roll + tanh y5 spin n)     angular impulse

a gets p / m, d / m and (l - r_a n x p) / I, and b the opposite of p, d and l. The centre of mass
of two spheres stays, and so does their momentum; their angular momentum changes by the gap times
n x p and by d, which the energy guard gives back to an island off the surfaces.
"""

from __future__ import annotations

import math

import numpy as np

from .islands import connect, Islands
from .learned_contacts import LearnedContacts
from .learned_network import LearnedNetwork, outputs_of
from .shielding import offset_from_plane
from .spheres import Spheres
from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.vector import add_to, cross, length, plus, row, times, Vector
from ..scenes.state import Array

# largest displacement of a sphere in a frame [radii]
_FARTHEST = 0.2


@compiled
def correct(
    world: World,
    network: LearnedNetwork,
    contacts: LearnedContacts,
    dt: float,
    after_out: Spheres,
    islands_out: Islands,
) -> None:
    """Correct a frame of the laws.

    Args:
        world: What does not move.
        network: The weights.
        contacts: Those of the frame.
        dt: Length of the frame.
        after_out: State that the laws lead to; corrected in place.
        islands_out: Contacts are added.
    """
    count = len(after_out.positions)
    if len(contacts.a) == 0:
        return
    outputs = outputs_of(network, contacts, count)
    totals, ways = np.zeros(count), np.zeros((count, 3))
    for c in range(len(contacts.a)):
        a, b = contacts.a[c], contacts.b[c]
        size = dt * contacts.scale[c] * _far(outputs, c)
        totals[a] += world.inverse_mass[a] * size
        if b >= 0:
            totals[b] += world.inverse_mass[b] * size
    for c in range(len(contacts.a)):
        a, b = contacts.a[c], contacts.b[c]
        if contacts.scale[c] == 0:
            continue
        share = _share(world, totals, a)
        if b >= 0:
            share = min(share, _share(world, totals, b))
        _push(world, contacts, outputs, c, dt, share, after_out, ways)
        connect(islands_out, a, b)
    for i in range(count):
        way = row(ways, i)
        if length(way) > 0:
            if _is_free(world, i, row(after_out.positions, i), way):
                add_to(after_out.positions, i, way)
            else:
                connect(islands_out, i, -1)  # the surface holds it


@in_place
def _far(outputs: Array, c: int) -> float:
    """Length of the displacement of contact c, in units of the largest along n or t."""
    return math.hypot(math.tanh(outputs[c, 2]), math.tanh(outputs[c, 3]))


@in_place
def _share(world: World, totals: Array, i: int) -> float:
    """Share of its displacements that takes sphere i as far as it may go, or 1."""
    return min(1.0, _FARTHEST * world.radius[i] / max(totals[i], 1e-300))


@in_place
def _push(
    world: World,
    contacts: LearnedContacts,
    outputs: Array,
    c: int,
    dt: float,
    share: float,
    after_out: Spheres,
    ways_out: Array,
) -> None:
    """Impulses of contact c; a share of its displacements is added to `ways_out`."""
    a, b, scale = contacts.a[c], contacts.b[c], contacts.scale[c]
    radius = world.radius[a] if b < 0 else 0.5 * (world.radius[a] + world.radius[b])
    n, t = row(contacts.normal, c), row(contacts.slip, c)
    impulse = times(scale * math.tanh(outputs[c, 0]), n)
    impulse = plus(impulse, times(scale * math.tanh(outputs[c, 1]), t))
    way = times(share * scale * dt * math.tanh(outputs[c, 2]), n)
    way = plus(way, times(share * scale * dt * math.tanh(outputs[c, 3]), t))
    turn = times(scale * radius * math.tanh(outputs[c, 4]), row(contacts.roll, c))
    turn = plus(turn, times(scale * radius * math.tanh(outputs[c, 5]) * contacts.spin[c], n))
    _move(world, a, 1.0, n, impulse, way, turn, after_out, ways_out)
    if b >= 0:
        _move(world, b, -1.0, n, impulse, way, turn, after_out, ways_out)


@in_place
def _move(
    world: World,
    i: int,
    sign: float,
    normal: Vector,
    impulse: Vector,
    way: Vector,
    turn: Vector,
    after_out: Spheres,
    ways_out: Array,
) -> None:
    inverse, leverage = world.inverse_mass[i], world.radius[i] * world.inverse_inertia[i]
    add_to(after_out.velocities, i, times(sign * inverse, impulse))
    add_to(ways_out, i, times(sign * inverse, way))
    add_to(after_out.angular_velocities, i, times(-leverage, cross(normal, impulse)))
    add_to(after_out.angular_velocities, i, times(sign * world.inverse_inertia[i], turn))


@in_place
def _is_free(world: World, i: int, place: Vector, way: Vector) -> bool:
    """Whether a displacement leads a sphere through no surface, and not deep into one.

    Soft contacts overlap; up to `_FARTHEST` that is left to the next frame of the laws.
    """
    there = plus(place, way)
    for plane in range(len(world.point)):
        offset = offset_from_plane(world, plane, place)
        moved = offset_from_plane(world, plane, there)
        deepest = min(length(offset), (1.0 - _FARTHEST) * world.radius[i])
        behind = offset[2] < 0 and not world.two_sided[plane]
        crosses = offset[2] * moved[2] < 0
        if length(moved) < deepest or crosses or (behind and moved[2] < offset[2]):
            return False
    return True
