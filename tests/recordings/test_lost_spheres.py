# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Lost spheres in recordings: NaN, or exactly the origin, in bags and CSV files alike."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.data.tracks import load_tracks
from rigid_gns_core.messages.poses import PoseArrayCodec
from rigid_gns_core.recordings.importing.import_bags import import_bags
from rigid_gns_core.recordings.importing.options import ImportOptions
from rigid_gns_core.recordings.scoring.evaluate import score_bag
from rigid_gns_core.scenes.state import Array

START = 1_700_000_000_000_000_000  # [ns]
DT = 0.01  # [s]
LOST = (20, 21, 30)  # frames in which the second ball is not seen
OPTIONS = ImportOptions(scene='billiards')


def flight(time: float) -> Array:
    """Centres of two balls in free flight [m], shape (2, 3)."""
    places = np.array([[0.0, -0.3, 0.3], [0.2, 0.3, 0.4]])
    velocities = np.array([[1.0, 0.2, 2.0], [-0.5, -0.2, 2.5]])
    return places + velocities * time + 0.5 * np.array([0.0, 0.0, -9.81]) * time**2


def write_bag(folder: Path, lost: float) -> Path:
    """A bag of 40 frames in which a lost ball is at (lost, lost, lost)."""
    with BagWriter(folder) as bag:
        bag.add_topic('/tracked_poses', 'geometry_msgs/msg/PoseArray', 'reliable')
        for k in range(40):
            poses = np.concatenate([flight(k * DT), np.tile([0.0, 0.0, 0.0, 1.0], (2, 1))], axis=1)
            if k in LOST:
                poses[1, :3] = lost
            stamp = START + round(k * DT * 1e9)
            bag.write('/tracked_poses', PoseArrayCodec('world', 2).encode(poses, stamp), stamp)
    return folder


@pytest.mark.parametrize('lost', [np.nan, 0.0])
def test_a_bag_keeps_the_frame_and_fills_the_ball(tmp_path: Path, lost: float) -> None:
    bag = write_bag(tmp_path / 'bag', lost)
    (report,) = import_bags([bag], tmp_path / 'data', OPTIONS)
    assert (report['filled'], report['refused']) == (3, {})
    (track,) = load_tracks(tmp_path / 'data')
    assert len(track.times) == 40
    truth = np.stack([flight(time) for time in track.times])
    # a parabola through exact places: rounding alone
    np.testing.assert_allclose(track.positions, truth, atol=1e-9)
    scored = score_bag(
        read_bag(bag), scene='billiards', tracked='/tracked_poses', model='laws', starts=5
    )
    assert scored.report['frames']['segments'] == 1
    assert scored.report['errors']['position_error'] < 1e-3


def test_a_csv_file_has_no_ball_there(tmp_path: Path) -> None:
    path = tmp_path / 'balls.csv'
    lines = ['track,sphere,time,x,y,z']
    for k in range(40):
        places = flight(k * DT)
        places[1] = 0.0 if k in LOST else places[1]
        lines += [f'0,{n},{k * DT:.4f},{x!r},{y!r},{z!r}' for n, (x, y, z) in enumerate(
            places.tolist())]  # fmt: skip
    path.write_text('\n'.join(lines))
    import_bags([path], tmp_path / 'data', OPTIONS)
    (track,) = load_tracks(tmp_path / 'data')
    assert np.flatnonzero(~track.seen[:, 1]).tolist() == list(LOST)
    assert track.seen[:, 0].all()
