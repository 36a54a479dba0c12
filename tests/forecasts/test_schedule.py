# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stamps of predictions, and which late ones are published: no ROS, no clock."""

from __future__ import annotations

from itertools import pairwise

import pytest
from rigid_gns_core.forecasts.schedule import Grid, Pacer

ORIGIN = 1_700_000_000_123_456_789
PERIOD = 100_000_000  # [ns]


@pytest.mark.parametrize('period', [0.1, 0.1 * 0.02**0.5, 1 / 3])
def test_a_grid_does_not_drift(period: float) -> None:
    grid = Grid(ORIGIN, period)
    for _ in range(100_000):
        grid.advance()
    assert grid.stamp_ns == ORIGIN + round(100_000 * period * 1e9)


def test_a_grid_moves_on_by_whole_periods() -> None:
    grid = Grid(ORIGIN, 0.1)
    assert grid.skip_to(ORIGIN - 5) == 0
    assert grid.skip_to(ORIGIN + 86_400 * 10**9 + 1) == 864_001
    assert grid.stamp_ns == ORIGIN + 864_001 * 100_000_000
    assert grid.skip_to(grid.stamp_ns) == 0


@pytest.mark.parametrize(
    ('off', 'snapped'), [(0, True), (4_900_000, True), (-4_900_000, True), (5_100_000, False)]
)
def test_a_grid_snaps_to_near_frames_only(off: int, snapped: bool) -> None:
    grid = Grid(ORIGIN, 0.1)
    grid.skip_to(ORIGIN + 700_000_000)
    grid.snap(ORIGIN + 500_000_000 + off)
    assert grid.stamp_ns == ORIGIN + 700_000_000 + (off if snapped else 0)


def test_in_overload_all_that_is_computed_is_published() -> None:
    pacer = Pacer(PERIOD)
    # each takes three periods: prediction k is due at k periods and ready at 3 k
    assert all(pacer.admits(2 * k * PERIOD, 3 * k * PERIOD) for k in range(100))
    assert pacer.overloaded


def test_a_hiccup_is_no_overload() -> None:
    pacer = Pacer(PERIOD)
    assert all(pacer.admits(PERIOD + k, k * PERIOD) for k in range(1, 20))
    assert not pacer.overloaded


def test_a_stall_makes_no_burst() -> None:
    pacer = Pacer(PERIOD)
    now, published = 50 * PERIOD, []
    for k in range(120):  # a stall of 50 periods, then half a period for each
        now = max(now + PERIOD // 2, k * PERIOD)
        if pacer.admits(now - k * PERIOD, now):
            published.append((now, k))
    late = [now for now, k in published if now - k * PERIOD > PERIOD]
    assert len(late) > 10
    assert min(b - a for a, b in pairwise(late)) >= PERIOD
    assert not pacer.overloaded
    assert [k for _, k in published[-3:]] == [117, 118, 119]


@pytest.mark.parametrize(('stalled', 'left_out'), [(2.5, 0), (4.5, 3)])
def test_a_short_stall_is_caught_up_with(stalled: float, left_out: int) -> None:
    pacer = Pacer(PERIOD)
    assert pacer.admits(0, 0)
    now = round((1 + stalled) * PERIOD)  # those due meanwhile are ready at once after it
    admitted = [pacer.admits(now - k * PERIOD, now) for k in range(1, 6) if k * PERIOD <= now]
    assert admitted.count(False) == left_out
    assert admitted[0] and admitted[-1]


def test_three_short_stalls_in_three_seconds_are_caught_up_with() -> None:
    pacer = Pacer(PERIOD)
    stalls = [0, 1_000_000_000, 2_000_000_000, 2_500_000_000, 3_500_000_000]
    caught = [pacer.catches_up(PERIOD, at) for at in stalls]
    assert caught == [True, True, True, False, True]
    # what is in time, and what a long stall left, is not caught up with
    assert not pacer.catches_up(0, 9_000_000_000)
    assert not pacer.catches_up(4 * PERIOD, 9_000_000_000)


def test_skipped_predictions_show_overload() -> None:
    """As with `start: every`, whose stamps move on to the present and so are in time again."""
    pacer = Pacer(PERIOD)
    for k in range(20):  # one published, two left out
        assert pacer.admits(0, 3 * k * PERIOD)
        pacer.skip(2, 3 * k * PERIOD)
    assert pacer.overloaded


@pytest.mark.parametrize('lengths', [[100], [10, 10, 5, 5, 2, 2, 2]])
def test_what_a_stall_leaves_out_is_no_overload(lengths: list[int]) -> None:
    pacer = Pacer(PERIOD)
    for k, length in enumerate(lengths):
        pacer.skip(length, k * PERIOD)
    assert not pacer.overloaded


def test_what_is_left_out_now_and_then_is_no_overload() -> None:
    pacer = Pacer(PERIOD)
    for k in range(200):
        pacer.skip(1, 3 * k * PERIOD)
    assert not pacer.overloaded
