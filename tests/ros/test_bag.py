from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from rigid_gns_ros import definitions
from rigid_gns_ros.bag import BagWriter
from rigid_gns_ros.bag_reader import BagError, read_bag
from rigid_gns_ros.messages import PoseArrayCodec, decode_float64, encode_float64, encode_string

ROOT = Path(__file__).parents[2]
START = 1_700_000_000_000_000_001
POSE_ARRAY = 'geometry_msgs/msg/PoseArray'


def poses_cdr(number: int, count: int = 5) -> bytes:
    poses = np.random.default_rng(number).normal(size=(count, 7))
    return PoseArrayCodec('world', count).encode(poses, START + number)


def write_bag(folder: Path, number: int = 100) -> dict[str, list[bytes]]:
    """A bag as the simulator records it; returns the bytes of each topic."""
    written = {'/lab/predicted_poses': [], '/simulator/scene': [], '/simulator/step_time': []}
    with BagWriter(folder) as bag:
        bag.add_topic('/lab/predicted_poses', POSE_ARRAY, 'reliable')
        bag.add_topic('/lab/tracked_poses', POSE_ARRAY, 'sensor_data')
        bag.add_topic('/simulator/scene', 'std_msgs/msg/String', 'latched')
        bag.add_topic('/simulator/step_time', 'std_msgs/msg/Float64', 'reliable')
        for k in range(number):
            for topic, cdr in [
                ('/lab/predicted_poses', poses_cdr(k)),
                ('/simulator/scene', encode_string(f'{{"π": {k}}}')),
                ('/simulator/step_time', encode_float64(k)),
            ]:
                bag.write(topic, cdr, START + k * 10_000_000)
                written[topic].append(cdr)
    assert (bag.error, bag.lost) == (None, 0)
    return written


def test_own_reader_gives_the_bytes_back(tmp_path):
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


def test_rosbags_reads_it(tmp_path):
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


def test_mcap_ros2_reads_it(tmp_path):
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


def test_metadata_is_that_of_rosbag2_jazzy(tmp_path):
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
        entry['topic_metadata']['name']: entry for entry in information['topics_with_message_count']
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
        channels = summary.channels.values()
        assert {c.metadata['topic_type_hash'] for c in channels} == {
            definitions.type_hash(name) for name in definitions.TYPES
        }


def test_definitions_are_those_of_the_installed_ros():
    index = pytest.importorskip('ament_index_python.packages', reason='ROS is not installed')

    def share(package: str) -> Path:
        try:
            return Path(index.get_package_share_directory(package))
        except (LookupError, OSError):  # wheels, where no environment is sourced
            return Path(sys.prefix) / 'share' / package

    for name, text in definitions.TEXTS.items():
        package, kind = name.split('/')
        path = share(package) / 'msg' / f'{kind}.msg'
        if not path.is_file():
            pytest.skip(f'{path} is not there')
        assert text == path.read_text()
    for name, (expected, parts) in definitions.TYPES.items():
        package, _, kind = name.split('/')
        hashes = json.loads((share(package) / 'msg' / f'{kind}.json').read_text())['type_hashes']
        found = {entry['type_name'].replace('/msg/', '/'): entry['hash_string'] for entry in hashes}
        assert found.pop(f'{package}/{kind}') == expected
        assert set(found) == set(parts)


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
        with pytest.raises(ValueError, match="'std_msgs/msg/Int8' cannot be recorded; known: geom"):
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


WRITER = """
import sys, time
from rigid_gns_ros.bag import BagWriter
from rigid_gns_ros.messages import encode_float64
bag = BagWriter(sys.argv[1], on_error=lambda text: print(text, flush=True))
bag.add_topic('/a', 'std_msgs/msg/Float64', 'reliable')
"""


def run_writer(folder: Path, body: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, '-c', WRITER + body, str(folder)],
        text=True,
        stdout=subprocess.PIPE,
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
    )


def test_a_killed_recorder_loses_half_a_second_at_most(tmp_path):
    process = run_writer(
        tmp_path / 'bag',
        """
for k in range(100_000):
    bag.write('/a', encode_float64(k), time.time_ns())
    print(k, flush=True)
    time.sleep(0.01)
""",
    )
    assert process.stdout is not None
    begin = time.monotonic()
    sent = 0
    while time.monotonic() < begin + 2.0:
        sent = int(process.stdout.readline())
    os.kill(process.pid, signal.SIGKILL)
    process.wait(timeout=10)
    process.stdout.close()
    bag = read_bag(tmp_path / 'bag')
    messages = bag.topics['/a'].messages
    assert messages == [encode_float64(k) for k in range(len(messages))]
    # flushed every 0.5 s of 2 s; a second of slack, since the machine may be busy
    assert len(messages) > sent * 0.25
    assert 'no metadata.yaml, so the recorder did not finish' in bag.warnings[0]
    assert 'has no end' in bag.warnings[1]


def test_a_recorder_that_nobody_closed_is_closed_at_exit(tmp_path):
    process = run_writer(
        tmp_path / 'bag',
        """
for k in range(10):
    bag.write('/a', encode_float64(k), k)
raise SystemExit(3)
""",
    )
    process.communicate(timeout=20)
    assert process.returncode == 3
    bag = read_bag(tmp_path / 'bag')
    assert (len(bag.topics['/a']), bag.warnings) == (10, ())


def test_a_full_disk_stops_the_recording_but_not_the_program(tmp_path):
    # a limit on the size of files fails in the same way, in the middle of a write
    process = run_writer(
        tmp_path / 'bag',
        """
import resource
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
for k in range(5000):
    bag.write('/a', encode_float64(k), k)
while bag.error is None:
    time.sleep(0.01)
bag.write('/a', encode_float64(0), 0)
bag.close()
print(bag.topics['/a'], bag.lost, flush=True)
""",
    )
    out, _ = process.communicate(timeout=20)
    assert process.returncode == 0
    error, counts = out.splitlines()
    assert 'recording into' in error
    assert 'has stopped' in error
    lost = int(counts.split()[1])
    bag = read_bag(tmp_path / 'bag')
    assert not (tmp_path / 'bag' / 'metadata.yaml').exists()
    assert len(bag.topics.get('/a', ())) + lost >= 5001


def test_a_torn_file_gives_all_that_is_whole(tmp_path):
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
    assert 'torn' in read_bag(path).warnings[0]


@pytest.mark.parametrize('mode', ['storage', 'file', 'message'])
def test_bags_of_other_recorders_are_read(tmp_path, mode):
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
    with pytest.raises(BagError, match='stored as sqlite3, expected mcap; convert'):
        read_bag(tmp_path)


def test_a_folder_with_missing_parts_says_so(tmp_path):
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
    assert list(topic.places) == [0, 4, 2, 6, 8, 10, 12, 14]
