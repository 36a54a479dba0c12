# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compiled steps of each frame, beside what NumPy says."""

from __future__ import annotations

import numpy as np
from rigid_gns_core.scenes.state import as_unit
from rigid_gns_core.tracking.newest_frame import append_frame, is_usual
from rigid_gns_core.tracking.noise_estimate import third_differences

RNG = np.random.default_rng(3)


def test_a_frame_is_appended_with_unit_quaternions_to_the_bit() -> None:
    poses = RNG.normal(size=(6, 500, 7))
    frame = RNG.normal(size=(500, 7))
    frame[0, 3:] = 0.0  # its rotation is unknown
    frame[1:250, 3:] = as_unit(frame[1:250, 3:])  # stays as it is
    seen = RNG.random((6, 500)) < 0.8
    poses_out, seen_out = np.empty((4, 500, 7)), np.empty((4, 500), dtype=np.bool_)
    assert append_frame(frame, poses, seen, poses_out, seen_out)
    assert np.array_equal(poses_out[:3], poses[3:]) and np.array_equal(seen_out[:3], seen[3:])
    assert seen_out[3].all() and np.array_equal(poses_out[3, :, :3], frame[:, :3])
    assert not poses_out[3, 0, 3:].any()
    assert np.array_equal(poses_out[3, 1:, 3:], as_unit(frame[1:, 3:]))


def test_a_frame_that_was_not_measured_as_a_whole_is_not_appended() -> None:
    poses, seen = np.ones((3, 2, 7)), np.ones((3, 2), dtype=np.bool_)
    for lost in (np.nan, np.inf, 0.0):
        frame = np.ones((2, 7))
        frame[1] = lost
        assert not append_frame(frame, poses, seen, poses.copy(), seen.copy())


def test_usual_poses_are_within_the_bound_and_at_no_zero() -> None:
    usual = np.full((3, 7), -2.0)
    assert is_usual(usual, 2.0) and not is_usual(usual, 1.9)
    assert not is_usual(usual[:0], 2.0)
    for value in (np.nan, np.inf, 0.0):
        odd = usual.copy()
        odd[2, 1] = value
        assert not is_usual(odd, 2.0)
    unturned = usual.copy()
    unturned[:, 3:] = 0.0
    assert is_usual(unturned, 2.0)


def test_third_differences_are_those_of_the_definition() -> None:
    times = np.array([-0.0131, -0.0083, -0.0042, 0.0])
    places, seen = RNG.normal(size=(4, 5, 7)), np.ones((4, 5), dtype=np.bool_)
    seen[2, 3] = False
    factors = 1.0 / (times[:, None] - times + np.eye(4)).prod(axis=1)
    factors /= np.linalg.norm(factors)
    expected = np.einsum('f,fnc->nc', factors, places[:, [0, 1, 2, 4], :3]).ravel()
    found = third_differences(times, places, seen)
    # rounding of sums of four numbers of about 1
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-14)
