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

"""Impulses of all contacts of a substep, by rounds of a law whose pace the network sets.

Where contacts share bodies, each round recomputes what every contact feels of the others and takes
a damped step (mass splitting) towards the law of one contact: restitution or support, Coulomb
friction that stops slip but never reverses it, rolling friction that stops rolling but never
reverses it. So the end of the rounds is physical whatever the network says; it decides how near
they come in so few rounds. A contact alone needs one round and no network.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from .features import describe
from .impulses import angular_change, Impulses, linear_change, slip
from .law import aim_of, Law
from .network import ContactNetwork, Feel, Tuning
from .vectors import across, clip, dot, length
from .world import UNIT_GRAVITY

# contacts with this part of the force of a body's strongest count half
_FAINT = 0.01


@dataclass(frozen=True)
class Solution:
    """What a substep's contacts do to the bodies.

    Args:
        impulses: See there.
        velocities, angular_velocities: Changes, shape (n, 3) each.
        positions: Displacements beyond those of free flight, shape (n, 3).
        unsettled: Speed by which the last round still changed each contact, shape (c,).
    """

    impulses: Impulses
    velocities: Tensor
    angular_velocities: Tensor
    positions: Tensor
    unsettled: Tensor


def solve(
    law: Law,
    velocities: Tensor,
    angular_velocities: Tensor,
    start: Impulses,
    rounds: int,
    network: ContactNetwork | None,
    support: Impulses | None = None,
    enough: float = 0.0,
) -> Solution:
    """Solve one substep's contacts.

    Args:
        law: World, contacts and length of the substep.
        velocities: At the start of the substep, shape (n, 3).
        angular_velocities: The same, shape (n, 3).
        start: Impulses to start from, those of the last substep where contacts persist.
        rounds: M, rounds of message passing.
        network: None: the law alone.
        support: Impulses that last, where they are not those to start from.
        enough: Speed; a round that changes every contact by less is the last. 0: all rounds.
    """
    solver = _Solver(law, velocities, angular_velocities, start, support or start, network)
    for index in range(rounds):
        solver.round(index)
        if enough > 0 and float(solver.last_change().detach().max()) < enough:
            break
    return solver.solution()


class _Solver:
    """Impulses so far, and what they make of the bodies; see `solve`."""

    def __init__(
        self,
        law: Law,
        velocities: Tensor,
        angular_velocities: Tensor,
        start: Impulses,
        support: Impulses,
        network: ContactNetwork | None,
    ) -> None:
        world, contacts, h = law.world, law.contacts, law.h
        self.law, self.network = law, network
        self.has_law = network is None or network.config.law
        self.bodies = world.count + 1
        a, b, normal = contacts.a, contacts.b, contacts.normal
        still = velocities.new_zeros(1, 3)
        before = torch.cat([velocities, still])
        self.free = torch.cat([velocities + h * world.gravity, still])
        self.spin = torch.cat([angular_velocities, still])
        self.approach = -dot(normal, before[a] - before[b])
        self.approach = self.approach - contacts.time.clamp(min=0.0) * contacts.pull
        pulled = torch.where(law.fixed[:, None], world.gravity, torch.zeros_like(normal))
        self.pulled = across(pulled, normal)
        self.scale = UNIT_GRAVITY * law.pace
        self.unit = law.inverse_a + law.inverse_b
        self.free_parting = dot(normal, self.free[a] - self.free[b])
        self.free_slip = slip(law, self.free, self.spin)
        self.aim = aim_of(law, self.approach, torch.zeros_like(self.approach))
        self._begin(support)
        self.start_others = self._others(self._parting()).detach()
        if start is not support:
            self._begin(start)
        self.latent: Tensor | None = None
        if network is not None:
            features = describe(
                law, self.approach, self.aim.flying, self.free_parting, self.free_slip, self.spin
            )
            self.latent = network.encode(features)
            self.start_slip = self._others_slip(self._slip_now())

    def _begin(self, impulses: Impulses) -> None:
        """Take these impulses as those so far."""
        law = self.law
        self.normals = self.last_normals = impulses.normal
        self.tangentials = across(impulses.tangential, law.contacts.normal)
        self.last_tangentials = self.tangentials
        self.rollings = impulses.rolling
        self.change = linear_change(law, self._impulse(), self.bodies)
        self.turn = angular_change(law, self.tangentials, self.bodies)
        self._twist(self.rollings)

    def round(self, index: int) -> None:
        """One round: normal impulses, then rolling friction, then friction."""
        law, contacts = self.law, self.law.contacts
        parting = self._parting()
        others = self._others(parting)
        extra = _common(self.start_others, others.detach()) / max(law.h, 1e-12) * (law.h > 0)
        self.aim = aim_of(law, self.approach, extra)
        drag = self.aim.airborne[:, None] * self.pulled
        lacking = self.aim.parting - parting
        pressing = self.aim.hit & ((self.normals > 0) | (lacking > 1e-9 * self.scale))
        weight_a, weight_b = self._weights(pressing, lacking)
        load = lacking.new_zeros(self.bodies)
        load = load.index_add(0, contacts.a, weight_a).index_add(0, contacts.b, weight_b)
        load[-1] = 1.0
        load = load.clamp(min=1.0)
        load_a, load_b = load[contacts.a], load[contacts.b]
        wanting = lacking if self.has_law else -parting
        load_most = torch.maximum(load_a, load_b)
        tuning = Tuning.plain(load_most)
        if self.network is not None and self.latent is not None:
            self.latent, tuning = self.network.round(
                index,
                self.latent,
                self._feel(wanting, others, drag, load_most),
                self.scale,
                contacts.a,
                contacts.b,
                weight_a,
                weight_b,
                self.bodies,
            )
        if not self.has_law:
            size = 2.0 * (self.approach.abs() + self.free_parting.abs() + 0.02 * self.scale)
            lacking, pressing = size * tuning.raw, torch.ones_like(pressing)
        split = load_a * law.inverse_a + load_b * law.inverse_b
        step = tuning.momentum * (self.normals - self.last_normals) + tuning.pace * lacking / split
        normals = torch.where(pressing, (self.normals + step).clamp(min=0.0), 0.0)
        self.last_normals, self.normals = self.normals, normals
        self._push((normals - self.last_normals)[:, None] * contacts.normal)

        stiffness = (split + load_a * law.spin_a + load_b * law.spin_b) / tuning.pace_slip
        if law.rolls:
            self._resist_rolling(drag, stiffness, load_a)
        step = tuning.momentum[:, None] * (self.tangentials - self.last_tangentials)
        step = step - (self._slip_now() - drag) / stiffness[:, None]
        tangentials = clip(self.tangentials + step, law.friction * normals)
        self.last_tangentials, self.tangentials = self.tangentials, tangentials
        step = tangentials - self.last_tangentials
        self._push(step)
        self.turn = self.turn + angular_change(law, step, self.bodies)

    def solution(self) -> Solution:
        """Return what the impulses so far do to the bodies."""
        law, aim, count = self.law, self.aim, self.bodies - 1
        # what a contact alone would get acts as if at aim.lever before the end; what others add to
        # it is spread over the rest of the substep
        own = torch.minimum(self.normals, aim.impulse / self.unit)
        share = own / self.normals.clamp(min=1e-30)
        lever = share * aim.lever + (1.0 - share) * 0.5 * aim.rest
        if not self.has_law:
            lever = law.h - law.contacts.time
        moved = linear_change(law, lever[:, None] * self._impulse(), self.bodies)
        impulses = Impulses(self.normals, self.tangentials, self.rollings)
        last = self.last_change()
        return Solution(impulses, self.change[:count], self.turn[:count], moved[:count], last)

    def last_change(self) -> Tensor:
        """Change of normal velocities by the last round, shape (c,)."""
        return (self.normals - self.last_normals).abs() * self.unit

    @torch.no_grad()
    def _weights(self, pressing: Tensor, lacking: Tensor) -> tuple[Tensor, Tensor]:
        """How much each contact counts at body a and at body b, 0 to 1, shape (c,) each.

        The strongest of a body counts 1, one of no force nothing, so that contacts that carry
        nothing change nothing.
        """
        a, b = self.law.contacts.a, self.law.contacts.b
        strength = pressing * (self.normals * self.unit + lacking.abs())
        most = torch.full((self.bodies,), 1e-30, dtype=strength.dtype)
        most = most.scatter_reduce(0, a, strength, 'amax').scatter_reduce(0, b, strength, 'amax')
        weight_a, weight_b = (
            (1.0 + _FAINT) * strength / (strength + _FAINT * most[body]) for body in (a, b)
        )
        return weight_a, weight_b

    def _feel(self, lacking: Tensor, others: Tensor, drag: Tensor, load: Tensor) -> Feel:
        slip_now = self._slip_now()
        return Feel(
            lacking=lacking,
            slip=length(slip_now - drag),
            carried=self.normals * self.unit,
            others=others - self.start_others,
            others_slip=length(self._others_slip(slip_now) - self.start_slip),
            load=load,
        )

    def _resist_rolling(self, drag: Tensor, stiffness: Tensor, load: Tensor) -> None:
        """Torque of rolling friction: at most rho r N, and no more than stops the rolling.

        Where the contact sticks, what rolls is the angular momentum about the contact point, which
        friction does not change; where it slips, that about the centre.
        """
        law, world = self.law, self.law.world
        a, normal = law.contacts.a, law.contacts.normal
        wanted = self.tangentials - (self._slip_now() - drag) / stiffness[:, None]
        sticks = (length(wanted) <= law.friction * self.normals)[:, None]
        about = (self.spin + self.turn)[a] / world.inverse_inertia[a][:, None]
        orbit = torch.linalg.cross(normal, across((self.free + self.change)[a], normal))
        stuck = about + (law.arm_a / law.inverse_a)[:, None] * orbit
        rolls = torch.where(sticks, across(stuck, normal), across(about, normal))
        resist = self.rollings - (rolls + about - across(about, normal)) / load[:, None]
        most = law.rolling * self.normals
        flat = across(resist, normal)
        twist = dot(resist, normal).clamp(-most, most)[:, None] * normal
        resist = clip(flat, most) + twist
        self._twist(resist - self.rollings)
        self.rollings = resist

    def _impulse(self) -> Tensor:
        return self.normals[:, None] * self.law.contacts.normal + self.tangentials

    def _push(self, impulse: Tensor) -> None:
        self.change = self.change + linear_change(self.law, impulse, self.bodies)

    def _twist(self, torque: Tensor) -> None:
        a = self.law.contacts.a
        unit = self.law.world.inverse_inertia[a][:, None]
        self.turn = self.turn.index_add(0, a, torque * unit)

    def _parting(self) -> Tensor:
        contacts, end = self.law.contacts, self.free + self.change
        return dot(contacts.normal, end[contacts.a] - end[contacts.b])

    def _slip_now(self) -> Tensor:
        return slip(self.law, self.free + self.change, self.spin + self.turn)

    def _others(self, parting: Tensor) -> Tensor:
        """Change of normal velocity that the other contacts make, shape (c,)."""
        return parting - self.free_parting - self.normals * self.unit

    def _others_slip(self, slip_now: Tensor) -> Tensor:
        """Change of slip that the other contacts make, shape (c, 3)."""
        law = self.law
        own: Tensor = self.tangentials * (self.unit + law.spin_a + law.spin_b)[:, None]
        arm = law.arm_a * law.world.inverse_inertia[law.contacts.a]
        own = own + arm[:, None] * torch.linalg.cross(law.contacts.normal, self.rollings)
        return slip_now - self.free_slip - own


def _common(one: Tensor, other: Tensor) -> Tensor:
    """Return the smaller of two numbers of one sign, else 0, shape (c,)."""
    return torch.where(
        one * other > 0, torch.sign(one) * torch.minimum(one.abs(), other.abs()), 0.0
    )
