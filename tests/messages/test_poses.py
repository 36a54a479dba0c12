# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import contextlib
import struct

import numpy as np
import pytest
from rigid_gns_core.messages.poses import (
    decode_float64,
    decode_pose_array,
    decode_string,
    encode_float64,
    encode_string,
    MessageError,
    PoseArrayCodec,
    restamped,
)

# every residue of the length modulo 8, since padding depends on it; empty; UTF-8
FRAMES = ['', 'w', 'wo', 'wor', 'worl', 'world', 'world_', 'worlds_', 'Kugeln_äöü', '球']
COUNTS = [0, 1, 2, 5, 154]
STAMP = 1_700_000_000_123_456_789


def make_poses(count: int) -> np.ndarray:
    return np.random.default_rng(count).normal(size=(count, 7))


def big_endian(frame_id: str, poses: np.ndarray, stamp_ns: int) -> bytes:
    """Return the same message as a big-endian machine would write it, field by field."""
    text = frame_id.encode() + b'\0'
    body = struct.pack('>iII', *divmod(stamp_ns, 10**9), len(text)) + text
    body += bytes(-len(body) % 4) + struct.pack('>I', len(poses))
    if len(poses):
        body += bytes(-len(body) % 8) + poses.astype('>f8').tobytes()
    return b'\0\0\0\0' + body


@pytest.mark.parametrize('frame_id', FRAMES)
@pytest.mark.parametrize('count', COUNTS)
def test_pose_array_round_trip_in_both_byte_orders(frame_id, count):
    poses = make_poses(count)
    little = PoseArrayCodec(frame_id, count).encode(poses, STAMP)
    for cdr in (little, big_endian(frame_id, poses, STAMP)):
        frame = decode_pose_array(cdr)
        assert (frame.stamp_ns, frame.frame_id) == (STAMP, frame_id)
        assert frame.poses.dtype == np.float64
        np.testing.assert_array_equal(frame.poses, poses)
        frame.poses[:] = 0.0  # a copy of its own: writable


@pytest.mark.parametrize('shift', [0, -20_000_001, -STAMP, 10**9])
def test_a_stamp_is_moved_in_both_byte_orders_and_nothing_else(shift):
    poses = make_poses(3)
    for cdr in (PoseArrayCodec('w', 3).encode(poses, STAMP), big_endian('w', poses, STAMP)):
        moved = restamped(cdr, shift)
        assert decode_pose_array(moved).stamp_ns == STAMP + shift
        assert moved[:4] + moved[12:] == cdr[:4] + cdr[12:]
    for bad in (b'', cdr[:10]):
        with pytest.raises(MessageError):
            restamped(bad, 1)


def test_encoding_is_deterministic_and_its_padding_zero():
    poses = np.full((1, 7), np.nan)
    cdr = PoseArrayCodec('wo', 1).encode(poses, -1)
    # header 4, stamp 8, length 4, 'wo\0', 1 of padding, count 4, 4 of padding, 7 float64
    assert cdr[4:12] == struct.pack('<iI', -1, 999_999_999)
    assert cdr[12:28] == b'\x03\0\0\0wo\0\0\x01\0\0\0\0\0\0\0'
    assert len(cdr) == 84
    assert PoseArrayCodec('wo', 1).encode(poses, -1) == cdr


def test_encoding_takes_any_layout_but_only_the_right_shape():
    codec = PoseArrayCodec('world', 3)
    poses = make_poses(3)
    expected = codec.encode(poses, 0)
    assert codec.encode(np.asfortranarray(poses), 0) == expected
    assert codec.encode(poses.tolist(), 0) == expected
    for wrong in (poses[:1], poses[0], make_poses(4), poses[:, :6]):
        with pytest.raises(MessageError, match='shape'):
            codec.encode(wrong, 0)
    with pytest.raises(MessageError, match='int32'):
        codec.encode(poses, 2**31 * 10**9)
    with pytest.raises(MessageError, match='NUL'):
        PoseArrayCodec('a\0b', 3)
    with pytest.raises(MessageError, match='UTF-8'):
        PoseArrayCodec('\udc80', 3)


@pytest.mark.parametrize('order', ['little', 'big'])
@pytest.mark.parametrize('count', [0, 1, 3])
def test_every_truncation_and_extension_is_refused(order, count):
    poses = make_poses(count)
    if order == 'little':
        cdr = PoseArrayCodec('world', count).encode(poses, STAMP)
    else:
        cdr = big_endian('world', poses, STAMP)
    for length in range(len(cdr)):
        with pytest.raises(MessageError):
            decode_pose_array(cdr[:length])
    for extra in range(1, 4):  # middleware may pad to four bytes
        assert len(decode_pose_array(cdr + bytes(extra)).poses) == count
    with pytest.raises(MessageError, match='after the last field'):
        decode_pose_array(cdr + bytes(4))


