# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`start: every` where clock or computing fall behind; times are made up, so nothing waits."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from rigid_gns_core.forecasts.forecaster import Forecaster
from rigid_gns_core.forecasts.predictor import PredictionError, Predictor, Resync
from rigid_gns_core.messages.poses import PoseArrayFrame
from rigid_gns_core.scenes.scene_file import load_scene
from rigid_gns_core.tracking.window import TrackingWindow

PERIOD = 100_000_000  # [ns]
START = 1_000_000_000_000


def follower(
    warn: Callable[[str, str], None], error: Callable[[str], None]
) -> tuple[TrackingWindow, Predictor]:
    """Return a predictor that starts from each frame, and the window that it hears."""
    model = Forecaster('', load_scene('box_154'))
    window = TrackingWindow(
        frame_id='world',
        length=1,
        max_spheres=10,
        gravity=model.scene.gravity,
        max_gap=1.0,
        radius=1.0,
        check=lambda _: None,
        on_gap=lambda _: None,
    )
    resync = Resync('every')
    return window, Predictor(
        model, window, resync=resync, on_start=lambda _: None, warn=warn, error=error
    )


def test_overload_is_reported_once(falling: Callable[..., np.ndarray]) -> None:
    """One is in time and two are left out, as each starts from the newest frame."""
    errors: list[str] = []
    window, predictor = follower(lambda *_: None, errors.append)
    for index in range(40):
        now = START + 3 * index * PERIOD
        window.add(PoseArrayFrame(now, 'world', falling(0.0)), now)
        if predictor.forecast is None:
            predictor.start(now, 'first')
        predictor.compute(now)
        assert predictor.take_in_time(now + PERIOD)
    assert len(errors) == 1
    assert 'this machine cannot keep up with a prediction every 0.1 s' in errors[0]
    assert predictor.counts['skipped'] > 60


@pytest.mark.parametrize(('stalled', 'skipped'), [(1.6, 0), (2.6, 0), (6.6, 7)])
def test_no_stamp_of_a_short_stall_is_left_out(
    falling: Callable[..., np.ndarray], stalled: float, skipped: int
) -> None:
    window, predictor = follower(lambda *_: None, pytest.fail)
    stamps: list[int] = []
    now, until, next_frame = START, START + 12 * PERIOD, START
    while now < until:
        while next_frame <= now:  # frames come four times a period, those of a stall after it
            falls = falling((next_frame - START) * 1e-9)
            window.add(PoseArrayFrame(next_frame, 'world', falls), now)
            next_frame += PERIOD // 4
        if predictor.forecast is None:
            predictor.start(now, 'first')
        predictor.compute(now)
        now = max(now, predictor.due_ns)
        if (taken := predictor.take_in_time(now)) is not None:
            stamps.append(taken.stamp_ns)
        now = max(now, predictor.due_ns + PERIOD // 2)
        if len(stamps) == 3:
            now += round(stalled * PERIOD)
    assert predictor.counts['skipped'] == skipped
    assert len(stamps) == (stamps[-1] - stamps[0]) // PERIOD + 1 - skipped
    assert predictor.last_start is not None  # and each starts from the newest frame again
    assert predictor.last_start.stamp_ns > stamps[-1] - PERIOD


def test_a_tracker_whose_clock_stood_still_is_followed_again(
    falling: Callable[..., np.ndarray],
) -> None:
    warned: list[str] = []
    window, predictor = follower(lambda kind, _: warned.append(kind), pytest.fail)
    poses, pause = falling(0.0), 4_000_000_000
    ahead, steps = [], []
    for index in range(60):
        # the tracker stands still for 4 s after frame 20 and then goes on with its old time
        stamp = START + index * PERIOD
        now = stamp + (pause if index > 20 else 0)
        if index == 21:  # meanwhile the forecast goes on by itself
            for late in range(pause // PERIOD):
                predictor.compute(stamp + late * PERIOD)
                predictor.take()
        window.add(PoseArrayFrame(stamp, 'world', poses), now)
        if predictor.forecast is None:
            predictor.start(now, 'first')
        prediction = predictor.compute(now)
        predictor.take()
        ahead.append((prediction.stamp_ns - stamp) // PERIOD)
        steps.append(len(prediction.step_times))
    assert set(ahead[:21]) == {1}
    # the newest 20 frames decide, so that one late frame does not
    assert warned == ['offset']
    assert set(ahead[-15:]) == {1}
    assert max(steps[-15:]) == 1


def test_a_prediction_beyond_what_a_stamp_can_hold_is_named(
    falling: Callable[..., np.ndarray],
) -> None:
    """A message has 32 bits of seconds, which the frame's own stamp may just fit into."""
    window, predictor = follower(lambda *_: None, lambda _: None)
    last = (2**31 - 1) * 10**9 + 950_000_000
    window.add(PoseArrayFrame(last, 'world', falling(0.0)), START)
    predictor.start(START, 'first')
    with pytest.raises(PredictionError, match='2147483648.050000000 s failed: .* int32'):
        predictor.compute(START)
