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

"""Impulses at contacts, and what they make of the bodies."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from .law import Law
from .vectors import across


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

    def take(self, index: Tensor) -> Impulses:
        """Those of `index`."""
        return Impulses(self.normal[index], self.tangential[index], self.rolling[index])


def linear_change(law: Law, impulse: Tensor, bodies: int) -> Tensor:
    """Return changes of velocity, shape (n + 1, 3)."""
    a, b = law.contacts.a, law.contacts.b
    change = impulse.new_zeros(bodies, 3).index_add(0, a, impulse * law.inverse_a[:, None])
    return change.index_add(0, b, impulse * -law.inverse_b[:, None])


def angular_change(law: Law, impulse: Tensor, bodies: int) -> Tensor:
    """Return changes of angular velocity of an impulse at the contact point, shape (n + 1, 3)."""
    a, b, world = law.contacts.a, law.contacts.b, law.world
    torque = torch.linalg.cross(law.contacts.normal, impulse)
    turn = impulse.new_zeros(bodies, 3)
    turn = turn.index_add(0, a, torque * -(law.arm_a * world.inverse_inertia[a])[:, None])
    return turn.index_add(0, b, torque * -(law.arm_b * world.inverse_inertia[b])[:, None])


def slip(law: Law, velocities: Tensor, angular_velocities: Tensor) -> Tensor:
    """Velocity of the two surfaces against each other, across the normal, shape (c, 3)."""
    a, b, normal = law.contacts.a, law.contacts.b, law.contacts.normal
    turning = (
        law.arm_a[:, None] * angular_velocities[a] + law.arm_b[:, None] * angular_velocities[b]
    )
    spun: Tensor = torch.linalg.cross(turning, normal)
    return across(velocities[a] - velocities[b], normal) - spun
