# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags as other recorders, converters and crashes leave them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from mcap.writer import CompressionType, Writer
import numpy as np
import pytest
from rigid_gns_core.bags.reader import BagError, read_bag
from rigid_gns_core.bags.topics import find_topics
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.messages.definitions import full_text
from rigid_gns_core.messages.poses import decode_float64, encode_float64, encode_string
import yaml
import zstandard

FLOAT64, STRING = 'std_msgs/msg/Float64', 'std_msgs/msg/String'


def write_mcap(
    path: Path,
    messages: Iterable[tuple[str, str, int, bytes]],
    *,
    compression: CompressionType = CompressionType.NONE,
    schemas: bool = True,
    encoding: str = 'cdr',
) -> None:
    """Write messages of (topic, type, log time [ns], bytes) into one chunk."""
    with open(path, 'wb') as file:
        writer = Writer(file, compression=compression, chunk_size=2**24)
        writer.start('ros2', 'another recorder')
        channels: dict[tuple[str, str], int] = {}
        for topic, kind, time, cdr in messages:
            if (topic, kind) not in channels:
                text = full_text(kind).encode()
                schema = writer.register_schema(kind, 'ros2msg', text) if schemas else 0
                channels[topic, kind] = writer.register_channel(topic, encoding, schema)
            writer.add_message(channels[topic, kind], time, cdr, time)
        writer.finish()


def numbers(count: int, topic: str = '/a') -> list[tuple[str, str, int, bytes]]:
    return [(topic, FLOAT64, 10 + k, encode_float64(float(k))) for k in range(count)]


@pytest.mark.parametrize('time', [2**63, 2**64 - 1])
def test_a_log_time_beyond_int64_costs_its_message_alone(tmp_path, time):
    cdr = encode_float64(99.0)
    write_mcap(tmp_path / 'a.mcap', [*numbers(3), ('/a', FLOAT64, time, cdr), *numbers(3, '/b')])
    bag = read_bag(tmp_path / 'a.mcap')
    assert [decode_float64(cdr) for cdr in bag.topics['/a'].messages] == [0, 1, 2]
    assert len(bag.topics['/b']) == 3
    assert len(bag.warnings) == 1
    assert '1 messages of /a are left out: their log times are damaged' in bag.warnings[0]


def test_the_last_time_of_an_int64_is_read(tmp_path):
    write_mcap(tmp_path / 'a.mcap', [('/a', FLOAT64, 2**63 - 1, encode_float64(1.0))])
    assert read_bag(tmp_path / 'a.mcap').topics['/a'].times.tolist() == [2**63 - 1]


def test_a_reindexed_bag_has_no_storage_identifier(tmp_path, write_bag):
    write_bag(tmp_path / 'bag')
    path = tmp_path / 'bag' / 'metadata.yaml'
    text = path.read_text()
    path.write_text(text.replace('storage_identifier: mcap', "storage_identifier: ''"))
    assert "identifier: ''" in path.read_text()
    bag = read_bag(tmp_path / 'bag')
    assert len(bag.topics['/simulator/step_time']) == 100
    assert not bag.warnings
    path.write_text(path.read_text().replace('bag_0.mcap', 'bag_0.db3'))
    with pytest.raises(BagError, match="stored as 'sqlite3', expected mcap"):
        read_bag(tmp_path / 'bag')


def test_a_topic_of_two_types_costs_only_the_other_type(tmp_path):
    mixed = [('/mixed', STRING, 1, encode_string('a')), *numbers(3, '/mixed')]
    write_mcap(tmp_path / 'a.mcap', [*mixed, *numbers(4, '/b')])
    bag = read_bag(tmp_path / 'a.mcap')
    assert len(bag.topics['/b']) == 4
    assert bag.topics['/mixed'].type_name == FLOAT64
    assert [decode_float64(cdr) for cdr in bag.topics['/mixed'].messages] == [0, 1, 2]
    assert len(bag.warnings) == 1
    assert f'topic /mixed has two types; 1 messages of {STRING}' in bag.warnings[0]


