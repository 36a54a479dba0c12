# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

from pathlib import Path

from mcap.writer import CompressionType, Writer
import pytest
from rigid_gns_core.bags.reader import BagError, read_bag
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.messages.poses import decode_float64, encode_float64, encode_string
import yaml

ROOT = Path(__file__).parents[2]


def test_a_truncated_file_gives_its_complete_messages(tmp_path, write_bag):
    written = write_bag(tmp_path / 'bag')['/simulator/step_time']
    path = tmp_path / 'bag' / 'bag_0.mcap'
    whole = path.read_bytes()
    for unchunked in (False, True):
        if unchunked:
            with open(path, 'wb') as file:
                writer = Writer(file, use_chunking=False)
                writer.start('ros2')
                schema = writer.register_schema('std_msgs/msg/Float64', 'ros2msg', b'float64 data')
                channel = writer.register_channel('/simulator/step_time', 'cdr', schema)
                for k, cdr in enumerate(written):
                    writer.add_message(channel, k, cdr, k)
                writer.finish()
            whole = path.read_bytes()
        counts = []
        for length in [*range(8, len(whole), 997), len(whole) - 1]:
            path.write_bytes(whole[:length])
            bag = read_bag(path)
            messages = bag.topics.get('/simulator/step_time')
            messages = messages.messages if messages else []
            assert messages == written[: len(messages)]  # no message is cut
            assert bag.warnings
            counts.append(len(messages))
        assert counts == sorted(counts)
    assert counts[-1] == 100


def test_damage_in_the_middle_costs_one_chunk(tmp_path):
    path = tmp_path / 'bag.mcap'
    with open(path, 'wb') as file:
        writer = Writer(file, chunk_size=2000, compression=CompressionType.ZSTD)
        writer.start('ros2')
        schema = writer.register_schema('std_msgs/msg/String', 'ros2msg', b'string data')
        channel = writer.register_channel('/a', 'cdr', schema)
        for k in range(200):
            writer.add_message(channel, k, encode_string(str(k) * 20), k)
        writer.finish()
    whole = path.read_bytes()
    assert len(read_bag(path).topics['/a']) == 200
    damaged = bytearray(whole)
    second = whole.index(b'zstd', whole.index(b'zstd') + 1)
    damaged[second + 30] ^= 0xFF
    path.write_bytes(damaged)
    bag = read_bag(path)
    assert 100 < len(bag.topics['/a']) < 200
    assert 'damaged' in bag.warnings[0]
    # a length that is far too long must not be read
    damaged = bytearray(whole)
    damaged[9:17] = b'\xff' * 8
    path.write_bytes(damaged)
    assert 'truncated' in read_bag(path).warnings[0]


def test_what_is_not_a_bag_is_named(tmp_path):
    with pytest.raises(BagError, match='no such bag'):
        read_bag(tmp_path / 'nowhere')
    with pytest.raises(BagError, match=r'neither metadata.yaml nor an .mcap file'):
        read_bag(tmp_path)
    (tmp_path / 'a.mcap').write_bytes(b'SQLite format 3')
    with pytest.raises(BagError, match='does not start as an MCAP file'):
        read_bag(tmp_path / 'a.mcap')
    (tmp_path / 'metadata.yaml').write_text('nothing: 1')
    with pytest.raises(BagError, match='not the metadata of a bag'):
        read_bag(tmp_path)
    (tmp_path / 'metadata.yaml').write_text(
        yaml.safe_dump(
            {
                'rosbag2_bagfile_information': {
                    'relative_file_paths': ['a.db3'],
                    'storage_identifier': 'sqlite3',
                }
            }
        )
    )
    with pytest.raises(BagError, match="stored as 'sqlite3', expected mcap; convert"):
        read_bag(tmp_path)


def test_missing_parts_of_a_folder_are_reported(tmp_path, write_bag):
    write_bag(tmp_path / 'bag')
    path = tmp_path / 'bag' / 'metadata.yaml'
    text = path.read_text().replace('- bag_0.mcap', '- bag_0.mcap\n  - bag_1.mcap')
    path.write_text(text.replace('message_count: 300', 'message_count: 301'))
    warnings = read_bag(tmp_path / 'bag').warnings
    assert 'bag_1.mcap: named in metadata.yaml, but missing' in warnings[0]
    assert 'counts 301 messages, 300 were read' in warnings[1]


def test_log_times_that_go_back_are_passes_and_slight_disorder_is_sorted(tmp_path):
    # one slightly unordered, two jumps back
    folder, second = tmp_path / 'bag', 10**9
    times = [100 * second, 102 * second, 101 * second + second // 2, 103 * second]
    times += [50 * second, 51 * second, 104 * second, 20 * second]
    with BagWriter(folder) as bag:
        bag.add_topic('/a', 'std_msgs/msg/Float64', 'reliable')
        bag.add_topic('/b', 'std_msgs/msg/Float64', 'reliable')
        for index, time in enumerate(times):
            bag.write('/a', encode_float64(float(index)), time)
            bag.write('/b', encode_float64(0.0), time)
    topic = read_bag(folder).topics['/a']
    assert [decode_float64(cdr) for cdr in topic.messages] == [0, 2, 1, 3, 4, 5, 6, 7]
    assert list(topic.times) == [times[index] for index in (0, 2, 1, 3, 4, 5, 6, 7)]
    assert list(topic.indices) == [0, 4, 2, 6, 8, 10, 12, 14]
