# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A table tennis ball of unknown spin through the real node: futures, and their bytes again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.bags.topics import find_topics
from rigid_gns_core.messages.trajectories import decode_trajectory
from rigid_gns_core.prediction.load import load_simulator
from rigid_gns_core.recordings.scoring.reproduce import reproduce
from rigid_gns_core.scenes.scene_file import load_scene
from rigid_gns_core.tracking import estimate_state

T0 = 1_000_123_456_789  # [ns], as in conftest.py
RATE, NOISE, FRAMES = 180.0, 1e-3, 60


def test_futures_are_those_of_estimate_state_and_the_bag_reproduces(
    simulated: Callable[..., Any], tmp_path: Path
) -> None:
    """Position only, 180 Hz, 1 mm; 0.3 s on, past a bounce, beside a start without air."""
    scene, simulator = load_scene('table_tennis'), load_simulator()
    truth = simulator.rollout(
        scene, [[-1.3, 0.0, 0.25]], [[5.0, 0.3, 1.5]], [[10.0, 150.0, 20.0]], steps=60
    )
    stamps = [round(k / RATE * 1e9) for k in range(FRAMES)]
    rng = np.random.default_rng(3)
    times, at = np.arange(FRAMES) / RATE, truth.dt * np.arange(61)
    places = np.stack([np.interp(times, at, truth.positions[:, 0, c]) for c in range(3)], axis=1)
    # between steps a parabola, not a chord
    inside = times % truth.dt
    places[:, 2] += 0.5 * 9.81 * inside * (truth.dt - inside)
    places += rng.normal(0.0, NOISE, places.shape)
    setup = simulated(
        scene='table_tennis', start='every', velocity_window=6, horizon=0.35,
        tracking_noise=NOISE, record=str(tmp_path / 'bag'),
    )  # fmt: skip
    turn = [0.0, 0.0, 0.0, 1.0]
    for stamp, place in zip(stamps, places, strict=True):
        setup.clock.set(T0 + stamp)
        setup.frame(np.concatenate([place, turn])[None], T0 + stamp)
    futures = setup.node.simulation.futures
    setup.bench.until(lambda: not futures._horizon.busy, 'the last future')
    setup.node.close()
    bag = read_bag(tmp_path / 'bag')
    heard = [decode_trajectory(m) for m in bag.topics['/predicted_trajectory'].messages]
    last = next(future for future in heard if future.stamp_ns == T0 + stamps[-1])
    expected = estimate_state(scene, times, places[:, None], noise=NOISE)
    run = simulator.rollout(scene, **vars(expected.state), steps=len(last.times_ns) - 1)
    np.testing.assert_allclose(last.poses[:, 0, :3], run.positions[:, 0], atol=1e-6)
    lead = np.array(last.times_ns) * 1e-9 + times[-1]
    true = np.stack([np.interp(lead, at, truth.positions[:, 0, c]) for c in range(3)], axis=1)
    vacuum = replace(scene, air=None)
    plain = estimate_state(vacuum, times, places[:, None], noise=NOISE).state
    without = simulator.rollout(vacuum, **vars(plain), steps=len(last.times_ns) - 1)
    ahead = np.searchsorted(np.array(last.times_ns), 0.3e9)
    off = np.linalg.norm(last.poses[ahead, 0, :3] - true[ahead])
    # a spin about the flight shows at the bounce alone
    assert off < 0.5 * np.linalg.norm(without.positions[ahead, 0] - true[ahead])
    again = reproduce(bag, find_topics(bag))
    assert again.predictions > 5 and again.same == again.predictions, str(again)
