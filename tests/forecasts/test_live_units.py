# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Live poses in other units or axes: said as import and evaluation say it, and else nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core import Scene
from rigid_gns_core.data.tracks import Track
from rigid_gns_core.forecasts.live_units import LiveUnits
from rigid_gns_core.messages.poses import PoseArrayFrame
from rigid_gns_core.recordings.units import check_fall

BALL = Scene(radius=0.02, mass=0.0027)
G = 9.81


def bouncing(times: np.ndarray, height: float = 1.0) -> np.ndarray:
    """Centres of a ball that bounces without loss, and drifts along x, shape (k, 3)."""
    fall = np.sqrt(2 * height / G)
    since = (times + fall) % (2 * fall) - fall  # around each highest point
    return np.stack([0.5 * times, 0.0 * times, height - 0.5 * G * since**2], axis=1)


def frames(places: np.ndarray, rate: float) -> list[PoseArrayFrame]:
    """Frames of one ball."""
    turned = np.array([0.0, 0.0, 0.0, 1.0])
    poses = np.concatenate([places, np.tile(turned, (len(places), 1))], axis=1)
    return [
        PoseArrayFrame(round(1e9 * k / rate), 'world', pose[None]) for k, pose in enumerate(poses)
    ]


def said(scene: Scene, places: np.ndarray, rate: float, noise: float = 1e-4) -> set[str]:
    units = LiveUnits(scene, matched=False)
    return {units.take(frame, lambda: noise) for frame in frames(places, rate)} - {''}


@pytest.mark.parametrize('rate', [30.0, 120.0, 240.0])
@pytest.mark.parametrize(
    ('scene', 'factor', 'axes', 'text'),
    [
        (BALL, 1000.0, (0, 1, 2), 'positions seem to be in millimetres'),
        (BALL, 100.0, (0, 1, 2), 'positions seem to be in centimetres'),
        (BALL, 1.0, (0, 2, 1), 'balls fall along'),
        (replace(BALL, gravity=0.0), 1.0, (0, 1, 2), 'the scene has no gravity'),
    ],
)
def test_units_and_axes_are_told_as_by_import(
    rate: float, scene: Scene, factor: float, axes: tuple[int, ...], text: str
) -> None:
    times = np.arange(round(3 * rate)) / rate
    noise = np.random.default_rng(0).normal(0.0, 1e-4, (len(times), 3))
    places = factor * (bouncing(times) + noise)[:, axes]
    warnings = said(scene, places, rate, factor * 1e-4)
    assert warnings and all(text in warning for warning in warnings), warnings
    track = Track('a', times, places[:, None], None, ('0',))
    with pytest.raises(ValueError, match=text):
        check_fall([track], scene, factor * 1e-4, 'file')


@pytest.mark.parametrize('rate', [10.0, 30.0, 240.0])
@pytest.mark.parametrize('smash', [0.0, 10.5, 18.0, 25.0])
def test_a_ball_in_metres_is_not_spoken_of(rate: float, smash: float) -> None:
    """Drag slows a smash by up to seven times gravity, and along its path."""
    times = np.arange(round(4 * rate)) / rate
    places = bouncing(times)
    if smash:
        places[:, 0] = np.log1p(0.11 * smash * times) / 0.11
    noise = np.random.default_rng(1).normal(0.0, 1e-3, places.shape)
    assert said(BALL, places + noise, rate, 1e-3) == set()


def test_a_ball_that_rolls_in_millimetres_is_too_fast() -> None:
    times = np.arange(240) / 120.0
    places = 1000.0 * np.stack([times, 0.0 * times, 0.0 * times + 0.02], axis=1)
    (warning,) = said(BALL, places, 120.0, 0.1)
    assert warning.startswith('balls move with 1000 m/s, expected under 100 m/s')


def test_the_search_ends_where_everything_fits() -> None:
    units = LiveUnits(BALL, matched=False)
    times = np.arange(5000) / 240.0
    for frame in frames(bouncing(times), 240.0):
        assert units.take(frame, lambda: 1e-4) == ''
    for frame in frames(1000.0 * bouncing(times[:500]), 240.0):
        # of a tracker that changes its units nobody knows
        assert units.take(frame, lambda: 0.1) == ''
    units.clear()
    assert any(units.take(frame, lambda: 0.1) for frame in frames(1000.0 * bouncing(times), 240.0))
