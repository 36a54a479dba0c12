# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

from pathlib import Path

from mcap.reader import make_reader
import numpy as np
import pytest
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.messages.poses import encode_float64, encode_string
import yaml

START = 1_700_000_000_000_000_001  # as in conftest.py
SCENE, TICK = '/simulator/scene', '/tick'
STEP = 10_000_000  # [ns]


def write_split(folder: Path, number: int = 400, text: int = 500, **limits: float) -> list[bytes]:
    """Record a scene, said once, and ticks; return the ticks."""
    ticks = [encode_string(f'{k} ' + 'x' * text) for k in range(number)]
    with BagWriter(folder, **limits) as bag:
        bag.add_topic(SCENE, 'std_msgs/msg/String', 'latched')
        bag.add_topic(TICK, 'std_msgs/msg/String', 'reliable')
        bag.write(SCENE, encode_string('scene'), START)
        for k, tick in enumerate(ticks):
            bag.write(TICK, tick, START + k * STEP)
    assert (bag.error, bag.lost) == (None, 0)
    assert bag.topics == {SCENE: 1, TICK: number}
    return ticks


def metadata(folder: Path) -> dict:
    return yaml.safe_load((folder / 'metadata.yaml').read_text())['rosbag2_bagfile_information']


def test_size_splits_a_bag_into_files_that_stand_alone(tmp_path):
    folder = tmp_path / 'bag'
    ticks = write_split(folder, max_size=0.05)
    information = metadata(folder)
    files = information['relative_file_paths']
    assert files == [f'bag_{k}.mcap' for k in range(len(files))]
    assert len(files) >= 4
    assert sorted(path.name for path in folder.glob('*.mcap')) == sorted(files)
    # the limit is of the messages; index and repeated texts of types come on top
    assert all((folder / name).stat().st_size < 80_000 for name in files)
    bag = read_bag(folder)
    assert bag.warnings == ()
    assert bag.topics[SCENE].messages == [encode_string('scene')]
    assert bag.topics[TICK].messages == ticks
    alone = [read_bag(folder / name) for name in files]
    assert all(one.topics[SCENE].messages == [encode_string('scene')] for one in alone)
    assert [cdr for one in alone for cdr in one.topics[TICK].messages] == ticks
    # it is repeated at the time of the last message before it, so that playing has no gap
    assert [int(one.topics[SCENE].times[0]) for one in alone[1:]] == [
        int(one.topics[TICK].times[-1]) for one in alone[:-1]
    ]


def test_metadata_describes_each_file(tmp_path):
    write_split(tmp_path / 'bag', max_duration=1.0)
    information = metadata(tmp_path / 'bag')
    files = information['files']
    assert [file['path'] for file in files] == information['relative_file_paths']
    # a file may last 1 s: 101 ticks, the first of a later one repeats the time before it
    assert [file['message_count'] for file in files] == [102, 101, 101, 100]
    assert files[1]['starting_time'] == {'nanoseconds_since_epoch': START + 100 * STEP}
    assert files[1]['duration'] == {'nanoseconds': 100 * STEP}
    assert information['message_count'] == 404
    counts = [entry['message_count'] for entry in information['topics_with_message_count']]
    assert counts == [4, 400]
    assert information['duration'] == {'nanoseconds': 399 * STEP}


def test_other_readers_read_split_bags(tmp_path):
    highlevel = pytest.importorskip('rosbags.highlevel', reason='rosbags is not installed')
    decoder = pytest.importorskip('mcap_ros2.decoder', reason='mcap-ros2-support is not installed')
    folder = tmp_path / 'bag'
    ticks = write_split(folder, max_size=0.05)
    files = metadata(folder)['relative_file_paths']
    with highlevel.AnyReader([folder]) as reader:
        read = [bytes(cdr) for connection, _, cdr in reader.messages() if connection.topic == TICK]
        scenes = [c.topic for c, _, _ in reader.messages() if c.topic == SCENE]
    assert (read, len(scenes)) == (ticks, len(files))
    texts = []
    for name in files:
        with open(folder / name, 'rb') as file:
            mcap = make_reader(file, decoder_factories=[decoder.DecoderFactory()])
            decoded = list(mcap.iter_decoded_messages())
            texts += [message.data for _, channel, _, message in decoded if channel.topic == TICK]
            assert 'scene' in [message.data for _, _, _, message in decoded]
    assert [encode_string(text) for text in texts] == ticks


def test_a_message_beyond_the_limit_has_a_file_of_its_own(tmp_path):
    ticks = write_split(tmp_path / 'bag', number=3, text=2000, max_size=0.001)
    bag = read_bag(tmp_path / 'bag')
    assert bag.topics[TICK].messages == ticks
    assert len(metadata(tmp_path / 'bag')['files']) == 4  # the scene, then a file for each


def test_a_kill_while_the_next_file_is_made_leaves_all_before(tmp_path):
    folder = tmp_path / 'bag'
    ticks = write_split(folder, max_size=0.05)
    (folder / 'metadata.yaml').unlink()
    last = sorted(folder.glob('*.mcap'), key=lambda path: int(path.stem.split('_')[1]))[-1]
    kept = len(ticks) - len(read_bag(last).topics[TICK])
    for length in (0, 5, 100):
        last.write_bytes(last.read_bytes()[:length])
        bag = read_bag(folder)
        assert bag.topics[TICK].messages[:kept] == ticks[:kept]
        assert 'the recorder did not finish' in bag.warnings[0]
        assert last.name in bag.warnings[1]


def test_missing_messages_are_counted(tmp_path):
    folder = tmp_path / 'bag'
    write_split(folder, max_size=0.05)
    part = len(read_bag(folder / 'bag_1.mcap').topics[TICK])
    (folder / 'bag_1.mcap').unlink()
    warnings = read_bag(folder).warnings
    assert any('bag_1.mcap: named in metadata.yaml, but missing' in text for text in warnings)
    assert any(f'{part} messages of /tick are missing in between' in text for text in warnings)


def test_limits_are_checked(tmp_path):
    with pytest.raises(ValueError, match='max_size is -1, expected 0'):
        BagWriter(tmp_path / 'a', max_size=-1)
    with pytest.raises(ValueError, match='max_duration is nan, expected 0'):
        BagWriter(tmp_path / 'b', max_duration=float('nan'))
    assert not list(tmp_path.iterdir())


def test_times_that_go_back_do_not_split_for_ever(tmp_path):
    with BagWriter(tmp_path / 'bag', max_duration=1.0) as bag:
        bag.add_topic('/a', 'std_msgs/msg/Float64', 'reliable')
        for k in range(20):
            bag.write('/a', encode_float64(k), START + (k % 10) * 50_000_000)
    topic = read_bag(tmp_path / 'bag').topics['/a']
    assert len(metadata(tmp_path / 'bag')['files']) == 1
    np.testing.assert_array_equal(np.sort(topic.times), topic.times)


def test_a_next_file_that_cannot_be_made_stops_the_recording_alone(tmp_path):
    said = []
    bag = BagWriter(tmp_path / 'bag', max_duration=0.5, on_error=said.append)
    (tmp_path / 'bag' / 'bag_1.mcap').mkdir()  # fails as a disk without room does
    bag.add_topic(TICK, 'std_msgs/msg/String', 'reliable')
    for k in range(100):
        bag.write(TICK, encode_string(str(k)), START + k * STEP)
    bag.close()
    assert len(said) == 1
    assert 'has stopped' in said[0]
    kept = read_bag(tmp_path / 'bag' / 'bag_0.mcap').topics[TICK]
    assert len(kept) + bag.lost == 100
    assert len(kept) == 51
