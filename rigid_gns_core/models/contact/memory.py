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

"""Impulses of the last substep, from which contacts that persist start in the next one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from .geometry import Contacts
from .impulses import Impulses
from .world import World


@dataclass(frozen=True)
class Memory:
    """Impulses per time of contacts that persist, by key, sorted; nothing at the start.

    key: shape (c,); impulses: see there.
    """

    key: Tensor
    impulses: Impulses

    @classmethod
    def empty(cls, like: Tensor) -> Memory:
        """No contacts."""
        return cls(torch.zeros(0, dtype=torch.int64), Impulses.zeros(0, like))

    @classmethod
    def of(cls, parts: Sequence[tuple[Tensor, Impulses]]) -> Memory:
        """From keys and impulses in any order."""
        key = torch.cat([part[0] for part in parts])
        order = torch.argsort(key)
        names = ('normal', 'tangential', 'rolling')
        values = (torch.cat([getattr(part[1], name) for part in parts])[order] for name in names)
        return cls(key[order], Impulses(*values))

    def take(self, index: Tensor) -> Memory:
        """Those of `index` (numbers or a mask), in the same order."""
        return Memory(self.key[index], self.impulses.take(index))

    def recall(self, key: Tensor, like: Tensor) -> Impulses:
        """Impulses of these contacts, zero where they are new; key: shape (c,)."""
        if not len(self.key) or not len(key):
            return Impulses.zeros(len(key), like)
        place = torch.searchsorted(self.key, key).clamp(max=len(self.key) - 1)
        known = (self.key[place] == key).to(like.dtype)
        old = self.impulses
        return Impulses(
            old.normal[place] * known,
            old.tangential[place] * known[:, None],
            old.rolling[place] * known[:, None],
        )


def contact_key(world: World, contacts: Contacts) -> Tensor:
    """Return a number for each pair of bodies, shape (c,)."""
    bodies = world.count + len(world.point)
    other = torch.where(contacts.plane >= 0, world.count + contacts.plane, contacts.b)
    return contacts.a * bodies + other
