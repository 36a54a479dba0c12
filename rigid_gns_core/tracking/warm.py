# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compile the filter before the first tracked frame, not in the middle of a run."""

from __future__ import annotations

from functools import cache

import numpy as np

from .association import match
from .coasting import turn_on
from .environment import Environment
from .gating import gates
from .jit import compiling
from .velocity import estimate_motion
from ..scenes.scene import Plane, Scene


@cache
def warm_up() -> None:
    """Load the machine code from the disk, or compile it; once in a process."""
    with compiling():
        _call_entries()


def _call_entries() -> None:
    frames, ones = 4, np.ones(2)
    centres = np.tile([[0.0, 0.0, 1.0], [0.0, 1.5, 1.0]], (frames, 1, 1))
    seen = np.ones((frames, 2), dtype=bool)
    seen[-1, 0] = False  # is coasted
    motion = estimate_motion(
        0.1 * np.arange(frames),
        centres,
        np.tile([0.0, 0.0, 0.0, 1.0], (frames, 2, 1)),
        environment=Environment.of(Scene(surfaces=(Plane(),))),
        radii=ones,
        noise=1e-3,
        seen=seen,
    )
    turn_on(motion.quaternions, motion.angular_velocities, 0.1)
    width = gates(ones, motion.positions, ones, ones, 0.1, seen[0])
    match(motion.positions, motion.positions[:1], width)  # contested: compiles the clusters too
