# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`evaluate` of bags without predictions, and errors by the time since a start."""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path
import subprocess
import sys

import numpy as np
import pytest
from recorded_bags import evaluate_bag
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.commands.cli import evaluate
from rigid_gns_core.commands.evaluate import format_report
from rigid_gns_core.files.strict_json import read_json
from rigid_gns_core.messages.poses import encode_string, PoseArrayCodec
from rigid_gns_core.prediction.load import load_simulator
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.state import Trajectory

START = 1_700_000_000_123_456_789
STEP = 100_000_000  # [ns]
POSE_ARRAY = 'geometry_msgs/msg/PoseArray'
SCENE = Scene(surfaces=Plane.box(60.0, 60.0))
PLACES = np.array([[-6.0, 0.0, 12.0], [0.0, 0.0, 20.0], [6.0, 0.0, 30.0]])


@pytest.fixture(scope='module')
def truth() -> Trajectory:
    """Return what the model itself predicts: 8 s of three spheres that fall and bounce."""
    return load_simulator().rollout(SCENE, PLACES, steps=80)


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / 'scene.yaml'
    path.write_text(json.dumps({'scene': SCENE.to_mapping()}))
    return path


def poses_of(truth: Trajectory, number: int) -> np.ndarray:
    return np.concatenate([truth.positions[number], truth.quaternions[number]], axis=1)


def write_tracks(
    folder: Path,
    truth: Trajectory,
    *,
    frames: list[int] | None = None,
    poses: Callable[[int, np.ndarray], np.ndarray] = lambda _, poses: poses,
) -> Path:
    """Return what `ros2 bag record /vicon/balls` leaves of a tracker that is 20 ms late."""
    with BagWriter(folder) as bag:
        bag.add_topic('/vicon/balls', POSE_ARRAY, 'sensor_data')
        for number in frames if frames is not None else range(81):
            found = poses(number, poses_of(truth, number))
            stamp = START + number * STEP
            cdr = PoseArrayCodec('lab', len(found)).encode(found, stamp)
            bag.write('/vicon/balls', cdr, stamp + 20_000_000)
    return folder


def test_tracks_that_follow_the_model_have_no_error(tmp_path, truth, scene):
    bag = write_tracks(tmp_path / 'bag', truth)
    report = evaluate_bag(bag, tracked='/vicon/balls', scene=scene, starts=8)
    assert list(report['horizon_errors']) == ['0.1', '0.3', '1', '3']
    one = report['horizon_errors']['1']
    assert one['starts'] >= 6
    # free flight is exact; a window with a bounce in it has a wrong velocity
    assert one['median_m'] < 0.05
    assert one['median_m'] <= one['p90_m'] <= one['max_m']
    assert report['recording']['model'] == 'laws'
    assert report['timing']['tracked_lateness_p50_ms'] == pytest.approx(20.0)
    assert (report['frames']['segments'], report['frames']['cuts']) == (1, 0)
    assert report['frames']['starts'] == 8
    assert report['errors']['position_error'] < 1.0
    text = format_report(report)
    assert 'Position error since a start [m]' in text
    assert 'after 0.3 s' in text


def test_gaps_and_other_numbers_of_spheres_cut_the_frames(tmp_path, truth, scene):
    def poses(number: int, found: np.ndarray) -> np.ndarray:
        return found[:2] if 30 <= number < 40 else found

    frames = [number for number in range(81) if not 60 <= number < 65]
    bag = write_tracks(tmp_path / 'bag', truth, frames=frames, poses=poses)
    report = evaluate_bag(bag, tracked='/vicon/balls', scene=scene, starts=10)
    assert (report['frames']['segments'], report['frames']['cuts']) == (4, 3)
    assert report['frames']['compared_s'] < 3.0  # of the longest segment
    # no segment is 3 s long after its window
    assert list(report['horizon_errors']) == ['0.1', '0.3', '1']
    notes = ' '.join(report['notes'])
    assert '2 for another number of spheres, 1 for missing frames' in notes


def test_an_uneven_tracker_is_compared_without_a_chord(tmp_path, truth, scene):
    """Frames 40 ms apart, of flight alone: the model's steps are at other times."""
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add_topic('/balls', POSE_ARRAY, 'reliable')
        for number in range(30):
            t = 0.04 * number
            poses = poses_of(truth, 0)
            poses[:, 2] -= 4.905 * t * t
            stamp = START + round(t * 1e9)
            bag.write('/balls', PoseArrayCodec('lab', 3).encode(poses, stamp), stamp)
    report = evaluate_bag(tmp_path / 'bag', tracked='/balls', scene=scene)
    assert report['horizon_errors']['0.3']['max_m'] < 1e-3  # a chord would be 2 mm off


