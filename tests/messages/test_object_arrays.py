# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages of named objects; tests/ros/simulator/test_tracker_kinds.py has those of ROS itself."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
from rigid_gns_core.messages.cdr import MessageError, Writer
from rigid_gns_core.messages.object_arrays import OBJECT_ARRAYS, pose_array_of_objects
from rigid_gns_core.messages.poses import decode_pose_array

STAMP = 1_700_000_000_123_456_789
NAMES = ('a', 'ball', 'ball')  # the first of a name is taken
POSES = np.random.default_rng(0).normal(size=(3, 7))


def message(kind: str) -> bytes:
    """Three objects, written field by field."""
    to = Writer()
    to.header(STAMP, 'lab')
    if kind.startswith('mocap4r2'):
        to.numbers('I', 7)
    to.numbers('I', len(NAMES))
    for name, pose in zip(NAMES, POSES, strict=True):
        if kind.endswith('Detection3DArray'):
            to.header(STAMP, 'lab')
            to.numbers('I', 0)
            to.floats([*pose, 0.1, 0.1, 0.1])
            to.text('id', name)
        elif kind.endswith('Markers'):
            to.numbers('b', 2)
            to.numbers('i', 5)
            to.text('marker_name', name)
            to.floats(pose[:3])
        else:
            to.text('name', name)
            if kind.endswith('RigidBodies'):
                to.numbers('I', 0)
            to.floats(pose)
    return to.cdr


@pytest.mark.parametrize('kind', OBJECT_ARRAYS)
def test_all_in_their_order_or_those_that_are_named(kind: str) -> None:
    cdr = message(kind)
    frame = decode_pose_array(pose_array_of_objects(cdr, kind))
    assert (frame.stamp_ns, frame.frame_id) == (STAMP, 'lab')
    np.testing.assert_array_equal(frame.poses[:, :3], POSES[:, :3])
    if not kind.endswith('Markers'):
        np.testing.assert_array_equal(frame.poses, POSES)
    named = decode_pose_array(pose_array_of_objects(cdr, kind, ('ball', 'lost', 'a'))).poses
    np.testing.assert_array_equal(named[[0, 2], :3], POSES[[1, 0], :3])
    assert np.isnan(named[1, :3]).all()


@pytest.mark.parametrize('kind', OBJECT_ARRAYS)
def test_damaged_bytes_never_raise_anything_else(kind: str) -> None:
    rng, whole = np.random.default_rng(0), message(kind)
    for length in range(len(whole) - 4):
        with pytest.raises(MessageError):
            pose_array_of_objects(whole[:length], kind)
    for _ in range(300):
        damaged = bytearray(whole)
        for place in rng.integers(len(damaged), size=3):
            damaged[place] = rng.integers(256)
        with contextlib.suppress(MessageError):
            pose_array_of_objects(bytes(damaged), kind)
