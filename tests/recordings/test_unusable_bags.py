# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a bag cannot be used for is said with its reason; the right value is that reason."""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path

import numpy as np
import pytest
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.data.tracks import load_tracks
from rigid_gns_core.errors import UserError
from rigid_gns_core.messages.poses import encode_string, PoseArrayCodec
from rigid_gns_core.recordings.importing.import_bags import import_bags
from rigid_gns_core.recordings.importing.options import ImportOptions
from rigid_gns_core.recordings.scoring.evaluate import score_bag
from rigid_gns_core.scenes.scene import Plane, Scene

START = 1_700_000_000_000_000_000  # [ns]
RATE = 100.0  # [Hz]
POSE_ARRAY = 'geometry_msgs/msg/PoseArray'
SCENE = Scene(surfaces=(Plane(),), radius=0.02, mass=0.003)


def thrown(time: float) -> np.ndarray:
    """Poses of a ball in free flight, shape (1, 7)."""
    place = [0.0, 1.0 * time, 1.0 + 3.0 * time - 0.5 * 9.81 * time**2]
    return np.array([[*place, 0.0, 0.0, 0.0, 1.0]])


def write_bag(
    folder: Path,
    poses: Callable[[float], np.ndarray] = thrown,
    *,
    stamp: Callable[[int], int] = lambda stamp: stamp,
    change: Callable[[bytes], bytes] = lambda cdr: cdr,
    predictions: range = range(0),
    frames: range = range(60),
) -> Path:
    """Record tracked poses at `RATE`, and exact predictions of the frames `predictions`."""
    with BagWriter(folder) as bag:
        for name in ('tracked_poses', 'predicted_poses'):
            bag.add_topic(f'/{name}', POSE_ARRAY, 'reliable')
        bag.add_topic('/simulator/scene', 'std_msgs/msg/String', 'latched')
        names = {'tracked': '/tracked_poses', 'predicted': '/predicted_poses'}
        said = {'scene': SCENE.to_mapping(), 'topics': names}
        bag.write('/simulator/scene', encode_string(json.dumps(said)), START)
        codec = PoseArrayCodec('world', 1)
        for k in range(max(frames.stop, predictions.stop)):
            now = START + round(k / RATE * 1e9)
            if k in frames:
                cdr = codec.encode(poses(k / RATE), stamp(now))
                bag.write('/tracked_poses', change(cdr), now)
            if k in predictions:
                bag.write('/predicted_poses', codec.encode(thrown(k / RATE), now), now)
    return folder


def no_place(time: float) -> np.ndarray:
    poses = thrown(time)
    poses[:, :3] = np.nan
    return poses


UNUSABLE = {
    'stamps of 0': ({'stamp': lambda stamp: 0}, r'stamps that do not rise: all are 0.000000000 s'),
    'XCDR2': ({'change': lambda cdr: b'\0\7' + cdr[2:]}, r'0x0007.*this is XCDR2'),
    'NaN': ({'poses': no_place}, r'60 of 60 frames are refused; the first: .*nan'),
}


@pytest.mark.parametrize('kind', UNUSABLE)
def test_the_reason_is_named(tmp_path: Path, kind: str) -> None:
    changes, reason = UNUSABLE[kind]
    bag = write_bag(tmp_path / 'bag', **changes)
    with pytest.raises(UserError, match=reason) as imported:
        import_bags([bag], tmp_path / 'data')
    with pytest.raises(UserError, match=reason) as scored:
        score_bag(read_bag(bag), tracked='/tracked_poses', model='laws')
    for error in imported, scored:
        assert 'record for longer' not in str(error.value)


def test_the_reason_is_named_beside_predictions(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'bag', no_place, predictions=range(10, 50))
    with pytest.raises(UserError, match=r'refused: .*the pose of sphere 0 is .*nan'):
        score_bag(read_bag(bag))


def test_the_damage_is_named_with_the_error(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'bag', stamp=lambda stamp: 0)
    (bag / 'metadata.yaml').unlink()
    for use in (
        lambda: import_bags([bag], tmp_path / 'data'),
        lambda: score_bag(read_bag(bag), tracked='/tracked_poses', model='laws'),
    ):
        with pytest.raises(UserError, match=r'(?s)do not rise.*no metadata.yaml'):
            use()


def test_predictions_that_were_tracked_are_scored_where_longer_ones_were_not(
    tmp_path: Path,
) -> None:
    bag = write_bag(tmp_path / 'bag', predictions=range(20, 50), frames=range(60))
    report = score_bag(read_bag(bag)).report
    assert (report['frames']['compared'], report['errors']['mse']) == (30, 0.0)
    with BagWriter(tmp_path / 'both') as both:
        for topic in read_bag(bag).topics.values():
            both.add_topic(topic.name, topic.type_name, 'reliable')
            for time, cdr in zip(topic.times.tolist(), topic.messages, strict=True):
                both.write(topic.name, cdr, time)
        codec = PoseArrayCodec('world', 1)  # and 100 predictions without a tracked frame
        for k in range(200, 300):
            now = START + round(k / RATE * 1e9)
            both.write('/predicted_poses', codec.encode(thrown(1.0), now), now)
    report = score_bag(read_bag(tmp_path / 'both')).report
    assert (report['frames']['compared'], report['errors']['mse']) == (30, 0.0)


@pytest.mark.parametrize('scale', [1000.0, 100.0])
def test_other_units_are_named_and_repaired(tmp_path: Path, scale: float) -> None:
    def scaled(time: float) -> np.ndarray:
        return thrown(time) * ([scale] * 3 + [1.0] * 4)

    bag = write_bag(tmp_path / 'bag', scaled, predictions=range(20, 50))
    expected = {1000.0: 'millimetres', 100.0: 'centimetres'}[scale]
    with pytest.raises(UserError, match=rf'in {expected}.*import.*--scale {1 / scale:g}'):
        score_bag(read_bag(bag))
    with pytest.raises(UserError, match=rf'in {expected}'):
        score_bag(read_bag(bag), tracked='/tracked_poses', model='laws')
    with pytest.raises(UserError, match=rf'in {expected}; give --scale {1 / scale:g}'):
        import_bags([bag], tmp_path / 'data')
    import_bags([bag], tmp_path / 'data', ImportOptions(scale=1 / scale))
    (track,) = load_tracks(tmp_path / 'data')
    truth = np.stack([thrown(time) for time in track.times])
    np.testing.assert_allclose(track.positions, truth[..., :3], atol=1e-12)


def test_another_axis_is_named_and_repaired(tmp_path: Path) -> None:
    def y_up(time: float) -> np.ndarray:
        poses = thrown(time)
        poses[:, :3] = poses[:, [0, 2, 1]] * [1, 1, -1]
        return poses

    bag = write_bag(tmp_path / 'bag', y_up)
    with pytest.raises(UserError, match=r'fall along \(0.00, -1.00, 0.00\).*--up y'):
        import_bags([bag], tmp_path / 'data')
    import_bags([bag], tmp_path / 'data', ImportOptions(up='y'))
    (track,) = load_tracks(tmp_path / 'data')
    truth = np.stack([thrown(time) for time in track.times])
    np.testing.assert_allclose(track.positions, truth[..., :3], atol=1e-12)