def test_a_channel_without_schema_has_the_type_of_metadata_yaml(tmp_path):
    write_mcap(tmp_path / 'a.mcap', numbers(3), schemas=False)
    assert read_bag(tmp_path / 'a.mcap').topics['/a'].type_name == 'unknown'
    listed = [{'topic_metadata': {'name': '/a', 'type': FLOAT64}, 'message_count': 3}]
    information = {
        'relative_file_paths': ['a.mcap'],
        'storage_identifier': 'mcap',
        'topics_with_message_count': listed,
    }
    content = yaml.safe_dump({'rosbag2_bagfile_information': information})
    (tmp_path / 'metadata.yaml').write_text(content)
    assert read_bag(tmp_path).topics['/a'].type_name == FLOAT64


@pytest.mark.parametrize('compression', list(CompressionType))
def test_the_start_of_a_torn_chunk_is_read(tmp_path, compression):
    path = tmp_path / 'a.mcap'
    # what does not compress: the chunk is then most of the file
    texts = [np.random.default_rng(k).bytes(500).hex() for k in range(2000)]
    messages = [('/a', STRING, k, encode_string(text)) for k, text in enumerate(texts)]
    write_mcap(path, messages, compression=compression)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    bag = read_bag(path)
    read = bag.topics['/a'].messages
    assert 100 < len(read) < 2000
    assert read == [cdr for *_, cdr in messages[: len(read)]]
    assert f'but for {len(read)} messages at their start' in bag.warnings[0]


def test_an_error_names_the_damage_that_explains_it(tmp_path):
    path = tmp_path / 'a.mcap'
    write_mcap(path, numbers(3))
    path.write_bytes(path.read_bytes()[:80])
    bag = read_bag(path)
    assert not bag.topics
    expected = r'(?s)holds no topics.*truncated.*bytes are lost'
    with pytest.raises(BagError, match=expected), bag.naming_damage():
        find_topics(bag)


def test_sqlite_is_named(tmp_path):
    (tmp_path / 'bag_0.db3').write_bytes(b'SQLite format 3\0')
    with pytest.raises(BagError, match=r'holds bag_0.db3 and no metadata.yaml.*reindex.*convert'):
        read_bag(tmp_path)
    with pytest.raises(BagError, match='does not start as an MCAP file; it holds SQLite'):
        read_bag(tmp_path / 'bag_0.db3')


