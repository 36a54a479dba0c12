# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A lost sphere, sent as NaN or at exactly the origin, costs its own pose and no other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core import Plane, Scene
from rigid_gns_core.messages.poses import PoseArrayFrame
from rigid_gns_core.scenes.state import Array
from rigid_gns_core.tracking.usable_frames import RejectedFrame
from rigid_gns_core.tracking.window import TrackingWindow
from tracking_windows import tracking_window

DT = 0.01  # [s]
SCENE = Scene(surfaces=(Plane(),), radius=0.02, mass=0.003)
VELOCITIES = np.array([[1.0, 0.0, 3.0], [0.0, -1.0, 2.0], [0.5, 0.5, 4.0]])
PLACES = np.array([[0.0, 0.0, 1.0], [1.0, 1.0, 1.5], [-1.0, 1.0, 2.0]])
LOST = {
    'NaN': np.full(7, np.nan),
    'a place of NaN': np.array([np.nan, np.nan, np.nan, 0.0, 0.0, 0.0, 1.0]),
    'the origin': np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
    'zeros': np.zeros(7),
}


def flight(time: float) -> Array:
    """Poses of three balls in free flight, shape (3, 7)."""
    fall = 0.5 * np.array(SCENE.gravity) * time**2
    return np.concatenate([PLACES + VELOCITIES * time + fall, np.tile([0, 0, 0, 1.0], (3, 1))], 1)


def window(*, matched: bool, scene: Scene = SCENE) -> TrackingWindow:
    return tracking_window(gravity=SCENE.gravity, scene=scene, matched=matched, noise=1e-4)


def add(to: TrackingWindow, frame: int, poses: Array | None = None) -> None:
    stamp = 10**9 + round(frame * DT * 1e9)
    poses = flight(frame * DT) if poses is None else poses
    to.add(PoseArrayFrame(stamp, 'world', poses), stamp)


def check(found: TrackingWindow, frame: int) -> None:
    """The start is that of the flight: exact poses, so only rounding and the prior are left."""
    state = found.start()[1]
    assert found.count == 3
    truth = flight(frame * DT)[:, :3]
    order = np.argsort(state.positions[:, 0])
    np.testing.assert_allclose(
        state.positions[order], truth[np.argsort(truth[:, 0])], rtol=0, atol=2e-4
    )
    velocities = VELOCITIES + np.array(SCENE.gravity) * frame * DT
    np.testing.assert_allclose(
        state.velocities[order], velocities[np.argsort(truth[:, 0])], rtol=0, atol=0.02
    )


@pytest.mark.parametrize('matched', [False, True])
@pytest.mark.parametrize('sent', LOST)
def test_the_others_are_tracked_on(sent: str, matched: bool) -> None:
    found = window(matched=matched)
    for frame in range(20):
        poses = flight(frame * DT)
        if frame in (9, 13, 14, 19):  # the last one too: it is coasted there
            poses[1] = LOST[sent]
        add(found, frame, poses)
        assert bool(found.lost) is (frame in (9, 13, 14, 19))
        if frame >= 5:
            check(found, frame)
    assert (found.counts['accepted'], found.counts['lost spheres']) == (20, 4)


@pytest.mark.parametrize('sent', LOST)
def test_where_the_order_counts_all_begin_together(sent: str) -> None:
    found = window(matched=False)
    poses = flight(0.0)
    poses[2] = LOST[sent]
    with pytest.raises(
        RejectedFrame, match='sphere 2 .*expected a sphere in at least 3 of the 5 frames'
    ):
        add(found, 0, poses)
    for frame in range(1, 7):
        add(found, frame)
    check(found, 6)
    for frame in range(7, 10):
        lost = flight(frame * DT)
        lost[2] = LOST[sent]
        add(found, frame, lost)
        check(found, frame)  # coasted
    with pytest.raises(RejectedFrame, match='at least 3 of the 5 frames before'):
        add(found, 10, lost)


@pytest.mark.parametrize('matched', [False, True])
def test_a_frame_without_a_pose_is_refused(matched: bool) -> None:
    found = window(matched=matched)
    for frame in range(6):
        add(found, frame)
    with pytest.raises(RejectedFrame, match='exactly the origin, where trackers put'):
        add(found, 6, np.tile(LOST['the origin'], (3, 1)))
    with pytest.raises(RejectedFrame, match=r'\(nan, .*expected finite numbers'):
        add(found, 7, np.full((3, 7), np.nan))


def test_a_marker_at_the_origin_joins_no_track() -> None:
    found = window(matched=True)
    for frame in range(12):
        poses = np.concatenate([flight(frame * DT), LOST['the origin'][None]])
        add(found, frame, poses)
    check(found, 11)


def test_a_ball_that_is_at_the_origin_is_one() -> None:
    """In the air, and from the first frame on."""
    lower = replace(SCENE, surfaces=(Plane((0.0, 0.0, -1.0)),))
    found = window(matched=False, scene=lower)
    for frame in range(6):
        poses = flight(frame * DT)
        poses[0, :3] = 0.0
        add(found, frame, poses)
    assert found.count == 3 and not found.lost


def test_a_quaternion_that_is_none_says_what_to_send() -> None:
    poses = flight(0.0)
    poses[1, 3:] = 1e9
    with pytest.raises(RejectedFrame, match='sphere 1 .*send NaN or zeros where a rotation is'):
        add(window(matched=False), 0, poses)
