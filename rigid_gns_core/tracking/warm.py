# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compile the filter before the first tracked frame, not in the middle of a run."""

from __future__ import annotations

from functools import cache

import numpy as np

from .association import match
from .ball_contact import FREE
from .ball_estimate import estimate_ball
from .ball_model import BallModel
from .ball_slopes import normal_equations
from .ball_surfaces import PLANE
from .coasting import turn_on
from .environment import Environment
from .gating import gates
from .jit import compiling
from .known_laws import KnownLaws
from .newest_frame import append_frame, is_usual
from .noise_estimate import third_differences
from .start_guess import ALL
from .velocity import estimate_motion
from ..scenes.scene import Plane, Scene


@cache
def warm_up() -> None:
    """Load the machine code from the disk, or compile it; once in a process."""
    with compiling():
        _call_entries()


@cache
def warm_up_laws() -> None:
    """The same of estimates by the laws: a node in a scene without air does without."""
    scene = Scene(surfaces=(Plane(),), radius=0.02)
    times = 0.01 * np.arange(12.0)
    places = np.array([0.0, 0.0, 1.0]) + times[:, None, None] * [1.0, 0.0, 0.0]
    seen = np.ones((12, 1), dtype=bool)
    seen[-1] = False  # is coasted
    with compiling():
        KnownLaws.of(scene, (0,)).states(times, places, seen)


def warm_up_identification() -> None:
    """The same of what identification takes besides."""
    warm_up_laws()
    model = BallModel.of(Scene(surfaces=(Plane(),), radius=0.02))
    times = 0.01 * np.arange(12.0)
    places = np.array([0.0, 0.0, 1.0]) + times[:, None] * [1.0, 0.0, 0.0]
    noise = np.array([1e-3, 1e-2, 0.02])
    with compiling():
        found = estimate_ball(model, noise, None, times, places)
        none = np.zeros((0, 1, 16)), np.zeros((0, 1, PLANE)), np.zeros((0, 1, 8)), np.zeros(0)
        laws = (model.ball, model.planes, model.laws)
        ends = np.zeros((9, 9)), np.zeros(9)
        frames = (float(times[0]), times, places)
        normal_equations(found.state, ALL, *frames, *laws, FREE, noise, np.ones(12), *none, *ends)


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
    poses = np.ones((frames, 2, 7))
    is_usual(poses[0], 1.0)
    append_frame(poses[0], poses, seen, poses.copy(), seen.copy())
    third_differences(np.array([0.0, 0.1, 0.2, 0.3]), poses, seen)
