# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracks that tell a fit too little are refused before it, in words."""

from __future__ import annotations

from dataclasses import replace

from launched_balls import GIVEN, launched, NOISE
import numpy as np
import pytest
from rigid_gns_core import UserError
from rigid_gns_core.data.tracks import Track
from rigid_gns_core.identification.elimination import _inverse
from rigid_gns_core.identification.learn import learn


@pytest.mark.parametrize(
    ('every', 'said'),
    [
        (36, 'show 0 stretches .* with frames at most 57 ms apart: these are 200 ms apart'),
        (11, 'shows 8 frames within 0.4 s .* import tracks with frames at most 57 ms apart'),
    ],
)
def test_frames_that_come_too_seldom_are_told(every: int, said: str) -> None:
    tracks = [
        replace(track, times=track.times[::every], positions=track.positions[::every])
        for track in launched(12)
    ]
    with pytest.raises(UserError, match=said):
        learn(tracks, GIVEN, ['0'])


def test_balls_at_rest_are_told() -> None:
    """With one deviation of noise the places of a ball at rest span five or six."""
    rng = np.random.default_rng(0)
    times = np.arange(200) / 200.0
    height = float(np.max(GIVEN.radius))
    tracks = []
    for k in range(6):
        places = [0.1 * k, 0.0, height] + rng.normal(0.0, NOISE, (200, 1, 3))
        tracks.append(Track(f'{k}', times, places, None, ('0',)))
    with pytest.raises(UserError, match='the balls stay where they are: none goes further than'):
        learn(tracks, GIVEN, ['0'])


def test_a_start_whose_slopes_leave_rounding_no_inverse_tells_nothing() -> None:
    slopes = np.array([1e14, -2e14, 3.0])
    assert _inverse(np.outer(slopes, slopes) + 1e-4 * np.eye(3)) is None
    np.testing.assert_allclose(_inverse(np.diag([2.0, 4.0])), np.diag([0.5, 0.25]))
