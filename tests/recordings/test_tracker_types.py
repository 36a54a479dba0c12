# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags of trackers that send no PoseArray are imported and scored by the name of their topic."""

from __future__ import annotations

from pathlib import Path

from mcap.writer import Writer as McapWriter
import numpy as np
import pytest
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.data.tracks import load_tracks
from rigid_gns_core.errors import UserError
from rigid_gns_core.messages.cdr import Writer
from rigid_gns_core.messages.tracker_types import AS_POSE_ARRAY
from rigid_gns_core.recordings.importing.import_bags import import_bags
from rigid_gns_core.recordings.importing.options import ImportOptions
from rigid_gns_core.recordings.scoring.evaluate import score_bag
from rigid_gns_core.scenes.state import Array

START = 1_700_000_000_000_000_000  # [ns]
DT = 0.01  # [s]
TURN = (0.0, 0.0, 0.0, 1.0)


def flight(time: float) -> Array:
    """Centre of a ball in free flight [m], shape (3,)."""
    return np.array([1.0, 0.2, 3.0]) * time + [0, 0, 0.3] + 0.5 * np.array([0, 0, -9.81]) * time**2


def message(kind: str, stamp: int, place: Array) -> bytes:
    """One ball, written field by field."""
    to = Writer()
    to.header(stamp, 'lab')
    if kind == 'sensor_msgs/msg/PointCloud2':
        to.numbers('II', 1, 1)
        to.numbers('I', 3)
        for axis, name in enumerate('xyz'):
            to.text('name', name)
            to.numbers('I', 8 * axis)
            to.numbers('B', 8)
            to.numbers('I', 1)
        to.numbers('B', 0)
        to.numbers('III', 24, 24, 24)
        to.raw(place.astype('<f8').tobytes())
        to.numbers('B', 1)
    elif kind == 'geometry_msgs/msg/PointStamped':
        to.floats(place)
    elif kind == 'geometry_msgs/msg/PoseStamped':
        to.floats([*place, *TURN])
    elif kind == 'geometry_msgs/msg/PoseArray':
        to.numbers('I', 1)
        to.floats([*place, *TURN])
    else:  # arrays of objects
        if kind.startswith('mocap4r2'):
            to.numbers('I', 7)
        to.numbers('I', 1)
        if kind.endswith('Detection3DArray'):
            to.header(stamp, 'lab')
            to.numbers('I', 0)
            to.floats([*place, *TURN, 0.1, 0.1, 0.1])
            to.text('id', 'ball')
        elif kind.endswith('Markers'):
            to.numbers('b', 1)
            to.numbers('i', 0)
            to.text('marker_name', '')
            to.floats(place)
        else:
            to.text('name', 'ball')
            if kind.endswith('RigidBodies'):
                to.numbers('I', 0)
            to.floats([*place, *TURN])
    return to.cdr


def write_bag(path: Path, kind: str) -> Path:
    with path.open('wb') as file:
        writer = McapWriter(file)
        writer.start(profile='ros2')
        schema = writer.register_schema(kind, 'ros2msg', b'')
        channel = writer.register_channel('/theirs', 'cdr', schema)
        for k in range(60):
            stamp = START + round(k * DT * 1e9)
            writer.add_message(channel, stamp, message(kind, stamp, flight(k * DT)), stamp)
        writer.finish()
    return path


@pytest.mark.parametrize('kind', AS_POSE_ARRAY)
def test_import_and_evaluation_read_it(tmp_path: Path, kind: str) -> None:
    bag = write_bag(tmp_path / 'bag.mcap', kind)
    options = ImportOptions(scene='billiards', topic='/theirs')
    import_bags([bag], tmp_path / 'data', options)
    (track,) = load_tracks(tmp_path / 'data')
    truth = np.stack([flight(time) for time in track.times])
    np.testing.assert_allclose(track.positions[:, 0], truth, rtol=0, atol=1e-12)
    scored = score_bag(read_bag(bag), scene='billiards', tracked='/theirs', model='laws', starts=5)
    assert scored.report['errors']['position_error'] < 1e-3


def test_another_type_is_refused_with_those_that_are_read(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'bag.mcap', 'std_msgs/msg/String')
    with pytest.raises(UserError, match=r'no topic /theirs of type .*PointCloud2.*/theirs \(std_'):
        import_bags([bag], tmp_path / 'data', ImportOptions(scene='billiards', topic='/theirs'))
