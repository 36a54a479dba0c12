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

"""What the network reads of a contact: invariant scalars, speeds in units of g h."""

from __future__ import annotations

import torch
from torch import Tensor

from .law import Law
from .vectors import length
from .world import UNIT_GRAVITY


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
    turning = length(law.arm_a[:, None] * spin[a] - law.arm_b[:, None] * spin[b])

    def speed(value: Tensor) -> Tensor:
        return torch.asinh(10.0 * value / scale)

    return torch.stack(
        [
            speed(approach),
            speed(parting),
            speed(length(slip)),
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