def test_damaged_bytes_are_refused_by_name():
    cdr = PoseArrayCodec('world', 2).encode(make_poses(2), STAMP)

    def patched(offset: int, patch: bytes) -> bytes:
        return cdr[:offset] + patch + cdr[offset + len(patch) :]

    for offset, patch, reason in [
        (0, b'\x01', 'encapsulation'),
        (1, b'\x07', 'encapsulation'),
        (8, b'\xff\xff\xff\xff', 'nanosec'),
        (12, b'\xff\xff\xff\xff', 'frame_id has 4294967295 bytes'),
        (12, b'\x05\0\0\0', 'NUL'),
        (17, b'\0', 'NUL'),
        (16, b'\xff', 'UTF-8'),
        (24, b'\xff\xff\xff\xff', '4294967295 poses'),
        (24, b'\x03\0\0\0', '3 poses need'),
        (24, b'\x01\0\0\0', 'after the last field'),
    ]:
        with pytest.raises(MessageError, match=reason):
            decode_pose_array(patched(offset, patch))


def test_random_bytes_never_raise_anything_else():
    rng = np.random.default_rng(0)
    whole = PoseArrayCodec('world', 2).encode(make_poses(2), STAMP)
    for _ in range(3000):
        damaged = bytearray(whole[: rng.integers(len(whole) + 1)])
        for place in rng.integers(max(len(damaged), 1), size=3):
            if damaged:
                damaged[place] = rng.integers(256)
        for decode in (decode_pose_array, decode_string, decode_float64):
            with contextlib.suppress(MessageError):
                decode(bytes(damaged))


@pytest.mark.parametrize('text', ['', 'a', 'abc', 'abcd', '{"π": [1, 2]}', 'x' * 100_000])
def test_string_round_trip(text):
    cdr = encode_string(text)
    assert decode_string(cdr) == text
    with pytest.raises(MessageError):
        decode_string(cdr[:-1])


def test_empty_string_without_its_nul_is_read():
    assert decode_string(b'\0\x01\0\0\0\0\0\0') == ''


@pytest.mark.parametrize('value', [0.0, -1.5e-3, float('inf')])
def test_float64_round_trip(value):
    cdr = encode_float64(value)
    assert decode_float64(cdr) == value
    assert decode_float64(b'\0\0\0\0' + struct.pack('>d', value)) == value
    with pytest.raises(MessageError, match='cut short in data'):
        decode_float64(cdr[:-1])


@pytest.mark.parametrize('frame_id', FRAMES)
def test_rclpy_and_the_codec_read_each_other(frame_id):
    pytest.importorskip('rclpy', reason='ROS is not installed')
    from geometry_msgs.msg import Point, Pose, PoseArray, Quaternion
    from rclpy.serialization import deserialize_message, serialize_message
    from std_msgs.msg import Float64, String

    for count in COUNTS:
        poses = make_poses(count)
        message = PoseArray()
        message.header.frame_id = frame_id
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(STAMP, 10**9)
        message.poses = [
            Pose(
                position=Point(**dict(zip('xyz', row[:3].tolist(), strict=True))),
                orientation=Quaternion(**dict(zip('xyzw', row[3:].tolist(), strict=True))),
            )
            for row in poses
        ]
        cdr = PoseArrayCodec(frame_id, count).encode(poses, STAMP)
        assert deserialize_message(cdr, PoseArray) == message
        theirs = serialize_message(message)
        assert len(theirs) == len(cdr)  # bytes differ: rclpy leaves padding uninitialised
        frame = decode_pose_array(theirs)
        assert (frame.stamp_ns, frame.frame_id) == (STAMP, frame_id)
        np.testing.assert_array_equal(frame.poses, poses)
    assert deserialize_message(encode_string(frame_id), String).data == frame_id
    assert decode_string(serialize_message(String(data=frame_id))) == frame_id
    assert deserialize_message(encode_float64(0.1), Float64).data == 0.1
    assert decode_float64(serialize_message(Float64(data=0.1))) == 0.1


def test_a_rotation_that_is_unknown_is_zero():
    poses = make_poses(5)
    poses[1, 3:], poses[2, 6], poses[3, 3:], poses[4, :3] = np.nan, np.inf, 1e-9, np.nan
    frame = decode_pose_array(PoseArrayCodec('world', 5).encode(poses, STAMP))
    np.testing.assert_array_equal(frame.poses[1:4, 3:], 0.0)
    poses[1:4, 3:] = 0.0
    np.testing.assert_array_equal(frame.poses, poses)
