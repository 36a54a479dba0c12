# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Warm starting: contacts that persist start from their impulses of the last substep."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .broad_phase import sphere_of
from .impulses import copy_impulse, Impulses, no_impulses
from ..kernels.jit import compiled, entry, in_place
from ..kernels.neighbours import Flags, Indices


class WarmStart(NamedTuple):
    """Impulses of the last substep, sorted by keys of their candidates; not `known` at a start."""

    key: Indices
    impulses: Impulses
    known: bool


@entry
def cold_start() -> WarmStart:
    """Warm start of the first frame of a rollout: no impulses are known."""
    return WarmStart(key=np.zeros(0, np.int64), impulses=no_impulses(0), known=False)


@compiled
def no_contacts() -> WarmStart:
    """Warm start after a frame in which nothing touched: it is known that there are none."""
    return WarmStart(key=np.zeros(0, np.int64), impulses=no_impulses(0), known=True)


@compiled
def impulses_of(warm_start: WarmStart, key: Indices) -> Impulses:
    """Impulses of the candidates of these keys, zero where they are new."""
    impulses = no_impulses(len(key))
    _copy_known(warm_start, key, impulses)
    return impulses


@in_place
def _copy_known(warm_start: WarmStart, key: Indices, impulses_out: Impulses) -> None:
    """Copy the impulses of the candidates of these keys that have any."""
    k = 0
    for i in range(len(key)):
        while k < len(warm_start.key) and warm_start.key[k] < key[i]:
            k += 1
        if k < len(warm_start.key) and warm_start.key[k] == key[i]:
            copy_impulse(warm_start.impulses, k, impulses_out, i)


@compiled
def active_impulses(key: Indices, impulses: Impulses) -> WarmStart:
    """Warm start of the contacts that carry force."""
    active = np.flatnonzero(impulses.normal > 0)
    carried = Impulses(
        normal=impulses.normal[active],
        tangential=impulses.tangential[active],
        rolling=impulses.rolling[active],
    )
    return WarmStart(key=key[active], impulses=carried, known=True)


@compiled
def with_sleepers(new: WarmStart, old: WarmStart, awake: Flags, planes: int) -> WarmStart:
    """Warm start of this frame, with the impulses with which sleepers fell asleep."""
    if awake.all() or len(old.key) == 0:
        return new
    rests = np.zeros(len(old.key), np.bool_)
    for k in range(len(old.key)):
        rests[k] = not awake[sphere_of(old.key[k], len(awake), planes)]
    asleep = np.flatnonzero(rests)
    key = np.concatenate((new.key, old.key[asleep]))
    order = np.argsort(key, kind='mergesort')
    now, before = new.impulses, old.impulses
    impulses = Impulses(
        normal=np.concatenate((now.normal, before.normal[asleep]))[order],
        tangential=np.concatenate((now.tangential, before.tangential[asleep]))[order],
        rolling=np.concatenate((now.rolling, before.rolling[asleep]))[order],
    )
    return WarmStart(key=key[order], impulses=impulses, known=True)
