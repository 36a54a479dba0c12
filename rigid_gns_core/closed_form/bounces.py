# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Effective restitution of dropped spheres, measured from states that may be far apart in time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..scenes.scene import Plane, Scene
from ..scenes.state import Array, State, Trajectory

Simulate = Callable[[Scene, State, int, float], Trajectory]
GRAVITY = 9.81


def bounces(
    simulate: Simulate, radius: float, restitutions: Array, drops: Array, phases: int = 4
) -> tuple[Array, Array]:
    """Effective restitution of spheres dropped on a level floor.

    Args:
        simulate: The engine.
        radius: Radius [m]; drop heights are multiples of it.
        restitutions: Of the pair, shape (restitutions,).
        drops: Heights of the spheres above the floor, in radii, shape (drops,).
        phases: Drops of each height, each 1.3 % higher than the last, so that the impacts are at
            different moments of a time step.

    Returns:
        Two arrays (restitutions, drops, phases). The first holds the ratio of the speeds at the
        instant of impact, where the parabolas before and after it meet: the law of impact. The
        second, from the energy above the floor, tells how high the sphere rises: it also counts
        that the impact takes place a little too deep.
    """
    heights = drops[:, None] * (1.0 + 0.013 * np.arange(phases)) * radius
    shape = (len(restitutions), *heights.shape)
    height = np.broadcast_to(heights, shape).ravel()
    pair = np.broadcast_to(restitutions[:, None, None], shape).ravel()
    count = len(height)
    side = int(np.ceil(np.sqrt(count)))
    places = 10.0 * radius * np.stack(np.divmod(np.arange(count), side), axis=-1)
    dt = 0.1 * np.sqrt(radius)
    fall = np.sqrt(2.0 * height / GRAVITY)
    trajectory = simulate(
        Scene(surfaces=(Plane(restitution=1.0),), radius=radius, restitution=tuple(pair)),
        State(positions=np.c_[places, height + radius]),
        int(fall.max() / dt) + 2,
        dt,
    )
    above = trajectory.positions[..., 2] - radius
    speed = trajectory.velocities[..., 2]
    total = 0.5 * speed**2 + GRAVITY * above
    at_impact, rise = np.full(count, np.nan), np.full(count, np.nan)
    for i in range(count):
        bounced = np.flatnonzero(total[:, i] < total[0, i] * (1.0 - 0.5 * (1.0 - pair[i] ** 2)))
        if not len(bounced):
            continue
        k, t = bounced[0], trajectory.times[bounced[0]]
        rise[i] = np.sqrt(max(total[k, i], 0.0) / total[0, i])
        # h - g t^2/2 = z + v (t - t_k) - g (t - t_k)^2/2
        slope = speed[k, i] + GRAVITY * t
        meet = (height[i] - above[k, i] + speed[k, i] * t + 0.5 * GRAVITY * t**2) / slope
        at_impact[i] = (speed[k, i] - GRAVITY * (meet - t)) / (GRAVITY * meet)
    return at_impact.reshape(shape), rise.reshape(shape)
