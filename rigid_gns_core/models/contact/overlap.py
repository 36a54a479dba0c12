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

"""Overlaps: undone by position alone, so that they give no speed."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from . import geometry
from .candidates import Candidates
from .geometry import Contacts
from .world import World

# sweeps that push out what still overlaps at the end of a substep
_SWEEPS = 4
# overlaps [radii] that are rounding
ROUNDING = 1e-12
# passes over a start, and overlaps [radii] below which it is left as it is
_PASSES, _CLOSE = 500, 1e-6


def push_out(world: World, positions: Tensor, contacts: Contacts) -> Tensor:
    """Centres, shape (n, 3), overlapping bodies moved apart; a pair's centre of mass stays."""
    a, b = contacts.a, contacts.b
    inverse = world.inverse_mass
    for _ in range(_SWEEPS):
        with torch.no_grad():
            gap, normal = geometry.gaps(world, positions, contacts)
            deep = gap < -ROUNDING * world.radius[a]
        if not bool(deep.any()):
            break
        touched = torch.nonzero(deep)[:, 0]
        one, other, depth = a[touched], b[touched], -gap[touched]
        # a body shares its way out between its contacts, by depth: one of no depth has no say
        worst = torch.full_like(inverse, 1e-30)
        worst = worst.scatter_reduce(0, one, depth, 'amax').scatter_reduce(0, other, depth, 'amax')
        load = torch.zeros_like(inverse)
        load = load.index_add(0, one, depth / worst[one]).index_add(0, other, depth / worst[other])
        share = depth / (load[one] * inverse[one] + load[other] * inverse[other])
        push = share[:, None] * normal[touched]
        shift = positions.new_zeros(world.count + 1, 3)
        shift = shift.index_add(0, one, push * inverse[one][:, None])
        shift = shift.index_add(0, other, push * -inverse[other][:, None])
        positions = positions + shift[:-1]
    return positions


def separate(
    world: World, positions: Tensor, neighbours: Callable[[Tensor, Tensor], Candidates]
) -> Tensor:
    """Return a start without overlaps: spheres and surfaces as given may hold any.

    Args:
        world: What does not move.
        positions: Shape (n, 3).
        neighbours: Finds candidates from positions and velocities.
    """
    still = torch.zeros_like(positions)
    for _ in range(_PASSES):
        candidates = neighbours(positions, still)
        if not len(candidates):
            break
        contacts = geometry.find_contacts(world, positions, still, candidates, 0.0, 0.0)
        gap, _ = geometry.gaps(world, positions, contacts)
        if not bool((gap < -_CLOSE * world.radius[contacts.a]).any()):
            break
        positions = push_out(world, positions, contacts)
    return positions
