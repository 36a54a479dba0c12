# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What-ifs of one ball: rollouts a second of many starts at once, beside MuJoCo's batch rollout.

How high each ball is at the end is known in closed form, whatever spin and friction do to it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
import time
from typing import Any

import numpy as np

from .mujoco_engine import load_mujoco, MujocoSamples, MujocoSettings
from .scenes import FRAME
from ...prediction.load import load_simulator
from ...running.threads import usable_cores
from ...scenes.plane import Plane
from ...scenes.scene import Scene
from ...scenes.state import Array, State

SAMPLES, QUICK_SAMPLES = 1000, 50
FRAMES = 70
"""Frames of each: a second of a ball of 20 mm."""
MUJOCO_SUBSTEPS = (6, 24)
RESTITUTION = 0.8

# rolls all samples out; centres at the end [m], shape (s, 3)
_Roll = Callable[[], Array]


def thrown_ball(samples: int) -> tuple[Scene, State]:
    """A ball of 1 m that is thrown with a spin and bounces on a floor; starts, shape (s, 1, k)."""
    draw = np.random.default_rng(samples)
    scene = Scene(surfaces=(Plane(),), restitution=float(np.sqrt(RESTITUTION)), friction=0.5)
    positions = np.array([0.0, 0.0, 8.0]) + draw.normal(0.0, 0.1, (samples, 1, 3))
    velocities = np.array([10.0, 0.0, 3.0]) + draw.normal(0.0, 0.3, (samples, 1, 3))
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (samples, 1, 1))
    return scene, State.unchecked(positions, turns, velocities, draw.normal(size=(samples, 1, 3)))


def height_after(height: float, speed: float, seconds: float, gravity: float) -> float:
    """Height of a ball of 1 m that was thrown up, with its bounces: v <- e v at each [m]."""
    gap, v, left = height - 1.0, speed, seconds
    while True:
        until = (v + np.sqrt(v * v + 2.0 * gravity * gap)) / gravity
        if until >= left:
            return float(1.0 + gap + v * left - 0.5 * gravity * left**2)
        gap, v, left = 0.0, RESTITUTION * (gravity * until - v), left - until


def measure_what_ifs(repeats: int, *, quick: bool = False) -> dict[str, Any]:
    """Time all peers in turn in each repeat.

    Returns:
        `samples`, `frames` and `rows`, each with `peer`, `threads`, `seconds` of all rollouts
        (median over repeats) [s], `rollouts_per_second` and `height_error`, the mean over samples
        at the end [m].
    """
    samples = QUICK_SAMPLES if quick else SAMPLES
    scene, starts = thrown_ball(samples)
    threads = sorted({1, usable_cores()})
    rolls: dict[tuple[str, int], _Roll] = {}
    laws = load_simulator('laws')
    for count in threads:
        rolls['laws 8', count] = lambda count=count: laws.rollout_samples(  # type: ignore[misc]
            scene, starts, FRAMES, workers=count
        ).positions[:, -1, 0]
    try:
        load_mujoco()
    except ModuleNotFoundError:
        pass  # the table of peers names it
    else:
        for substeps in MUJOCO_SUBSTEPS:
            for count in threads:
                batch = MujocoSamples(scene, starts, FRAME, MujocoSettings(substeps), count)
                rolls[f'MuJoCo {substeps}', count] = partial(batch.roll, FRAMES)
    gravity = float(np.linalg.norm(scene.gravity))
    known = [
        height_after(p, v, FRAMES * FRAME, gravity)
        for p, v in zip(starts.positions[:, 0, 2], starts.velocities[:, 0, 2], strict=True)
    ]
    errors = {key: float(np.abs(roll()[:, 2] - known).mean()) for key, roll in rolls.items()}
    seconds: dict[tuple[str, int], list[float]] = {key: [] for key in rolls}
    for _ in range(repeats):
        for key, roll in rolls.items():
            begin = time.perf_counter()
            roll()
            seconds[key].append(time.perf_counter() - begin)
    rows = [
        {
            'peer': peer,
            'threads': count,
            'seconds': float(np.median(seconds[peer, count])),
            'rollouts_per_second': samples / float(np.median(seconds[peer, count])),
            'height_error': errors[peer, count],
        }
        for peer, count in rolls
    ]
    return {'samples': samples, 'frames': FRAMES, 'rows': rows}
