# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many starts of one scene, as the samples of a forecast: each as if it were alone, to the bit.

In rounds: all that fly do so eight at a time, up to where each might touch something; then each
goes on by itself until it flies again.
"""

from __future__ import annotations

import numpy as np

from .clearance import is_clear, pass_clear
from .frames import advance_frames, only_fly
from .lane_flight import fly_together, new_formation
from .lone import bounce, Lone, new_lone
from .motion import Settings
from .separation import separate
from .sleep import Sleepers, wake_all
from .spheres import is_finite, part_of, Spheres, view_of
from .warm_start import active_impulses, cold_start
from .workspace import Workspace
from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.lanes import WIDTH
from ..kernels.neighbours import Indices
from ..kernels.vector import minus, row


@compiled
def advance_samples(
    world: World,
    dt: float,
    settings: Settings,
    guards: bool,
    sleeps: bool,
    sleepers_out: Sleepers,
    frames_out: Spheres,
    done_out: Indices,
) -> tuple[int, float]:
    """Frames of many starts.

    Args:
        world: What does not move, which is all but at most `frames.FEW` spheres; no solids.
        dt: Length of a frame.
        settings: Substeps and iterations.
        guards: Limit the energy.
        sleeps: Let islands sleep.
        sleepers_out: Scratch.
        frames_out: Starts, whose overlaps are undone, and frames, shapes (s, frames, n, k).
        done_out: How many of these are finite, shape (s,).

    Returns:
        How many islands the guard limited, and the energy it took.
    """
    count, total = frames_out.positions.shape[:2]
    acted, removed, left, going = 0, 0.0, count, np.arange(count)
    threshold, formation = sleepers_out.threshold, new_formation(len(world.restitution))
    lone, work = new_lone(world)
    for k in range(count):
        done_out[k] = 1
        if not _is_apart(world, frames_out, k):
            separate(world, dt, frames_out.positions[k, 0])
    while left:
        for first in range(0, left, WIDTH):
            size = min(WIDTH, left - first)
            for lane in range(size):
                formation.samples[lane] = going[first + lane]
            fly_together(
                world=world,
                dt=dt,
                sleeps=sleeps,
                threshold=threshold,
                size=size,
                formation_out=formation,
                frames_out=frames_out,
                done_out=done_out,
            )
        still = 0
        for k in going[:left]:
            wake_all(sleepers_out)
            done_out[k], finite, alone = _bounce_until_flight(
                world, k, done_out[k], dt, settings, guards, sleeps, sleepers_out, lone, work,
                frames_out,
            )  # fmt: skip
            if not alone:
                own, warm_start = part_of(frames_out, k), cold_start()
                if done_out[k] > 1:
                    warm_start = active_impulses(lone.candidates.key, lone.before)
                done_out[k], finite, _, held, taken = advance_frames(
                    world=world,
                    spheres=part_of(own, done_out[k] - 1),
                    dt=dt,
                    warm_start=warm_start,
                    settings=settings,
                    guards=guards,
                    sleeps=sleeps,
                    until_flight=True,
                    first=done_out[k],
                    sleepers_out=sleepers_out,
                    frames_out=own,
                )
                acted += held
                removed += taken
            if finite and done_out[k] < total:
                going[still] = k
                still += 1
        left = still
    return acted, removed


@in_place
def _bounce_until_flight(
    world: World,
    k: int,
    done: int,
    dt: float,
    settings: Settings,
    guards: bool,
    sleeps: bool,
    sleepers_out: Sleepers,
    lone_out: Lone,
    work_out: Workspace,
    frames_out: Spheres,
) -> tuple[int, bool, bool]:
    """Frames of sample k in which its spheres bounce by themselves, and one in which all fly.

    Returns how many it has then, whether all are finite, and whether that is all that happens:
    if not, the general way must go on, with the impulses before it in `lone_out.before`.
    """
    frames, threshold, flies = view_of(frames_out, k), sleepers_out.threshold, False
    holds = False
    while done < len(frames.positions) and not flies:
        before, after = view_of(frames, done - 1), view_of(frames, done)
        flies = only_fly(world, before, dt, sleeps, sleepers_out, after)
        if flies:
            holds = False
        elif done == 1:  # the impulses of a start are not known
            return done, True, False
        else:
            alone, holds = bounce(
                world, before, dt, settings, guards, sleeps, threshold, holds, lone_out, work_out,
                after,
            )  # fmt: skip
            if not alone:
                return done, True, False
        if not is_finite(after):
            return done, False, True
        done += 1
    return done, True, True


@in_place
def _is_apart(world: World, frames: Spheres, k: int) -> bool:
    """Whether nothing overlaps at the start of sample k, by what a glance tells."""
    positions, zero = frames.positions[k, 0], (0.0, 0.0, 0.0)
    for i in range(len(world.restitution)):
        p, radius = row(positions, i), world.radius[i]
        for plane in range(len(world.point)):
            if not is_clear(world, plane, p, p, radius):
                return False
        for j in range(i):
            offset = minus(p, row(positions, j))
            if not pass_clear(offset, zero, radius + world.radius[j]):
                return False
    return True
