# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags of a camera in a coordinate frame of its own, with the transforms in them."""

from __future__ import annotations

from pathlib import Path

from mcap.writer import Writer as McapWriter
import numpy as np
import pytest
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.data.tracks import load_tracks
from rigid_gns_core.errors import UserError
from rigid_gns_core.messages.cdr import Writer
from rigid_gns_core.messages.poses import PoseArrayCodec
from rigid_gns_core.recordings.importing.import_bags import import_bags
from rigid_gns_core.recordings.importing.options import ImportOptions
from rigid_gns_core.recordings.scoring.evaluate import score_bag
from rigid_gns_core.scenes.state import Array
from scipy.spatial.transform import Rotation

START = 1_700_000_000_000_000_000  # [ns]
DT = 0.01  # [s]
COUNT = 60
PLACE, SPEED, TURN = np.array([0.4, -1.0, 2.0]), np.array([0.2, 0.1, 0.0]), [0.3, 1.1, -2.0]


def flight(time: float) -> Array:
    """Centre of a ball in free flight [m], shape (3,)."""
    return np.array([1.0, 0.2, 3.0]) * time + [0, 0, 0.3] + 0.5 * np.array([0, 0, -9.81]) * time**2


def transform(stamp: int, parent: str, child: str, place: Array, turn: Array) -> bytes:
    message = Writer()
    message.numbers('I', 1)
    message.header(stamp, parent)
    message.text('child_frame_id', child)
    message.floats([*place, *turn])
    return message.cdr


def write_bag(path: Path, *, scale: float = 1.0, told: bool = True) -> Path:
    """A camera on a cart that moves evenly; the cart's place is told at 5 Hz, between frames."""
    turn = Rotation.from_rotvec(TURN)
    with path.open('wb') as file:
        writer = McapWriter(file)
        writer.start(profile='ros2')
        channels = {
            topic: writer.register_channel(
                topic, 'cdr', writer.register_schema(kind, 'ros2msg', b'')
            )
            for topic, kind in (
                ('/tracked_poses', 'geometry_msgs/msg/PoseArray'),
                ('/tf', 'tf2_msgs/msg/TFMessage'),
                ('/tf_static', 'tf2_msgs/msg/TFMessage'),
            )
        }

        def add(topic: str, cdr: bytes, stamp: int) -> None:
            writer.add_message(channels[topic], stamp, cdr, stamp)

        if told:
            mount = transform(0, 'cart', 'camera', np.zeros(3), turn.as_quat())
            add('/tf_static', mount, START)
        for k in range(COUNT + 20):
            stamp, time = START + round(k * DT * 1e9), k * DT
            place = PLACE + SPEED * time
            if told and k % 20 == 3:
                add('/tf', transform(stamp, 'world', 'cart', place, [0, 0, 0, 1]), stamp)
            seen = turn.inv().apply(flight(time) - place) / scale
            poses = np.array([[*seen, 0, 0, 0, 1]])
            add('/tracked_poses', PoseArrayCodec('camera', 1).encode(poses, stamp), stamp)
        writer.finish()
    return path


@pytest.mark.parametrize('scale', [1.0, 0.001])
def test_import_moves_them_into_the_frame_of_the_scene(tmp_path: Path, scale: float) -> None:
    bag = write_bag(tmp_path / 'bag.mcap', scale=scale)
    options = ImportOptions(scene='billiards', frame='world', scale=scale)
    (report,) = import_bags([bag], tmp_path / 'data', options)
    # before the first and after the last place of the cart nothing is known
    assert report['refused'] == {'frame': 3 + 16}
    (track,) = load_tracks(tmp_path / 'data')
    truth = np.stack([flight(time + 3 * DT) for time in track.times])
    np.testing.assert_allclose(track.positions[:, 0], truth, atol=1e-9)  # rounding alone


def test_evaluation_does_too(tmp_path: Path) -> None:
    bag = read_bag(write_bag(tmp_path / 'bag.mcap'))
    chosen = {'scene': 'billiards', 'tracked': '/tracked_poses', 'model': 'laws', 'starts': 5}
    scored = score_bag(bag, frame='world', **chosen)
    assert scored.report['errors']['position_error'] < 1e-3
    # in the camera's own frame balls do not fall along gravity
    with pytest.raises(UserError, match='fall along'):
        score_bag(bag, **chosen)


def test_without_transforms_both_frames_are_named(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'bag.mcap', told=False)
    options = ImportOptions(scene='billiards', frame='world')
    with pytest.raises(UserError, match="frame is 'camera', expected 'world'.*tell no transform"):
        import_bags([bag], tmp_path / 'data', options)
