# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Warm starting: contacts that persist start from their impulses of the last substep."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .impulses import Impulses, no_impulses
from ..kernels.jit import compiled, entry
from ..kernels.neighbours import Flags, Indices
from ..kernels.vector import put, row


class WarmStart(NamedTuple):
    """Impulses of the last substep, by the key of their candidate, sorted; `known` at all."""

    key: Indices
    impulses: Impulses
    known: bool


@entry
def cold_start() -> WarmStart:
    """At a start, where impulses are found first."""
    return WarmStart(key=np.zeros(0, np.int64), impulses=no_impulses(0), known=False)


@compiled
def impulses_of(warm_start: WarmStart, key: Indices) -> Impulses:
    """Impulses of candidates, zero where they are new."""
    found = no_impulses(len(key))
    k = 0
    for i in range(len(key)):
        while k < len(warm_start.key) and warm_start.key[k] < key[i]:
            k += 1
        if k < len(warm_start.key) and warm_start.key[k] == key[i]:
            found.normal[i] = warm_start.impulses.normal[k]
            put(found.tangential, i, row(warm_start.impulses.tangential, k))
            put(found.rolling, i, row(warm_start.impulses.rolling, k))
    return found


@compiled
def active_impulses(key: Indices, impulses: Impulses) -> WarmStart:
    """Impulses of active contacts."""
    some = np.flatnonzero(impulses.normal > 0)
    kept = Impulses(
        normal=impulses.normal[some],
        tangential=impulses.tangential[some],
        rolling=impulses.rolling[some],
    )
    return WarmStart(key=key[some], impulses=kept, known=True)


@compiled
def with_sleepers(new: WarmStart, old: WarmStart, awake: Flags, planes: int) -> WarmStart:
    """Impulses of this frame, and those of sleepers from the frame they fell asleep in."""
    if awake.all() or len(old.key) == 0:
        return new
    bodies = len(awake) + planes
    kept = np.flatnonzero(~awake[old.key // bodies])
    key = np.concatenate((new.key, old.key[kept]))
    order = np.argsort(key, kind='mergesort')
    one, other = new.impulses, old.impulses
    impulses = Impulses(
        normal=np.concatenate((one.normal, other.normal[kept]))[order],
        tangential=np.concatenate((one.tangential, other.tangential[kept]))[order],
        rolling=np.concatenate((one.rolling, other.rolling[kept]))[order],
    )
    return WarmStart(key=key[order], impulses=impulses, known=True)
