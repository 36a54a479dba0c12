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

"""The steps of a round: normal impulses, rolling friction, friction."""

from __future__ import annotations

from .contacts import Contacts
from .impulses import Bodies, Impulses, push, slip_now, spin
from .law import Law
from .rounds import Rounds
from .world import World
from ..kernels.jit import in_place
from ..kernels.vector import across, add_to, clip, cross, dot, length, minus, plus, put, row, times


@in_place
def press(world: World, c: Contacts, bodies: Bodies, made: Impulses, r: Rounds) -> None:
    """Set normal impulses."""
    for q, k in enumerate(r.group):
        a, b, old = c.a[k], c.b[k], made.normal[k]
        split = bodies.load[a] * world.inverse_mass[a] + bodies.load[b] * world.inverse_mass[b]
        more = r.momentum[q] * (old - r.last_normal[q]) + r.lacking[q] / split
        r.last_normal[q] = old
        made.normal[k] = max(old + more, 0.0) if r.pressing[q] else 0.0
    for q, k in enumerate(r.group):
        push(world, c, bodies, k, times(made.normal[k] - r.last_normal[q], row(c.normal, k)))


@in_place
def _stiffness(world: World, c: Contacts, law: Law, bodies: Bodies, k: int) -> float:
    """Inverse of the tangential impulse that a unit of slip calls for."""
    a, b = c.a[k], c.b[k]
    one = bodies.load[a] * (world.inverse_mass[a] + law.spin_a[k])
    return one + bodies.load[b] * (world.inverse_mass[b] + law.spin_b[k])


@in_place
def resist_rolling(
    world: World, c: Contacts, law: Law, bodies: Bodies, made: Impulses, r: Rounds
) -> None:
    """Torque of rolling friction: at most rho r N, and no more than stops the rolling.

    Where the contact sticks, what rolls is the angular momentum about the contact point, which
    friction does not change; where it slips, that about the centre.
    """
    for q, k in enumerate(r.group):
        put(r.step, q, (0.0, 0.0, 0.0))
        if law.rolling[k] == 0:
            continue
        a, normal, old = c.a[k], row(c.normal, k), row(made.rolling, k)
        stiffness = _stiffness(world, c, law, bodies, k)
        slip = minus(slip_now(c, law, bodies, k), row(r.drag, q))
        wanted = minus(row(made.tangential, k), times(1.0 / stiffness, slip))
        spinning = plus(row(bodies.spin, a), row(bodies.turn, a))
        about = times(1.0 / world.inverse_inertia[a], spinning)
        flat = across(about, normal)
        rolls = flat
        if length(wanted) <= law.friction[k] * made.normal[k]:
            moving = plus(row(bodies.velocity, a), row(bodies.change, a))
            orbit = cross(normal, across(moving, normal))
            rolls = across(plus(about, times(law.arm_a[k] / world.inverse_mass[a], orbit)), normal)
        resist = minus(old, times(1.0 / bodies.load[a], plus(rolls, minus(about, flat))))
        most = law.rolling[k] * made.normal[k]
        twist = min(max(dot(resist, normal), -most), most)
        resist = plus(clip(across(resist, normal), most), times(twist, normal))
        put(made.rolling, k, resist)
        put(r.step, q, minus(resist, old))
    for q, k in enumerate(r.group):
        a = c.a[k]
        add_to(bodies.turn, a, times(world.inverse_inertia[a], row(r.step, q)))


@in_place
def resist_slip(
    world: World, c: Contacts, law: Law, bodies: Bodies, made: Impulses, r: Rounds
) -> None:
    """Friction: it stops slip, as far as the cone allows."""
    for q, k in enumerate(r.group):
        old = row(made.tangential, k)
        stiffness = _stiffness(world, c, law, bodies, k)
        more = times(r.momentum[q], minus(old, row(r.last_tangential, q)))
        slip = minus(slip_now(c, law, bodies, k), row(r.drag, q))
        wanted = plus(old, minus(more, times(1.0 / stiffness, slip)))
        new = clip(wanted, law.friction[k] * made.normal[k])
        put(r.last_tangential, q, old)
        put(made.tangential, k, new)
        put(r.step, q, minus(new, old))
    for q, k in enumerate(r.group):
        push(world, c, bodies, k, row(r.step, q))
        spin(world, c, law, bodies, k, row(r.step, q))
