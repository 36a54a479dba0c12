# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Balls that come one by one are put together by their stamps."""

from __future__ import annotations

import numpy as np
from rigid_gns_core.messages.poses import decode_pose_array
from rigid_gns_core.tracking.single_balls import SAME_NS, SingleBalls

STAMP = 10**18


def poses(count: int) -> np.ndarray:
    return np.random.default_rng(count).normal(size=(count, 7))


def test_a_frame_is_complete_with_its_last_ball() -> None:
    balls, own = SingleBalls(3), poses(3)
    assert balls.add(2, STAMP + SAME_NS, 'lab', own[2]) is None
    assert balls.add(0, STAMP, 'lab', own[0]) is None
    found = decode_pose_array(balls.add(1, STAMP, 'lab', own[1]))
    assert (found.frame_id, found.stamp_ns) == ('lab', STAMP + SAME_NS)
    np.testing.assert_array_equal(found.poses, own)


def test_a_missing_ball_is_nan_when_the_next_frame_begins() -> None:
    for stamp, ball, frame_id in (
        (STAMP + SAME_NS + 1, 0, 'lab'),  # another time
        (STAMP, 1, 'lab'),  # the same ball again
        (STAMP, 0, 'other'),  # another coordinate frame
    ):
        balls, own = SingleBalls(2), poses(2)
        assert balls.add(1, STAMP, 'lab', own[1]) is None
        found = decode_pose_array(balls.add(ball, stamp, frame_id, own[0]))
        assert found.stamp_ns == STAMP
        assert np.isnan(found.poses[0, :3]).all()
        np.testing.assert_array_equal(found.poses[1], own[1])


def test_a_single_ball_is_a_frame_at_once() -> None:
    balls, own = SingleBalls(1), poses(3)
    for k, pose in enumerate(own):
        found = decode_pose_array(balls.add(0, STAMP + k, 'lab', pose))
        assert found.stamp_ns == STAMP + k
        np.testing.assert_array_equal(found.poses, pose[None])


def test_a_frame_that_waits_is_dropped_where_stamps_go_back() -> None:
    """As where a bag is played again: it would make all frames after it late ones."""
    balls, own = SingleBalls(2), poses(2)
    assert balls.add(1, STAMP, 'lab', own[1]) is None
    assert balls.add(0, STAMP - 2 * 10**9, 'lab', own[0]) is None
    found = decode_pose_array(balls.add(1, STAMP - 2 * 10**9, 'lab', own[1]))
    assert found.stamp_ns == STAMP - 2 * 10**9
    np.testing.assert_array_equal(found.poses, own)
