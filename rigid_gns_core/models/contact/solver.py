"""Impulses of all contacts of a substep, by rounds of a law that the network tunes.

The law of one isolated contact is solved exactly in a single round: restitution at the time of
impact, or support for what remains of the substep; Coulomb friction that stops slip but never
reverses it; rolling friction that stops rolling but never reverses it. Where contacts share bodies,
each round takes a damped step (mass splitting), and the network shifts what the contacts aim at, in
proportion to what they feel of each other. A contact that feels no other is left to the law.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from .geometry import Contacts
from .network import ContactNetwork, Feel
from .world import UNIT_GRAVITY, World

# approach speeds of two spheres below this do not bounce: as the teacher, 3 g dt / 240
_QUIET = 3.0 * UNIT_GRAVITY * 0.1 / 240.0


@dataclass(frozen=True)
class Impulses:
    """Impulses on body a of each contact; body b gets the opposite.

    Args:
        normal: Along the normal, at least 0, shape (c,).
        tangential: Across it, friction, shape (c, 3).
        rolling: Angular impulse of rolling friction, zero between spheres, shape (c, 3).
    """

    normal: Tensor
    tangential: Tensor
    rolling: Tensor

    @classmethod
    def zeros(cls, count: int, like: Tensor) -> Impulses:
        """No impulses."""
        return cls(like.new_zeros(count), like.new_zeros(count, 3), like.new_zeros(count, 3))


@dataclass(frozen=True)
class Solution:
    """What a substep's contacts do to the bodies.

    Args:
        impulses: See there.
        velocities, angular_velocities: Changes, shape (n, 3) each.
        positions: Displacements beyond those of free flight, shape (n, 3).
    """

    impulses: Impulses
    velocities: Tensor
    angular_velocities: Tensor
    positions: Tensor


class Law:
    """Coefficients of the contacts of one substep.

    Args:
        world: What does not move.
        contacts: Of the substep.
        h: Its length; 0 for one that only mends what the last one missed.
        pace: Length of a substep as such, to which speeds are compared.
    """

    def __init__(self, world: World, contacts: Contacts, h: float, pace: float) -> None:
        self.world, self.contacts, self.h, self.pace = world, contacts, h, pace
        a, b, plane = contacts.a, contacts.b, contacts.plane
        fixed = plane >= 0
        pad = lambda values: torch.cat([values, values.new_zeros(1)])  # noqa: E731
        which = plane.clamp(min=0)
        has_planes = len(world.surface_restitution) > 0

        def pair(own: Tensor, surface: Tensor) -> Tensor:
            other = pad(own)[b]
            if has_planes:
                other = torch.where(fixed, surface[which], other)
            return own[a] * other

        self.fixed = fixed
        self.restitution = pair(world.restitution, world.surface_restitution)
        self.friction = pair(world.friction, world.surface_friction)
        self.rolling = torch.where(fixed, (world.rolling_friction * world.radius[:-1])[a], 0.0)
        self.inverse_a, self.inverse_b = world.inverse_mass[a], world.inverse_mass[b]
        self.arm_a = world.radius[a] + torch.where(fixed, contacts.gap, 0.5 * contacts.gap)
        self.arm_b = torch.where(fixed, 0.0, world.radius[b] + 0.5 * contacts.gap)
        self.spin_a = self.arm_a.square() * world.inverse_inertia[a]
        self.spin_b = self.arm_b.square() * world.inverse_inertia[b]
        self.rest = (h - contacts.time.clamp(min=0.0)).clamp(min=0.0)


class Aim(NamedTuple):
    """What contacts would come to, each alone; shape (c,) each.

    parting: normal velocity at the end of the substep; flying: whether it is then off the other
    body after a bounce; airborne: time since that bounce; impulse: normal impulse over reduced
    mass; lever: time before the end at which that impulse, acting at once, leads to the same place.
    """

    parting: Tensor
    flying: Tensor
    airborne: Tensor
    impulse: Tensor
    lever: Tensor


def bounces(law: Law, approach: Tensor) -> Aim:
    """The law of one isolated contact along its normal.

    On a surface that pulls, a sphere bounces with e times the speed of each approach, in flights
    whose times are a geometric series, until it approaches slower than `_QUIET` and rests. So small
    bounces need no small substeps. Two spheres meet once.
    """
    contacts, e = law.contacts, law.restitution
    pull = (-contacts.pull).clamp(min=0.0)
    time = torch.where(approach > 0, law.h - contacts.time, law.rest)
    loud = approach > _QUIET
    speed = (e * approach).clamp(min=1e-12)
    one_less = (1.0 - e).clamp(min=1e-6)
    log_e = torch.log1p(-one_less)
    with torch.no_grad():
        left = 1.0 - time * pull * one_less / (2.0 * speed)
        over = left <= 0
        flights = torch.floor(left.clamp(min=1e-30).log() / log_e).clamp(min=0.0)
        allowed = torch.ceil(torch.log(_QUIET / approach.clamp(min=_QUIET)) / log_e)
        flying = loud & (e > 1e-3) & ~over & (flights < allowed)
        flights = torch.where(flying, flights, torch.zeros_like(flights))
    damping = torch.exp(flights * log_e)
    spent = 2.0 * speed / pull.clamp(min=1e-9) * (1.0 - damping) / one_less
    airborne = torch.where(flying, time - torch.where(flights > 0, spent, 0.0), 0.0)
    last = speed * damping
    parting = torch.where(flying, last - pull * airborne, 0.0)
    height = torch.where(flying, last * airborne - 0.5 * pull * airborne.square(), 0.0)
    closing = approach.clamp(min=0.0)
    impulse = parting + closing + pull * time
    fallen = closing * time + 0.5 * pull * time.square()
    lever = (height + fallen) / impulse.clamp(min=1e-9)
    return Aim(parting, flying, airborne, impulse, lever)


def solve(
    law: Law,
    velocities: Tensor,
    angular_velocities: Tensor,
    start: Impulses,
    rounds: int,
    network: ContactNetwork | None,
) -> Solution:
    """Solve one substep's contacts.

    Args:
        law: World, contacts and length of the substep.
        velocities: At the start of the substep, shape (n, 3).
        angular_velocities: The same, shape (n, 3).
        start: Impulses to start from, those of the last substep where contacts persist.
        rounds: M, rounds of message passing.
        network: None: the law alone.
    """
    world, contacts, h = law.world, law.contacts, law.h
    a, b, normal = contacts.a, contacts.b, contacts.normal
    count = world.count
    bodies = count + 1
    still = velocities.new_zeros(1, 3)
    before = torch.cat([velocities, still])
    free = torch.cat([velocities + h * world.gravity, still])
    spin = torch.cat([angular_velocities, still])
    relative = before[a] - before[b]
    approach = -_dot(normal, relative) - contacts.time.clamp(min=0.0) * contacts.pull
    aim = bounces(law, approach)
    bounce, target = aim.flying, aim.parting
    pulled = torch.where(law.fixed[:, None], world.gravity, torch.zeros_like(normal))
    drag = aim.airborne[:, None] * _across(pulled, normal)
    scale = torch.as_tensor(UNIT_GRAVITY * law.pace, dtype=velocities.dtype)

    keep = (~bounce).to(velocities.dtype)
    normals = start.normal * keep
    tangentials = _across(start.tangential, normal) * keep[:, None]
    rollings = start.rolling * keep[:, None]
    change, turn = _apply(law, normals, tangentials, rollings, bodies)
    unit = law.inverse_a + law.inverse_b
    tangent_unit = unit + law.spin_a + law.spin_b
    free_parting = _dot(normal, free[a] - free[b])
    free_slip = _slip(law, free, spin)
    latent = None
    if network is not None:
        latent = network.encode(describe(law, approach, bounce, free_parting, free_slip, spin))
    inertia_a = 1.0 / world.inverse_inertia[a]
    mass_a = 1.0 / law.inverse_a
    for index in range(rounds):
        end = free + change
        parting = _dot(normal, end[a] - end[b])
        lacking = target - parting
        pressing = (normals > 0) | (lacking > 1e-9 * scale)
        load = _sum(a, b, pressing.to(velocities.dtype), bodies)[:-1].clamp(min=1.0)
        load = torch.cat([load, load.new_ones(1)])
        load_a, load_b = load[a], load[b]
        pace = pace_slip = torch.ones_like(lacking)
        slip_aim = drag
        if network is not None and latent is not None:
            slip = _slip(law, end, spin + turn)
            feel = Feel(
                lacking=lacking,
                slip=_length(slip - drag),
                carried=normals * unit,
                others=parting - free_parting - normals * unit,
                others_slip=_length(slip - free_slip - tangentials * tangent_unit[:, None]),
                load=torch.maximum(load_a, load_b),
            )
            latent, tuning = network.round(index, latent, feel, scale, a, b, bodies)
            lacking, pace, pace_slip = lacking + tuning.normal, tuning.pace, tuning.pace_slip
            slip_aim = drag + tuning.slip[:, None] * slip / (_length(slip) + 1e-3 * scale)[:, None]
        split = load_a * law.inverse_a + load_b * law.inverse_b
        new = torch.where(pressing, (normals + pace * lacking / split).clamp(min=0.0), normals)
        change = change + _linear(law, (new - normals)[:, None] * normal, bodies)
        normals = new

        end, ending = free + change, spin + turn
        limit = law.friction * normals
        slip = _slip(law, end, ending) - slip_aim
        tangent = (split + load_a * law.spin_a + load_b * law.spin_b) / pace_slip
        if bool((law.rolling > 0).any()):
            wanted = tangentials - slip / tangent[:, None]
            sticks = (wanted.norm(dim=1) <= limit)[:, None]
            about = ending[a] * inertia_a[:, None]
            moving = torch.linalg.cross(normal, _across(end[a], normal))
            stuck = about + (mass_a * law.arm_a)[:, None] * moving
            carried = torch.where(sticks, _across(stuck, normal), _across(about, normal))
            resist = rollings - (carried + _dot(about, normal)[:, None] * normal) / load_a[:, None]
            most = law.rolling * normals
            about_normal = _dot(resist, normal).clamp(-most, most)[:, None] * normal
            resist = _clip(_across(resist, normal), most) + about_normal
            step = (resist - rollings) * world.inverse_inertia[a][:, None]
            turn = turn.index_add(0, a, step)
            rollings = resist
            slip = _slip(law, end, spin + turn) - slip_aim
        wanted = _clip(tangentials - slip / tangent[:, None], limit)
        step = wanted - tangentials
        change = change + _linear(law, step, bodies)
        turn = turn + _angular(law, step, bodies)
        tangentials = wanted

    # what one contact alone would get acts as if at aim.lever before the end; what others add to it
    # is spread over the rest of the substep
    own = torch.minimum(normals, aim.impulse / unit)
    share = own / normals.clamp(min=1e-30)
    lever = share * aim.lever + (1.0 - share) * 0.5 * law.rest
    moved = _linear(law, lever[:, None] * (normals[:, None] * normal + tangentials), bodies)
    impulses = Impulses(normals, tangentials, rollings)
    return Solution(impulses, change[:count], turn[:count], moved[:count])


def describe(
    law: Law, approach: Tensor, bounce: Tensor, parting: Tensor, slip: Tensor, spin: Tensor
) -> Tensor:
    """Invariant features of contacts, shape (c, 17)."""
    world, contacts = law.world, law.contacts
    a, b, normal = contacts.a, contacts.b, contacts.normal
    scale = UNIT_GRAVITY * law.pace
    radius_a, radius_b = world.radius[a], torch.where(law.fixed, world.radius[a], world.radius[b])
    heavier = torch.where(law.fixed, law.inverse_a, law.inverse_b)
    up = -world.gravity / world.gravity.norm().clamp(min=1e-12)
    steep = normal @ up
    smaller = torch.minimum(radius_a, radius_b)
    turning = _length(law.arm_a[:, None] * spin[a] - law.arm_b[:, None] * spin[b])

    def speed(value: Tensor) -> Tensor:
        return torch.asinh(10.0 * value / scale)

    return torch.stack(
        [
            speed(approach),
            speed(parting),
            speed(_length(slip)),
            speed((slip @ up) * steep),
            speed(turning),
            torch.asinh(1e3 * contacts.gap / smaller),
            contacts.time / law.pace,
            law.restitution,
            law.friction,
            10.0 * law.rolling / radius_a,
            (law.inverse_a / heavier).log().abs(),
            (radius_a / radius_b).log().abs(),
            law.fixed.to(approach.dtype),
            steep.abs(),
            torch.where(law.fixed, steep, torch.zeros_like(steep)),
            bounce.to(approach.dtype),
            (scale * law.pace / smaller).log(),
        ],
        1,
    )


def _dot(one: Tensor, other: Tensor) -> Tensor:
    return (one * other).sum(1)


def _length(vector: Tensor) -> Tensor:
    return vector.square().sum(1).clamp(min=1e-30).sqrt()


def _across(vector: Tensor, normal: Tensor) -> Tensor:
    return vector - _dot(vector, normal)[:, None] * normal


def _clip(vector: Tensor, most: Tensor) -> Tensor:
    return vector * (most / _length(vector)).clamp(max=1.0)[:, None]


def _sum(a: Tensor, b: Tensor, value: Tensor, bodies: int) -> Tensor:
    total = value.new_zeros(bodies)
    return total.index_add(0, a, value).index_add(0, b, value)


def _linear(law: Law, impulse: Tensor, bodies: int) -> Tensor:
    """Changes of velocity, shape (n + 1, 3)."""
    a, b = law.contacts.a, law.contacts.b
    change = impulse.new_zeros(bodies, 3).index_add(0, a, impulse * law.inverse_a[:, None])
    return change.index_add(0, b, impulse * -law.inverse_b[:, None])


def _angular(law: Law, impulse: Tensor, bodies: int) -> Tensor:
    """Changes of angular velocity of an impulse at the contact point, shape (n + 1, 3)."""
    a, b, world = law.contacts.a, law.contacts.b, law.world
    torque = torch.linalg.cross(law.contacts.normal, impulse)
    turn = impulse.new_zeros(bodies, 3)
    turn = turn.index_add(0, a, torque * -(law.arm_a * world.inverse_inertia[a])[:, None])
    return turn.index_add(0, b, torque * -(law.arm_b * world.inverse_inertia[b])[:, None])


def _apply(
    law: Law, normals: Tensor, tangentials: Tensor, rollings: Tensor, bodies: int
) -> tuple[Tensor, Tensor]:
    """Changes of velocity and angular velocity by all impulses."""
    normal, a = law.contacts.normal, law.contacts.a
    change = _linear(law, normals[:, None] * normal + tangentials, bodies)
    turn = _angular(law, tangentials, bodies)
    turn = turn.index_add(0, a, rollings * law.world.inverse_inertia[a][:, None])
    return change, turn


def _slip(law: Law, velocities: Tensor, angular_velocities: Tensor) -> Tensor:
    """Velocity of the two surfaces against each other, across the normal, shape (c, 3)."""
    a, b, normal = law.contacts.a, law.contacts.b, law.contacts.normal
    turning = law.arm_a[:, None] * angular_velocities[a] + law.arm_b[:, None] * angular_velocities[b]
    return _across(velocities[a] - velocities[b], normal) - torch.linalg.cross(turning, normal)
