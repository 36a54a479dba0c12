# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import json

import numpy as np
import pytest
from recorded_bags import evaluate_bag
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.bags.topics import find_topics, holds_predictions, list_topics
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.messages.poses import encode_float64, encode_string, PoseArrayCodec
from rigid_gns_core.recordings.recorded_forecasts import recorded_starts
from rigid_gns_core.scenes.scene import Plane, Scene

START = 1_700_000_000_123_456_789
PERIOD = 100_000_000  # [ns]
POSE_ARRAY = 'geometry_msgs/msg/PoseArray'
SCENE = Scene(surfaces=Plane.box(60.0, 60.0))


def falling(stamp_ns: int) -> np.ndarray:
    """Poses of three spheres in free flight, shape (3, 7)."""
    poses = np.zeros((3, 7))
    poses[:, 0] = 5.0 * np.arange(3)
    poses[:, 2], poses[:, 6] = 60.0 - 4.905 * ((stamp_ns - START) * 1e-9) ** 2, 1.0
    return poses


def test_remapped_topics_are_found(tmp_path):
    folder, codec = tmp_path / 'bag', PoseArrayCodec('world', 3)
    names = {'tracked': '/vicon/balls', 'predicted': '/forecast', 'step_time': '/lab/timing'}
    said = {'scene': SCENE.to_mapping(), 'model': 'gns', 'dt': 0.1, 'topics': names}
    with BagWriter(folder) as bag:
        bag.add_topic(names['tracked'], POSE_ARRAY, 'sensor_data')
        bag.add_topic(names['predicted'], POSE_ARRAY, 'reliable')
        bag.add_topic(names['step_time'], 'std_msgs/msg/Float64', 'reliable')
        bag.add_topic('/lab/simulator/scene', 'std_msgs/msg/String', 'latched')
        bag.write('/lab/simulator/scene', encode_string(json.dumps(said)), START)
        for stamp in range(START, START + 10 * PERIOD, PERIOD):
            bag.write(names['tracked'], codec.encode(falling(stamp), stamp), stamp)
            bag.write(names['predicted'], codec.encode(falling(stamp), stamp), stamp)
            bag.write(names['step_time'], encode_float64(2e-3), stamp)
    report = evaluate_bag(folder)
    assert report['recording']['tracked'] == '/vicon/balls'
    assert report['recording']['model'] == 'gns'
    assert report['timing']['step_p50_ms'] == 2.0


@pytest.mark.parametrize('last', ['/lab/simulator', '/other'])
def test_starts_are_those_beside_the_predictions(tmp_path, last):
    start = {'stamp_ns': START, 'window_ns': [START - 1, START], 'reason': 'first', 'ids': [0]}
    with BagWriter(tmp_path / 'bag') as bag:
        for name in ('/lab/tracked_poses', '/lab/predicted_poses'):
            bag.add_topic(name, POSE_ARRAY, 'reliable')
            bag.write(name, PoseArrayCodec('world', 3).encode(falling(START), START), START)
        bag.add_topic(f'{last}/start', 'std_msgs/msg/String', 'latched')
        bag.write(f'{last}/start', encode_string(json.dumps(start)), START)
    found = recorded_starts(find_topics(read_bag(tmp_path / 'bag')).start)
    assert [(one.stamp_ns, one.window_ns, one.ids) for one in found] == [
        (START, (START - 1, START), (0,))
    ]


def test_a_start_that_is_none_is_named(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add_topic('/start', 'std_msgs/msg/String', 'latched')
        bag.write('/start', encode_string('{"stamp_ns": 1}'), START)
    with pytest.raises(ValueError, match="message 0 of /start is no start.*'window_ns'"):
        recorded_starts(read_bag(tmp_path / 'bag').topics['/start'])


def test_predictions_are_noticed(tmp_path):
    for name, expected in (('/predicted_poses', True), ('/vicon/balls', False)):
        folder = tmp_path / name.split('/')[-1]
        with BagWriter(folder) as bag:
            bag.add_topic(name, POSE_ARRAY, 'reliable')
            bag.write(name, PoseArrayCodec('world', 3).encode(falling(START), START), START)
        assert holds_predictions(read_bag(folder)) is expected


def test_a_scene_topic_of_another_node_is_ignored(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add_topic('/stage/scene', 'std_msgs/msg/String', 'reliable')
        bag.write('/stage/scene', encode_string('act one'), START)
    assert holds_predictions(read_bag(tmp_path / 'bag')) is False


def test_of_hundreds_of_topics_an_error_lists_poses_first(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:
        for k in range(100):
            bag.add_topic(f'/a{k}', 'std_msgs/msg/Float64', 'reliable')
            bag.write(f'/a{k}', encode_float64(1.0), 1)
        bag.add_topic('/z/balls', 'geometry_msgs/msg/PoseArray', 'reliable')
        bag.write('/z/balls', PoseArrayCodec('world', 0).encode(np.zeros((0, 7)), 1), 1)
    listed = list_topics(read_bag(tmp_path / 'bag'))
    assert listed.startswith('/z/balls (geometry_msgs/msg/PoseArray, 1 messages), /a0 (')
    assert listed.endswith(' and 81 more') and len(listed) < 2000
