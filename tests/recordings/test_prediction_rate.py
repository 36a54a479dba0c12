# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rate of the predictions in a bag, whose log times may go back or stand still."""

from __future__ import annotations

from collections.abc import Iterable
import json
from pathlib import Path

import numpy as np
import pytest
from recorded_bags import evaluate_bag
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.messages.poses import encode_string, PoseArrayCodec
from rigid_gns_core.scenes.scene import Plane, Scene

START, PERIOD = 1_000_000_000, 100_000_000  # [ns]
SCENE = Scene(surfaces=Plane.box(60.0, 60.0))
CODEC = PoseArrayCodec('world', 1)


def write_bag(folder: Path, passes: Iterable[int], now: int | None = None) -> Path:
    """Record so many frames and predictions a pass, each from the same time on.

    `now` is the log time of all predictions; None: their stamps.
    """
    with BagWriter(folder) as bag:
        for name in ('/tracked_poses', '/predicted_poses'):
            bag.add_topic(name, 'geometry_msgs/msg/PoseArray', 'reliable')
        bag.add_topic('/simulator/scene', 'std_msgs/msg/String', 'latched')
        said = encode_string(json.dumps({'scene': SCENE.to_mapping()}))
        bag.write('/simulator/scene', said, START)
        for length in passes:
            for number in range(length):
                stamp = START + number * PERIOD
                poses = np.array([[0.1 * number, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]])
                cdr = CODEC.encode(poses, stamp)
                bag.write('/tracked_poses', cdr, stamp)
                bag.write('/predicted_poses', cdr, stamp if now is None else now)
    return folder


@pytest.mark.parametrize('passes', [(30,), (30, 30), (30, 10)])
def test_passes_of_simulated_time_have_the_rate_of_each(
    tmp_path: Path, passes: tuple[int, ...]
) -> None:
    timing = evaluate_bag(write_bag(tmp_path / 'bag', passes))['timing']
    assert timing['publishing_rate_hz'] == pytest.approx(10.0)
    assert timing['period_mean_ms'] == pytest.approx(100.0)
    assert timing['period_std_ms'] == pytest.approx(0.0, abs=1e-9)


def test_log_times_that_stand_still_have_no_rate(tmp_path: Path) -> None:
    report = evaluate_bag(write_bag(tmp_path / 'bag', [30], START))
    assert 'publishing_rate_hz' not in report['timing']
    assert report['timing']['lateness_p50_ms'] == pytest.approx(-1450.0)
    assert any('Predictions have no rate' in note for note in report['notes'])
