# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import json
from pathlib import Path
import sys

from mcap.reader import make_reader
import numpy as np
import pytest
from rigid_gns_core.bags.metadata import (
    information_yaml,
    metadata_yaml,
    RecordedFile,
    RecordedTopic,
)
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.messages import definitions
import yaml

ROOT = Path(__file__).parents[2]

START = 1_700_000_000_000_000_001  # as in conftest.py
POSE_ARRAY = 'geometry_msgs/msg/PoseArray'


def test_rosbags_reads_it(tmp_path, write_bag):
    highlevel = pytest.importorskip('rosbags.highlevel', reason='rosbags is not installed')
    written = write_bag(tmp_path / 'bag')
    with highlevel.AnyReader([tmp_path / 'bag']) as reader:
        assert reader.message_count == 300
        read = {name: [] for name in written}
        for connection, time_ns, cdr in reader.messages():
            message = reader.deserialize(cdr, connection.msgtype)
            if connection.topic == '/simulator/step_time':
                assert time_ns == START + int(message.data) * 10_000_000
            read[connection.topic].append(bytes(cdr))
        assert read == written
        # rosbags computes the hashes from the texts, so both are right
        digests = {c.msgtype: c.digest for c in reader.connections}
        assert digests == {name: definitions.type_hash(name) for name in digests}
        assert len(digests) == 3


def test_mcap_ros2_reads_it(tmp_path, write_bag):
    decoder = pytest.importorskip('mcap_ros2.decoder', reason='mcap-ros2-support is not installed')
    write_bag(tmp_path / 'bag')
    with open(tmp_path / 'bag' / 'bag_0.mcap', 'rb') as file:
        reader = make_reader(file, decoder_factories=[decoder.DecoderFactory()])
        assert reader.get_header().profile == 'ros2'
        poses = [
            message.poses
            for _, _, _, message in reader.iter_decoded_messages(topics='/lab/predicted_poses')
        ]
    assert len(poses) == 100
    expected = np.random.default_rng(7).normal(size=(5, 7))
    assert poses[7][2].position.x == expected[2, 0]
    assert poses[7][4].orientation.w == expected[4, 6]


def test_metadata_is_that_of_rosbag2_jazzy(tmp_path, write_bag):
    write_bag(tmp_path / 'bag')
    folder = tmp_path / 'bag'
    assert sorted(file.name for file in folder.iterdir()) == ['bag_0.mcap', 'metadata.yaml']
    content = yaml.safe_load((folder / 'metadata.yaml').read_text())
    information = content['rosbag2_bagfile_information']
    assert list(information) == [
        'version',
        'storage_identifier',
        'duration',
        'starting_time',
        'message_count',
        'topics_with_message_count',
        'compression_format',
        'compression_mode',
        'relative_file_paths',
        'files',
        'custom_data',
        'ros_distro',
    ]
    assert information['version'] == 9
    assert information['duration'] == {'nanoseconds': 99 * 10_000_000}
    assert information['starting_time'] == {'nanoseconds_since_epoch': START}
    assert information['message_count'] == 300
    assert information['relative_file_paths'] == ['bag_0.mcap']
    topics = {
        entry['topic_metadata']['name']: entry
        for entry in information['topics_with_message_count']
    }
    assert topics['/lab/tracked_poses']['message_count'] == 0
    quality = {
        name: tuple(
            entry['topic_metadata']['offered_qos_profiles'][0][key]
            for key in ('reliability', 'durability', 'depth')
        )
        for name, entry in topics.items()
    }
    assert quality == {
        '/lab/predicted_poses': ('reliable', 'volatile', 10),
        '/lab/tracked_poses': ('best_effort', 'volatile', 5),
        '/simulator/scene': ('reliable', 'transient_local', 1),
        '/simulator/step_time': ('reliable', 'volatile', 10),
    }
    with open(folder / 'bag_0.mcap', 'rb') as file:
        reader = make_reader(file)
        record = {m.name: m.metadata for m in reader.iter_metadata()}['rosbag2']
        assert yaml.safe_load(record['serialized_metadata']) == information
        summary = reader.get_summary()
        assert summary is not None
        hashes = {
            summary.schemas[channel.schema_id].name: channel.metadata['topic_type_hash']
            for channel in summary.channels.values()
        }
        assert len(hashes) == 3
        assert hashes == {name: definitions.type_hash(name) for name in hashes}


