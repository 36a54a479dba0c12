# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages of any content come back as they were; any bytes are a message or an error."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest

pytest.importorskip('hypothesis')

from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rigid_gns_core.messages.poses import (
    decode_float64,
    decode_pose_array,
    decode_string,
    encode_float64,
    encode_string,
    MessageError,
    PoseArrayCodec,
)
from rigid_gns_core.messages.trajectories import decode_trajectory, encode_trajectory

# the same examples each time, and none that depends on how fast this machine is
every_time = settings(derandomize=True, deadline=None, max_examples=60)
TEXT = st.text(st.characters(exclude_characters='\0', exclude_categories=['Cs']), max_size=40)
STAMP = st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1)
FLOAT = st.floats(width=64)
DECODERS = (decode_pose_array, decode_trajectory, decode_string, decode_float64)


@every_time
@given(STAMP, TEXT, st.integers(0, 5).flatmap(lambda n: arrays('f8', (n, 7), elements=FLOAT)))
def test_a_pose_array_comes_back(stamp: int, frame_id: str, poses: np.ndarray) -> None:
    cdr = PoseArrayCodec(frame_id, len(poses)).encode(poses, stamp)
    found = decode_pose_array(cdr)
    assert (found.stamp_ns, found.frame_id) == (stamp, frame_id)
    known = np.isfinite(poses[:, 3:]).all(axis=1) & (np.abs(poses[:, 3:]) > 1e-6).any(axis=1)
    poses[~known, 3:] = 0.0
    assert np.array_equal(found.poses, poses, equal_nan=True)
    for cut in range(len(cdr)):
        with pytest.raises(MessageError):
            decode_pose_array(cdr[:cut])


@every_time
@given(STAMP, st.lists(TEXT, max_size=3), st.lists(STAMP, max_size=3), st.data())
def test_a_trajectory_comes_back(
    stamp: int, names: list[str], times: list[int], data: st.DataObject
) -> None:
    shape = len(times), len(names)
    poses = data.draw(arrays('f8', (*shape, 7), elements=FLOAT))
    twists = data.draw(arrays('f8', (*shape, 6), elements=FLOAT))
    found = decode_trajectory(encode_trajectory(stamp, 'world', names, times, poses, twists))
    assert (found.stamp_ns, found.names, found.times_ns) == (stamp, tuple(names), tuple(times))
    assert np.array_equal(found.poses, poses, equal_nan=True)
    assert np.array_equal(found.twists, twists, equal_nan=True)


@every_time
@given(TEXT, FLOAT)
def test_a_text_and_a_number_come_back(text: str, value: float) -> None:
    assert decode_string(encode_string(text)) == text
    assert np.array_equal(decode_float64(encode_float64(value)), value, equal_nan=True)


@every_time
@given(st.sampled_from(DECODERS), st.sampled_from([b'', b'\0\1\0\0', b'\0\0\0\0']), st.binary())
def test_any_bytes_are_a_message_or_an_error(decode, head: bytes, rest: bytes) -> None:
    with suppress(MessageError):
        decode(head + rest)