def test_predictions_are_counted_from_each_start(tmp_path, scene):
    """Off by 0.1 m times the time since the start, of which there are three."""
    codec, said = PoseArrayCodec('world', 1), {'scene': SCENE.to_mapping(), 'model': 'laws'}
    starts = [0, 15, 37]

    def poses(stamp: int, off: float = 0.0) -> np.ndarray:
        t = (stamp - START) * 1e-9
        return np.array([[t + off, 0.0, 5.0, 0.0, 0.0, 0.0, 1.0]])

    def write(folder: Path, with_starts: bool) -> Path:
        with BagWriter(folder) as bag:
            for name in ('/tracked_poses', '/predicted_poses'):
                bag.add_topic(name, POSE_ARRAY, 'reliable')
            for name in ('/simulator/scene', '/simulator/start'):
                bag.add_topic(name, 'std_msgs/msg/String', 'latched')
            bag.write('/simulator/scene', encode_string(json.dumps(said)), START)
            begin = 0
            for number in range(70):
                stamp = START + number * STEP
                shift = 0 if number < 15 else 31_000_000 if number < 37 else 47_000_000
                stamp += shift
                bag.write('/tracked_poses', codec.encode(poses(stamp), stamp), stamp)
                if number in starts:
                    begin = stamp
                    text = json.dumps({'stamp_ns': stamp, 'window_ns': [stamp], 'reason': 'reset'})
                    if with_starts:
                        bag.write('/simulator/start', encode_string(text), stamp)
                ahead = stamp + STEP
                cdr = codec.encode(poses(ahead, 0.1e-9 * (ahead - begin)), ahead)
                bag.write('/predicted_poses', cdr, ahead)
        return folder

    for name, with_starts in (('said', True), ('told', False)):
        report = evaluate_bag(write(tmp_path / name, with_starts))
        errors = report['horizon_errors']
        assert {key: entry['starts'] for key, entry in errors.items()} == {
            '0.1': 3, '0.3': 3, '1': 3, '3': 1,
        }  # fmt: skip
        for key, entry in errors.items():
            assert entry['mean_m'] == pytest.approx(0.1 * float(key), rel=1e-6)
        assert report['frames']['restarts'] == 2
        assert report['frames'].get('starts') == (3 if with_starts else None)


def test_poses_in_any_order_and_missing_ones_are_matched(tmp_path, truth, scene):
    def seen(number: int, poses: np.ndarray) -> np.ndarray:
        rng = np.random.default_rng(number)
        return rng.permutation(poses)[: 2 if number % 5 == 0 else 3]

    bag = write_tracks(tmp_path / 'bag', truth, poses=seen)
    with pytest.raises(ValueError, match="cuts: {'count': 32.*--match follows spheres"):
        evaluate_bag(bag, tracked='/vicon/balls', scene=scene)
    report = evaluate_bag(bag, tracked='/vicon/balls', scene=scene, starts=8, match=True)
    # the frames before all three are found, of which frame 5 lacks one
    assert report['frames']['tracked_refused'] <= 10
    assert report['frames']['segments'] <= 2
    one = report['horizon_errors']['1']
    assert one['starts'] >= 5
    assert one['median_m'] < 0.05


def test_the_module_is_a_program() -> None:
    command = [sys.executable, '-m', 'rigid_gns_core.commands.cli', 'evaluate', '/nonesuch']
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, '')
    assert done.stderr == 'rigid-gns evaluate: error: /nonesuch: no such bag\n'


def test_what_is_missing_is_named(tmp_path, truth, scene):
    bag = write_tracks(tmp_path / 'bag', truth)
    with pytest.raises(ValueError, match='no .*/scene topic says what the scene is.*--scene'):
        evaluate_bag(bag, tracked='/vicon/balls')
    with pytest.raises(ValueError, match='no topic /nowhere .*--topic'):
        evaluate_bag(bag, tracked='/nowhere', scene=scene)
    with pytest.raises(ValueError, match="no model 'nonesuch'"):
        evaluate_bag(bag, tracked='/vicon/balls', scene=scene, model='nonesuch')
    short = write_tracks(tmp_path / 'short', truth, frames=[0, 1, 2])
    with pytest.raises(ValueError, match='no stretch of /vicon/balls holds 6 frames and 0.1 s'):
        evaluate_bag(short, tracked='/vicon/balls', scene=scene)
    with pytest.raises(ValueError, match='starts is 0, expected at least 1'):
        evaluate_bag(bag, tracked='/vicon/balls', scene=scene, starts=0)


def test_the_command_rolls_out_and_draws(tmp_path, truth, scene, capsys):
    pytest.importorskip('matplotlib', reason='matplotlib is not installed')
    bag = write_tracks(tmp_path / 'bag', truth)
    figure = tmp_path / 'bag.png'
    options = ['--topic', '/vicon/balls', '--scene', str(scene), '--model', 'laws']
    assert evaluate([str(bag), *options, '--starts', '3', '--figure', str(figure)]) == 0
    assert 'Position error since a start' in capsys.readouterr().out
    assert figure.read_bytes().startswith(b'\x89PNG')
    assert read_json(tmp_path / 'bag_evaluation.json')['horizon_errors']['1']['starts'] >= 2
