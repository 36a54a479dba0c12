# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

from pathlib import Path
import threading

import numpy as np
import pytest
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.messages.poses import encode_float64, encode_string

ROOT = Path(__file__).parents[2]

START = 1_700_000_000_000_000_001  # as in conftest.py
POSE_ARRAY = 'geometry_msgs/msg/PoseArray'


def test_own_reader_gives_the_bytes_back(tmp_path, write_bag):
    written = write_bag(tmp_path / 'bag')
    bag = read_bag(tmp_path / 'bag')
    assert bag.warnings == ()
    assert {name: topic.messages for name, topic in bag.topics.items()} == {
        **written,
        '/lab/tracked_poses': [],
    }
    topic = bag.topics['/lab/predicted_poses']
    assert topic.type_name == POSE_ARRAY
    np.testing.assert_array_equal(topic.times, START + np.arange(100) * 10_000_000)
    bare = read_bag(tmp_path / 'bag' / 'bag_0.mcap')
    assert bare.topics['/lab/predicted_poses'].messages == written['/lab/predicted_poses']


def test_a_bag_is_never_overwritten(tmp_path):
    (tmp_path / 'bag').mkdir()
    with pytest.raises(FileExistsError, match='exists already and a bag is never overwritten'):
        BagWriter(tmp_path / 'bag')


def test_closing_twice_and_an_empty_bag(tmp_path):
    bag = BagWriter(tmp_path / 'deep' / 'bag')
    bag.close()
    bag.close()
    assert read_bag(tmp_path / 'deep' / 'bag').topics == {}
    bag = BagWriter(tmp_path / 'topic')
    bag.add_topic('/a', 'std_msgs/msg/String', 'reliable')
    bag.close()
    rosbag = pytest.importorskip('rosbags.highlevel', reason='rosbags is not installed')
    with rosbag.AnyReader([tmp_path / 'topic']) as reader:
        assert reader.message_count == 0


def test_mistakes_of_the_program_are_named(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:
        with pytest.raises(
            ValueError, match="'std_msgs/msg/Int8' cannot be recorded; known: geom"
        ):
            bag.add_topic('/a', 'std_msgs/msg/Int8', 'reliable')
        with pytest.raises(ValueError, match="qos is 'fast', allowed: reliable"):
            bag.add_topic('/a', POSE_ARRAY, 'fast')  # type: ignore[arg-type]
        with pytest.raises(ValueError, match='slash'):
            bag.add_topic('a', POSE_ARRAY, 'reliable')
        with pytest.raises(ValueError, match='topic /a was not added'):
            bag.write('/a', b'', 0)


def test_what_cannot_be_recorded_is_counted_and_reported(tmp_path):
    said = []
    bag = BagWriter(tmp_path / 'bag', queue_bytes=1000, on_error=said.append)
    bag.add_topic('/a', 'std_msgs/msg/String', 'reliable')
    bag.write('/a', encode_string('x' * 2000), START)  # never fits the queue
    bag.write('/a', encode_string('x'), -1)  # before the epoch
    bag.write('/a', encode_string('kept'), START)
    bag.close()
    assert (bag.lost, bag.error) == (2, None)
    assert len(said) == 1
    assert 'does not hold every message: 2 lost' in said[0]
    bag.write('/a', encode_string('late'), START)
    assert bag.lost == 3
    assert read_bag(tmp_path / 'bag').topics['/a'].messages == [encode_string('kept')]


def test_threads_write_at_once(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:

        def write(name: str) -> None:
            for k in range(500):
                bag.write(name, encode_float64(k), START + k)

        threads = []
        for name in ('/a', '/b', '/c'):
            bag.add_topic(name, 'std_msgs/msg/Float64', 'reliable')
            threads.append(threading.Thread(target=write, args=(name,)))
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    topics = read_bag(tmp_path / 'bag').topics
    expected = [encode_float64(k) for k in range(500)]
    assert {name: topic.messages == expected for name, topic in topics.items()} == dict.fromkeys(
        ('/a', '/b', '/c'), True
    )
