# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Deviations that a node published, scored from its bag."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from recorded_bags import evaluate_bag, falling
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.forecasts.starts import Start
from rigid_gns_core.messages.poses import encode_string, PoseArrayCodec
from rigid_gns_core.messages.trajectories import encode_trajectory
from rigid_gns_core.recordings.scoring.horizon_errors import format_horizons
from rigid_gns_core.recordings.scoring.regions import crps, region_probability
from rigid_gns_core.scenes.scene import Plane, Scene
from scipy.integrate import quad
from scipy.stats import norm

T0, PERIOD = 1_700_000_000_123_456_789, 100_000_000  # [ns]
TRAJECTORY = 'trajectory_msgs/msg/MultiDOFJointTrajectory'
POSE_ARRAY = 'geometry_msgs/msg/PoseArray'
NAMES = [f'sphere_{k}' for k in range(3)]
POINTS = 12


def written(folder: Path, covariance: np.ndarray, told: np.ndarray, starts: int) -> Path:
    """Bag of futures whose errors have one covariance, and whose deviations tell another."""
    rng, codec = np.random.default_rng(0), PoseArrayCodec('world', 3)
    topics = {
        'tracked': ('/tracked_poses', POSE_ARRAY),
        'predicted': ('/predicted_poses', POSE_ARRAY),
        'start': ('/simulator/start', 'std_msgs/msg/String'),
        'trajectory': ('/predicted_trajectory', TRAJECTORY),
        'deviations': ('/predicted_deviations', TRAJECTORY),
        'scene': ('/simulator/scene', 'std_msgs/msg/String'),
    }
    scene = {
        'scene': Scene(surfaces=Plane.box(60.0, 60.0)).to_mapping(),
        'model': 'laws',
        'dt': 0.1,
        'parameters': {'start': 'first'},
        'topics': {role: name for role, (name, _) in topics.items()},
    }
    deviations = np.sqrt(np.diag(told))
    correlations = (told / np.outer(deviations, deviations))[[0, 0, 1], [1, 2, 2]]
    spread = np.zeros((POINTS, 3, 7)), np.zeros((POINTS, 3, 6))
    spread[0][..., :3], spread[0][..., 6], spread[1][..., 3:] = deviations, 1.0, correlations
    with BagWriter(folder) as bag:
        for name, kind in topics.values():
            bag.add_topic(name, kind, 'reliable')
        bag.write('/simulator/scene', encode_string(json.dumps(scene)), T0)
        start = Start(T0, (T0,), 'first', (0, 1, 2), 1e-4)
        bag.write('/simulator/start', encode_string(start.json), T0)
        for frame in range(starts + POINTS):
            stamp = T0 + frame * PERIOD
            poses = falling(0.1 * frame)
            bag.write('/tracked_poses', codec.encode(poses, stamp), stamp)
            bag.write('/predicted_poses', codec.encode(poses, stamp), stamp)
            if frame >= starts:
                continue
            times = [k * PERIOD for k in range(POINTS)]
            ahead = np.stack([falling(0.1 * (frame + k)) for k in range(POINTS)])
            ahead[..., :3] += rng.multivariate_normal(np.zeros(3), covariance, (POINTS, 3))
            for topic, values in (
                ('trajectory', (ahead, np.zeros((POINTS, 3, 6)))),
                ('deviations', spread),
            ):
                cdr = encode_trajectory(stamp, 'world', NAMES, times, *values)
                bag.write(topics[topic][0], cdr, stamp)
    return folder


def test_regions_that_a_node_published_are_scored(tmp_path: Path) -> None:
    """240 errors of each horizon; shares of 0.5 to 0.032, of 0.9 to 0.02."""
    root = np.array([[0.05, 0.0, 0.0], [0.03, 0.02, 0.0], [-0.02, 0.01, 0.04]])
    right = root @ root.T
    report = evaluate_bag(written(tmp_path / 'right', right, right, 80))
    wide = evaluate_bag(written(tmp_path / 'wide', right, 9.0 * right, 80))
    for horizon in ('0.1', '0.3', '1'):
        own, other = report['future_errors'][horizon], wide['future_errors'][horizon]
        assert own['coverage_50'] == pytest.approx(0.5, abs=0.11)
        assert own['coverage_90'] == pytest.approx(0.9, abs=0.07)
        # of a normal distribution with its own deviation: s / sqrt(pi)
        expected = np.sqrt(np.diag(right)).mean() / np.sqrt(np.pi)
        assert own['crps_m'] == pytest.approx(expected, rel=0.12)
        assert other['coverage_50'] > 0.95 and other['crps_m'] > 1.2 * own['crps_m']
    assert 'coverage_50' not in report['horizon_errors']['0.1']  # of predictions none is published
    table = format_horizons(report['future_errors'], 'future')
    assert 'CRPS' in table and 'in 90 %' in table
    assert 'CRPS' not in format_horizons(report['horizon_errors'], 'prediction')


def test_the_score_is_the_integral_that_it_is_defined_by() -> None:
    """CRPS = integral of (F(x) - 1[x >= y])^2."""
    for off, deviation in ((0.0, 1.0), (0.7, 0.3), (-2.0, 0.5)):
        left, _ = quad(lambda x, s=deviation: norm.cdf(x, scale=s) ** 2, -9.0, off, limit=200)
        right, _ = quad(lambda x, s=deviation: norm.sf(x, scale=s) ** 2, off, 9.0, limit=200)
        found = crps(np.full(3, off), np.eye(3) * deviation**2, 0.0)
        assert found == pytest.approx(left + right, abs=1e-7)
    assert crps(np.full(3, 0.3), np.zeros((3, 3)), 0.0) == pytest.approx(0.3)
    assert crps(np.zeros(3), np.full((3, 3), np.nan), 0.0) is None
    assert region_probability(np.zeros(3), np.full((3, 3), np.nan), 0.0) is None
