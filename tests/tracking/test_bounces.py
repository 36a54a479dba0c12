# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Data association of spheres that bounce between frames."""

from __future__ import annotations

import numpy as np
import pytest
from rigid_gns_core.messages.poses import PoseArrayFrame
from rigid_gns_core.scenes.plane import Plane
from rigid_gns_core.scenes.scene import Scene
from tracking_windows import tracking_window

DT = 100_000_000  # [ns]
SCENE = Scene(surfaces=(Plane(restitution=1.0),), restitution=0.8, friction=0.0)
COUNT = 12


def height(drop: float, time: float) -> float:
    """Of a centre that starts `drop` above the floor's level of rest, in closed form."""
    speed, above = 0.0, drop
    while True:
        land = (speed + np.sqrt(speed**2 + 2 * 9.81 * above)) / 9.81
        if land >= time:
            return 1.0 + above + speed * time - 0.5 * 9.81 * time**2
        time, speed, above = time - land, 0.8 * (9.81 * land - speed), 0.0
        if speed < 0.5:
            return 1.0


@pytest.mark.parametrize('length', [2, 3, 6])
def test_spheres_that_bounce_keep_their_ids(length: int) -> None:
    """A row of spheres dropped from different heights, at 10 Hz: up to a speed of 25 m/s."""
    target = tracking_window(
        length=length,
        max_spheres=100,
        gravity=SCENE.gravity,
        max_gap=1.0,
        radius=1.0,
        scene=SCENE,
        matched=True,
    )
    rng = np.random.default_rng(4)
    drops = rng.uniform(1.0, 29.0, COUNT)
    first = None
    for index in range(60):
        shown = np.zeros((COUNT, 7))
        shown[:, 0], shown[:, 6] = 2.5 * np.arange(COUNT), 1.0
        shown[:, 2] = [height(drop, 0.1 * index) for drop in drops]
        shown[:, :3] += rng.normal(0.0, 1e-3, (COUNT, 3))
        order = rng.permutation(COUNT)
        first = order if first is None else first
        target.add(PoseArrayFrame(index * DT, 'world', shown[order]), index * DT)
    assert target.ids == tuple(range(COUNT)) and target.generation == 1
    np.testing.assert_allclose(target.start()[1].positions[:, 0], 2.5 * first, atol=0.02)