def test_a_bag_states_the_depth_of_each_topic(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add_topic('/deep', FLOAT64, 'reliable')
        bag.add_topic('/one', FLOAT64, 'reliable', 1)
        for name in ('/deep', '/one'):
            bag.write(name, encode_float64(0.0), 1)
    content = yaml.safe_load((tmp_path / 'bag' / 'metadata.yaml').read_text())
    topics = content['rosbag2_bagfile_information']['topics_with_message_count']
    depths = {
        topic['topic_metadata']['name']: topic['topic_metadata']['offered_qos_profiles'][0][
            'depth'
        ]
        for topic in topics
    }
    assert depths == {'/deep': 10, '/one': 1}


def write_metadata(folder: Path, files: list[str], **entries: object) -> None:
    information = {'relative_file_paths': files, 'storage_identifier': 'mcap', **entries}
    content = yaml.safe_dump({'rosbag2_bagfile_information': information})
    (folder / 'metadata.yaml').write_text(content)


def test_copies_of_a_file_do_not_count_twice(tmp_path):
    for name in ('bag_0.mcap', 'bag_0 (1).mcap'):
        write_mcap(tmp_path / name, numbers(3))
    for files in (['bag_0.mcap', 'bag_0 (1).mcap'], ['bag_0.mcap'] * 2, None):
        if files is None:
            (tmp_path / 'metadata.yaml').unlink()
        else:
            write_metadata(tmp_path, files)
        bag = read_bag(tmp_path)
        assert len(bag.topics['/a']) == 3
        assert any('left out, as it holds the same as bag_0' in text for text in bag.warnings)


def test_a_folder_of_two_bags_without_metadata_is_refused(tmp_path):
    write_mcap(tmp_path / 'first_0.mcap', numbers(3))
    write_mcap(tmp_path / 'first_1.mcap', numbers(4))
    assert len(read_bag(tmp_path).topics['/a']) == 7
    write_mcap(tmp_path / 'second.mcap', numbers(5))
    with pytest.raises(BagError, match=r"files of several bags, 'first, second'; give each by"):
        read_bag(tmp_path)
    write_metadata(tmp_path, ['first_1.mcap', 'second.mcap'])
    assert len(read_bag(tmp_path).topics['/a']) == 9


def test_a_topic_that_is_not_cdr_is_named(tmp_path):
    write_mcap(tmp_path / 'a.mcap', numbers(3), encoding='json')
    bag = read_bag(tmp_path / 'a.mcap')
    assert not bag.topics
    assert "topic '/a' is left out: its messages are encoded as 'json'" in bag.warnings[0]


def test_messages_that_are_not_compressed_as_told_are_read(tmp_path):
    damaged = zstandard.compress(b'a')[:4] + b'\xff' * 8
    packed = [(*head, zstandard.compress(cdr)) for *head, cdr in numbers(2)]
    write_mcap(tmp_path / 'a.mcap', [*numbers(1), *packed, ('/a', FLOAT64, 50, damaged)])
    for form in ('zstd', ''):
        write_metadata(tmp_path, ['a.mcap'], compression_mode='MESSAGE', compression_format=form)
        read = read_bag(tmp_path).topics['/a'].messages
        assert sorted(read) == sorted([b'', *(cdr for *_, cdr in [*numbers(1), *numbers(2)])])
    write_metadata(tmp_path, ['a.mcap'], compression_mode='message', compression_format='lz4')
    with pytest.raises(BagError, match=r"compressed by 'lz4', expected zstd; `ros2 bag convert`"):
        read_bag(tmp_path)


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('', 'it holds None, expected a mapping'),
        ('a: [\n b', 'not valid YAML: .*line'),
        ('a: 1', "no 'rosbag2_bagfile_information'"),
        ('rosbag2_bagfile_information: {relative_file_paths: a, storage_identifier: mcap}',
         "relative_file_paths is 'a'"),
    ],
)  # fmt: skip
def test_damaged_metadata_has_its_reason_and_remedy(tmp_path, text, reason):
    write_mcap(tmp_path / 'a.mcap', numbers(3))
    (tmp_path / 'metadata.yaml').write_text(text)
    with pytest.raises(BagError, match=f'yaml: not the metadata of a bag: {reason}.*; `ros2 bag'):
        read_bag(tmp_path)


def test_what_is_no_bag_says_what_is_read(tmp_path):
    (tmp_path / 'tracks.txt').write_text('track,sphere,time,x,y,z')
    with pytest.raises(BagError, match=r'txt: does not start as an MCAP file; expected .*\.csv$'):
        read_bag(tmp_path / 'tracks.txt')


def test_a_compressed_file_is_read_to_its_end_or_said_to_be_cut(tmp_path):
    write_mcap(tmp_path / 'a.mcap', numbers(300))
    whole = (tmp_path / 'a.mcap').read_bytes()
    path = tmp_path / 'b.mcap.zstd'
    path.write_bytes(zstandard.compress(whole[:4000]) + zstandard.compress(whole[4000:]))
    bag = read_bag(path)
    assert len(bag.topics['/a']) == 300 and not bag.warnings
    path.write_bytes(path.read_bytes()[:-9])
    bag = read_bag(path)
    assert 'is cut short; what can be decompressed is read' in bag.warnings[0]
    assert len(bag.topics['/a']) < 300
    path.write_bytes(zstandard.compress(whole)[:-9])
    with pytest.raises(BagError, match='is cut short, and nothing of it can be decompressed'):
        read_bag(path)
