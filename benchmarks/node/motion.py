# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Balls that bounce and slide without loss, known for ever, and balls that are thrown in air."""

from __future__ import annotations

from typing import Any

import numpy as np
from rigid_gns_core import load_simulator, Scene
from rigid_gns_core.rollout.paths import Paths
from rigid_gns_core.scenes.state import State

RADIUS, GRAVITY = 0.02, 9.81  # [m], [m/s^2]
HEIGHTS = np.array([0.5, 0.8, 0.0, 0.0])  # of the bounces [m]
VELOCITIES = np.array([0.3, -0.2, 0.4, -0.1])  # along x [m/s]
NOISE = 1e-4  # of each tracked coordinate [m]

SCENE: dict[str, Any] = {
    'scene': {
        'surfaces': [{'point': [0, 0, 0], 'normal': [0, 0, 1]}],
        'radius': RADIUS,
        'mass': 0.0027,
        'restitution': 1.0,
        'friction': 0.0,
        'rolling_friction': 0.0,
    }
}

THROW, THROWS = 0.6, 130  # length of a throw [s], and how many are known: two minutes
# of balls that are thrown: their laws, and what a node that learns them is told at first
THROWN: dict[str, Any] = {
    'surfaces': [{'point': [0, 0, 0], 'normal': [0, 0, 1]}],
    'radius': RADIUS,
    'mass': 0.0027,
    'inertia_factor': 0.6667,
    'restitution': 0.95,
    'friction': 0.8,
    'air': {'density': 1.2, 'drag_coefficient': 0.45},
}
UNLEARNED: dict[str, Any] = {
    **{name: value for name, value in THROWN.items() if name != 'air'},
    'restitution': 0.8,
    'friction': 0.3,
}


def poses_at(
    times: np.ndarray, heights: np.ndarray = HEIGHTS, velocities: np.ndarray = VELOCITIES
) -> np.ndarray:
    """Poses without noise, shape (k, n, 7).

    Args:
        times: Since the start [s], shape (k,).
        heights: Of the bounces [m], 0: it slides; shape (n,).
        velocities: Along x [m/s], shape (n,).
    """
    times = np.asarray(times, dtype=np.float64)[:, None]
    fall = np.sqrt(2 * np.maximum(heights, 1e-9) / GRAVITY)
    since = (times + fall) % (2 * fall) - fall  # around each highest point
    poses = np.zeros((len(times), len(heights), 7))
    poses[..., 0] = velocities * times
    poses[..., 1] = 0.5 * np.arange(len(heights))
    poses[..., 2] = RADIUS + np.where(heights > 0, heights - 0.5 * GRAVITY * since**2, 0.0)
    poses[..., 6] = 1.0
    return poses


def throws(hertz: float, seed: int) -> np.ndarray:
    """Poses of one ball that is thrown again and again in air, shape (throws x frames, 1, 7)."""
    rng = np.random.default_rng(seed)
    scene = Scene.from_mapping(THROWN)
    places = rng.uniform([-1.5, -0.5, 0.2], [-1.0, 0.5, 0.5], (THROWS, 3))[:, None]
    speeds = rng.uniform([2.5, -0.5, -0.5], [4.5, 0.5, 1.5], (THROWS, 3))[:, None]
    still = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (THROWS, 1, 4))
    starts = State.unchecked(places, still, speeds, np.zeros_like(places))
    laws = load_simulator()
    dt = laws.native_dt(scene)
    states = laws.rollout_samples(scene, starts, int(np.ceil(THROW / dt)) + 1)
    times = np.arange(round(THROW * hertz)) / hertz
    found, _ = Paths.of(scene, states, dt, exact=True).at(times)
    poses = np.zeros((THROWS, len(times), 1, 7))
    poses[..., :3], poses[..., 6] = found, 1.0  # rotations are not tracked
    return poses.reshape(-1, 1, 7)
