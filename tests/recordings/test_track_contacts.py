# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contacts that a track shows, where samples are few or contacts close to each other."""

from __future__ import annotations

import numpy as np
import pytest
from rigid_gns_core.data.tracks import Track
from rigid_gns_core.recordings.scoring.track_contacts import contacts_of
from rigid_gns_core.scenes.plane import Plane
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.scenes.state import Array

RADIUS, NOISE = 0.03, 0.3e-3
# of the walls at x = 0 and y = 0
RESTITUTION = 0.7
SCENE = Scene(
    radius=RADIUS, surfaces=(Plane(), Plane(normal=(1.0, 0.0, 0.0)), Plane(normal=(0.0, 1.0, 0.0)))
)


def walk(times: Array, hits: tuple[float, float], velocity: tuple[float, float]) -> Array:
    """Places of a ball that meets each wall at a time of its own [s], without friction."""
    places = np.full((len(times), 3), RADIUS)
    for axis in range(2):
        since = times - hits[axis]
        kept = np.where(since > 0, RESTITUTION, -1.0)
        places[:, axis] += velocity[axis] * kept * since
    return places + np.random.default_rng(0).normal(0.0, NOISE, places.shape)


def found(times: Array, places: Array) -> Array:
    track = Track('0', times, places[:, None], None, ('0',))
    return contacts_of(track, SCENE, np.array([RADIUS]), NOISE)[0]


@pytest.mark.parametrize('apart', [2, 3, 4])
def test_both_walls_of_a_corner_count(apart: int) -> None:
    """Steps of 1.5 cm at 50 Hz: each of the two spoils the samples of the other."""
    times = np.arange(40) / 50.0
    hits = (0.41, 0.41 + apart / 50.0)
    assert found(times, walk(times, hits, (0.75, 0.75))) == pytest.approx(hits, abs=1e-9)


def test_a_slow_ball_that_is_seldom_seen_is_seen_to_turn() -> None:
    """A tracker that reports a ball every 8 cm: three samples of it are 0.16 s."""
    before, after = np.arange(0.0, 0.81, 0.04), np.arange(0.88, 1.6, 0.08)
    times = np.concatenate([before, after])
    places = walk(times, (0.84, 10.0), (0.5, 0.1))
    assert found(times, places) == pytest.approx([0.84], abs=1e-9)


def test_a_ball_that_turns_before_a_wall_does_not_count() -> None:
    """It is drawn back as by a slope: it comes to 10 mm from the wall at 1 m/s^2."""
    times = np.arange(100) / 50.0
    places = np.full((100, 3), RADIUS)
    places[:, 0] += 0.01 + 0.5 * (times - 1.0) ** 2
    places[:, 1] += 1.0
    places += np.random.default_rng(0).normal(0.0, NOISE, places.shape)
    assert len(found(times, places)) == 0
