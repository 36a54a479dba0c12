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

from typing import NamedTuple

import numpy as np

from .impulses import Impulses, no_impulses
from ..kernels.jit import compiled, entry
from ..kernels.neighbours import Flags, Indices
from ..kernels.vector import put, row


class Memory(NamedTuple):
    """Impulses of the last substep, by the key of their candidate, sorted; `known` at all."""

    key: Indices
    impulses: Impulses
    known: bool


@entry
def no_memory() -> Memory:
    """At a start, where impulses are found first."""
    return Memory(np.zeros(0, np.int64), no_impulses(0), False)


@compiled
def recall(memory: Memory, key: Indices) -> Impulses:
    """Impulses of candidates, zero where they are new."""
    found = no_impulses(len(key))
    k = 0
    for i in range(len(key)):
        while k < len(memory.key) and memory.key[k] < key[i]:
            k += 1
        if k < len(memory.key) and memory.key[k] == key[i]:
            found.normal[i] = memory.impulses.normal[k]
            put(found.tangential, i, row(memory.impulses.tangential, k))
            put(found.rolling, i, row(memory.impulses.rolling, k))
    return found


@compiled
def pressing(key: Indices, impulses: Impulses) -> Memory:
    """Impulses worth remembering."""
    some = np.flatnonzero(impulses.normal > 0)
    kept = Impulses(impulses.normal[some], impulses.tangential[some], impulses.rolling[some])
    return Memory(key[some], kept, True)


@compiled
def remember(new: Memory, old: Memory, awake: Flags, planes: int) -> Memory:
    """Impulses of this frame, and those of sleepers from the frame they fell asleep in."""
    if awake.all() or len(old.key) == 0:
        return new
    bodies = len(awake) + planes
    kept = np.flatnonzero(~awake[old.key // bodies])
    key = np.concatenate((new.key, old.key[kept]))
    order = np.argsort(key, kind='mergesort')
    one, other = new.impulses, old.impulses
    impulses = Impulses(
        np.concatenate((one.normal, other.normal[kept]))[order],
        np.concatenate((one.tangential, other.tangential[kept]))[order],
        np.concatenate((one.rolling, other.rolling[kept]))[order],
    )
    return Memory(key[order], impulses, True)
