# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Transforms between coordinate frames, against rotation matrices of SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from rigid_gns_core.messages.poses import PoseArrayFrame
from rigid_gns_core.messages.transforms import Transform
from rigid_gns_core.scenes.state import Array
from rigid_gns_core.tracking.transform_buffer import NoTransform, TransformBuffer
from scipy.spatial.transform import Rotation

S = 1_000_000_000  # [ns]
STAMP = 1_700_000_000 * S
CLOSE = 1e-12  # rounding of some products of numbers near 1


def pose(rng: np.random.Generator) -> Array:
    turn = rng.normal(size=4)  # of any rotation with equal probability
    return np.concatenate([rng.normal(size=3), turn / np.linalg.norm(turn)])


def matrix(place: Array) -> Array:
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = Rotation.from_quat(place[3:]).as_matrix(), place[:3]
    return found


def edge(child: str, parent: str, place: Array, stamp: int = STAMP) -> Transform:
    return Transform(stamp, parent, child, place)


def check(found: Array, expected: Array) -> None:
    np.testing.assert_allclose(matrix(found), expected, rtol=0, atol=CLOSE)


def test_chains_go_through_the_nearest_common_frame() -> None:
    rng = np.random.default_rng(0)
    robot, camera, lens, rail = (pose(rng) for _ in range(4))
    buffer = TransformBuffer()
    static = [
        edge('robot', 'map', robot), edge('camera', 'robot', camera), edge('/lens', 'camera', lens)
    ]  # fmt: skip
    assert buffer.add([*static, edge('rail', 'map', rail)], static=True) == ''
    to_map = matrix(robot) @ matrix(camera) @ matrix(lens)
    check(buffer.lookup('map', 'lens', 0), to_map)
    check(buffer.lookup('lens', 'map', 0), np.linalg.inv(to_map))
    check(buffer.lookup('rail', 'lens', 5), np.linalg.inv(matrix(rail)) @ to_map)
    check(buffer.lookup('robot', 'lens', 5), matrix(camera) @ matrix(lens))
    check(buffer.lookup('map', '/map', 5), np.eye(4))


def test_between_two_times_it_moves_evenly() -> None:
    rng = np.random.default_rng(1)
    first, turn = pose(rng), np.array([0.3, -0.8, 0.5])
    last = first.copy()
    last[:3] += [1.0, 2.0, -1.0]
    last[3:] = -(Rotation.from_rotvec(turn) * Rotation.from_quat(first[3:])).as_quat()
    buffer = TransformBuffer()
    for place, stamp in ((last, STAMP + S), (first, STAMP)):
        buffer.add([edge('camera', 'world', place, stamp)], static=False)
    for share in (0.0, 0.25, 0.9, 1.0):
        found = buffer.lookup('world', 'camera', STAMP + round(share * S))
        expected = matrix(first)
        expected[:3, :3] = Rotation.from_rotvec(share * turn).as_matrix() @ expected[:3, :3]
        expected[:3, 3] += share * np.array([1.0, 2.0, -1.0])
        check(found, expected)
    for stamp, may_come, said in (
        (STAMP + S + S // 10, True, "'camera' in 'world' .* newest on /tf is 0.1 s older"),
        (STAMP - S // 10, False, 'oldest on /tf is 0.1 s newer'),
    ):
        with pytest.raises(NoTransform, match=said) as error:
            buffer.lookup('world', 'camera', stamp)
        assert error.value.may_come is may_come


def test_what_is_absent_names_both_frames_and_the_remedy() -> None:
    buffer = TransformBuffer()
    buffer.add([edge('camera', 'map', pose(np.random.default_rng(2)))], static=True)
    said = (
        "its frame is 'camera', expected 'world' .*static_transform_publisher .*--frame-id world "
        '--child-frame-id camera'
    )
    with pytest.raises(NoTransform, match=said) as error:
        buffer.lookup('world', 'camera', 0)
    assert error.value.may_come
    circle = [edge('a', 'b', pose(np.random.default_rng(3))), edge('b', 'a', np.eye(7)[6])]
    buffer.add(circle, static=True)
    with pytest.raises(NoTransform):
        buffer.lookup('world', 'a', 0)


def test_poses_of_a_frame_lost_and_without_rotation() -> None:
    rng = np.random.default_rng(4)
    camera = pose(rng)
    buffer = TransformBuffer()
    buffer.add([edge('camera', 'world', camera)], static=True)
    poses = np.stack([pose(rng) for _ in range(4)])
    poses[1, 3:], poses[2, :3], poses[3, :3] = 0.0, np.nan, 0.0
    found = buffer.in_frame(PoseArrayFrame(STAMP, 'camera', poses), 'world')
    assert (found.stamp_ns, found.frame_id) == (STAMP, 'world')
    check(found.poses[0], matrix(camera) @ matrix(poses[0]))
    np.testing.assert_array_equal(found.poses[1, 3:], 0.0)
    assert np.isnan(found.poses[2:, :3]).all()  # also the marker at exactly the origin


def test_what_cannot_be_used_is_named_and_the_rest_is_taken() -> None:
    rng = np.random.default_rng(5)
    good = edge('camera', 'world', pose(rng))
    for bad, said in (
        (edge('camera', 'camera', pose(rng)), 'two names'),
        (edge('', 'world', pose(rng)), 'two names'),
        (edge('b', 'world', np.full(7, np.nan)), 'expected numbers and a rotation'),
        (edge('b', 'world', np.zeros(7)), 'expected numbers and a rotation'),
    ):
        buffer = TransformBuffer()
        assert said in buffer.add([bad, good], static=True)
        check(buffer.lookup('world', 'camera', 0), matrix(good.pose))


def test_old_ones_are_dropped_and_static_ones_outlive_a_clock_that_goes_back() -> None:
    buffer = TransformBuffer(cache_ns=S)
    for step in range(500):
        place = np.array([float(step), 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        buffer.add([edge('ball', 'world', place, STAMP + step * S // 100)], static=False)
    buffer.add([edge('camera', 'world', np.eye(7)[6])], static=True)
    assert buffer.lookup('world', 'ball', STAMP + 400 * S // 100)[0] == 400.0
    with pytest.raises(NoTransform, match='oldest'):
        buffer.lookup('world', 'ball', STAMP + 300 * S // 100)
    buffer.clear()
    with pytest.raises(NoTransform, match='tell no transform'):
        buffer.lookup('world', 'ball', STAMP + 499 * S // 100)
    check(buffer.lookup('world', 'camera', 0), np.eye(4))