def test_definitions_are_those_of_the_installed_ros():
    index = pytest.importorskip('ament_index_python.packages', reason='ROS is not installed')

    def share(package: str) -> Path:
        try:
            return Path(index.get_package_share_directory(package))
        except (LookupError, OSError):  # wheels, where no environment is sourced
            return Path(sys.prefix) / 'share' / package

    for name in definitions.HASHES:
        package, _, kind = name.split('/')
        text, *others = definitions.full_text(name).split(f'\n{"=" * 80}\nMSG: ')
        parts = {f'{package}/{kind}': text, **dict(other.split('\n', 1) for other in others)}
        for part, text in parts.items():
            path = share(part.split('/')[0]) / 'msg' / f'{part.split("/")[1]}.msg'
            if not path.is_file():
                pytest.skip(f'{path} is not there')
            assert text == path.read_text()
        hashes = json.loads((share(package) / 'msg' / f'{kind}.json').read_text())['type_hashes']
        found = {
            entry['type_name'].replace('/msg/', '/'): entry['hash_string'] for entry in hashes
        }
        assert found[f'{package}/{kind}'] == definitions.type_hash(name)
        assert set(found) == set(parts)


@pytest.mark.parametrize('mode', ['storage', 'file', 'message'])
def test_bags_of_other_recorders_are_read(tmp_path, mode, poses_cdr):
    rosbag2 = pytest.importorskip('rosbags.rosbag2', reason='rosbags is not installed')
    typesys = pytest.importorskip('rosbags.typesys')
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    writer = rosbag2.Writer(tmp_path / 'bag', version=9, storage_plugin=rosbag2.StoragePlugin.MCAP)
    modes = rosbag2.CompressionMode
    writer.set_compression(
        {'storage': modes.STORAGE, 'file': modes.FILE, 'message': modes.MESSAGE}[mode],
        rosbag2.CompressionFormat.ZSTD,
    )
    with writer:
        connection = writer.add_connection('/tracked_poses', POSE_ARRAY, typestore=store)
        for k in (2, 0, 1):  # log times need not rise
            writer.write(connection, START + k, poses_cdr(k))
    bag = read_bag(tmp_path / 'bag')
    assert bag.warnings == ()
    assert bag.topics['/tracked_poses'].messages == [poses_cdr(k) for k in range(3)]


@pytest.mark.parametrize('files', [0, 1, 3])
def test_metadata_are_what_pyyaml_would_write(files: int) -> None:
    """Their text is put together from parts, of which what stays from split to split is kept."""
    names = ['bag_0.mcap', "it's: #1.mcap", 'ü.mcap'][:files]
    written = [
        RecordedFile(name, 7 * k, 10**18 + k, 10**18 + 5 * k) for k, name in enumerate(names)
    ]
    topics = [
        RecordedTopic('/a', 'std_msgs/msg/String', 'latched', count=3),
        RecordedTopic('/b', 'geometry_msgs/msg/PoseArray', 'sensor_data', depth=32),
    ][:files]
    text = metadata_yaml(information_yaml(written, topics))
    content = yaml.safe_load(text)
    assert yaml.safe_dump(content, sort_keys=False, default_flow_style=False) == text
    information = content['rosbag2_bagfile_information']
    assert information['relative_file_paths'] == names
    assert [file['message_count'] for file in information['files']] == [0, 7, 14][:files]
    told = information['topics_with_message_count']
    assert [topic['message_count'] for topic in told] == [3, 0][: len(topics)]
