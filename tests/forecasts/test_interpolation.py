# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import numpy as np
import pytest
from rigid_gns_core.forecasts.interpolation import interpolate
from rigid_gns_core.scenes.state import rotate_quaternions

START = 1_700_000_000_123_456_789


def test_interpolation_is_exact_on_frames_and_halves_rotations():
    stamps = np.array([START, START + 10, START + 30])
    turns = np.zeros((3, 1, 3))
    turns[:, 0, 2] = [0.0, 1.0, 3.0]
    poses = np.concatenate(
        [10 * turns, rotate_quaternions(np.tile([0.0, 0.0, 0.0, 1.0], (3, 1, 1)), turns)], axis=-1
    )
    poses[1, :, 3:] *= -1  # the same rotation
    got = interpolate(stamps, poses, stamps - np.array([0, 0, 10]))
    np.testing.assert_allclose(got[0], poses[0], atol=1e-15)
    np.testing.assert_allclose(got[1], poses[1], atol=1e-15)
    assert got[2, 0, 2] == pytest.approx(20.0)
    half = rotate_quaternions([0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 2.0])
    assert abs(got[2, 0, 3:] @ half) == pytest.approx(1.0, abs=1e-12)
