# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns report` of a bag: the same numbers as `evaluate`, its times."""

from __future__ import annotations

import json
from pathlib import Path
import re

import numpy as np
import pytest
from recorded_bags import evaluate_bag
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.commands import cli
from rigid_gns_core.messages.poses import encode_float64, encode_string, PoseArrayCodec
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.show.bag_comparison import read_bag_comparison

START, PERIOD = 1_700_000_000_000_000_000, 100_000_000  # [ns]
SCENE = Scene(surfaces=Plane.box(60.0, 60.0))
LATE, ERROR = 3_000_000, 0.05  # [ns], [m]


def poses(k: int) -> np.ndarray:
    """Two spheres that slide along x at 1 m/s, shape (2, 7)."""
    turned = [0.0, 0.0, 0.0, 1.0]
    return np.array([[0.1 * k, 5.0 * i, 1.0, *turned] for i in range(2)])


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """Twenty predictions, each 5 cm off and 3 ms late, and tracked poses of the same stamps."""
    folder = tmp_path / 'lane'
    codec = PoseArrayCodec('world', 2)
    with BagWriter(folder) as writer:
        for name, kind, qos in (
            ('tracked_poses', 'geometry_msgs/msg/PoseArray', 'sensor_data'),
            ('predicted_poses', 'geometry_msgs/msg/PoseArray', 'reliable'),
            ('simulator/scene', 'std_msgs/msg/String', 'latched'),
            ('simulator/step_time', 'std_msgs/msg/Float64', 'reliable'),
        ):
            writer.add_topic(f'/{name}', kind, qos)
        said = {'scene': SCENE.to_mapping(), 'model': 'laws', 'dt': 0.1, 'parameters': {}}
        writer.write('/simulator/scene', encode_string(json.dumps(said)), START)
        for k in range(20):
            stamp = START + k * PERIOD
            writer.write('/tracked_poses', codec.encode(poses(k), stamp), stamp)
            ahead = poses(k) + ERROR * np.eye(7)[0]
            writer.write('/predicted_poses', codec.encode(ahead, stamp), stamp + LATE)
            writer.write('/simulator/step_time', encode_float64(2e-3), stamp)
    return folder


def test_what_evaluate_compares(bag: Path) -> None:
    comparison = read_bag_comparison(bag, scene=None, tracked=None, predicted=None)
    report = evaluate_bag(bag)
    assert comparison.evaluation == report
    assert len(comparison.predicted) == report['frames']['compared'] == 20
    off = comparison.predicted.positions - comparison.reference.positions
    np.testing.assert_allclose(np.linalg.norm(off, axis=2), ERROR, atol=1e-9)
    times, late = comparison.recording['lateness']
    np.testing.assert_allclose(times, 0.1 * np.arange(20), atol=1e-9)
    np.testing.assert_allclose(late, 3.0)
    np.testing.assert_allclose(comparison.recording['period'][1], 100.0)
    np.testing.assert_allclose(comparison.recording['model step'][1], 2.0)


def test_a_report(bag: Path, tmp_path: Path) -> None:
    before = sorted(path.name for path in bag.iterdir())
    out = tmp_path / 'lane.html'
    assert cli.main(['report', str(bag), '--out', str(out)]) == 0
    assert sorted(path.name for path in bag.iterdir()) == before
    page = out.read_text('utf-8')
    payload = json.loads(re.search(r'id="payload">(.*?)</script>', page, re.S)[1])
    assert payload['sides'] == ['predicted', 'tracked']
    keys = [chart['key'] for chart in payload['charts']]
    assert keys[-3:] == ['lateness', 'period', 'model step']
    assert 'data-key="timing.lateness_p99_ms"' in page
    assert 'data-key="recording.scene.surfaces.0.point.0"' in page


def test_options_of_records_are_refused(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(['report', str(bag), '--reference', 'a.h5', '--out', 'a.html']) == 2
    assert '--reference goes with a record' in capsys.readouterr().err


def test_a_bag_without_predictions_is_refused_with_a_way_to_make_some(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    codec = PoseArrayCodec('world', 2)
    with BagWriter(tmp_path / 'theirs') as writer:
        writer.add_topic('/vicon/balls', 'geometry_msgs/msg/PoseArray', 'sensor_data')
        writer.write('/vicon/balls', codec.encode(poses(0), START), START)
    out = tmp_path / 'theirs.html'
    assert cli.main(['report', str(tmp_path / 'theirs'), '--out', str(out)]) == 2
    said = capsys.readouterr().err
    assert 'no predicted poses' in said and '/vicon/balls' in said and 'rigid-gns import' in said
    assert not out.exists()
