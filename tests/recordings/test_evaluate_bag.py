# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

from collections.abc import Callable, Iterable
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
from rigid_gns_core.messages.poses import encode_float64, encode_string, PoseArrayCodec
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.state import rotate_quaternions

ROOT = Path(__file__).parents[2]
START = 1_700_000_000_123_456_789
PERIOD = 100_000_000  # [ns]
POSE_ARRAY = 'geometry_msgs/msg/PoseArray'
SCENE = Scene(surfaces=Plane.box(60.0, 60.0))
SPHERES = np.array([[-5.0, 0.0, 60.0], [0.0, 0.0, 60.0], [5.0, 0.0, 60.0]])
SPIN = np.array([0.0, 1.0, 2.0])  # [rad/s]


def flight(stamp_ns: int) -> np.ndarray:
    """Poses of three spheres in free flight, shape (3, 7)."""
    t = (stamp_ns - START) * 1e-9
    positions = SPHERES + [1.0 * t, 2.0 * t, -0.5 * 9.81 * t * t]
    quaternions = rotate_quaternions(np.tile([0.0, 0.0, 0.0, 1.0], (3, 1)), SPIN * t)
    return np.concatenate([positions, quaternions], axis=1)


def every_period(first: int, last: int, offset: int = 0) -> list[int]:
    return [START + k * PERIOD + offset for k in range(first, last)]


def write_bag(
    folder: Path,
    predicted: Iterable[int],
    tracked: Iterable[int],
    *,
    error: float = 0.05,
    lateness: Callable[[int], int] = lambda k: 3_000_000,
    scene: bool = True,
    start: str = 'first',
    poses: Callable[[int], np.ndarray] = flight,
    namespace: str = '/lab',
) -> Path:
    """Return a bag of predictions at these stamps, `error` [m] off in x, `lateness` [ns] late."""
    codec = PoseArrayCodec('world', 3)
    with BagWriter(folder) as bag:
        bag.add_topic(f'{namespace}/tracked_poses', POSE_ARRAY, 'sensor_data')
        bag.add_topic(f'{namespace}/predicted_poses', POSE_ARRAY, 'reliable')
        if scene:
            bag.add_topic(f'{namespace}/simulator/scene', 'std_msgs/msg/String', 'latched')
            bag.write(
                f'{namespace}/simulator/scene',
                encode_string(
                    json.dumps(
                        {
                            'scene': SCENE.to_mapping(),
                            'model': 'gns',
                            'dt': 0.1,
                            'model_card': {},
                            'parameters': {'start': start},
                        }
                    )
                ),
                START,
            )
        bag.add_topic(f'{namespace}/simulator/step_time', 'std_msgs/msg/Float64', 'reliable')
        for stamp in tracked:
            cdr = codec.encode(poses(stamp), stamp)
            bag.write(f'{namespace}/tracked_poses', cdr, stamp + 1_000_000)
        for k, stamp in enumerate(predicted):
            cdr = codec.encode(flight(stamp) + error * np.eye(7)[0], stamp)
            bag.write(f'{namespace}/predicted_poses', cdr, stamp + lateness(k))
            bag.write(
                f'{namespace}/simulator/step_time', encode_float64(1e-3 * (k % 2 + 1)), stamp
            )
    return folder


def test_a_known_error_and_a_known_lateness(tmp_path):
    # lateness 0, 1, ... 19 ms
    bag = write_bag(
        tmp_path / 'bag', every_period(1, 21), every_period(0, 30), lateness=lambda k: k * 10**6
    )
    report = evaluate_bag(bag)
    # float64 positions of 60 m: rounding far below 1e-12
    assert report['errors']['mse'] == pytest.approx(0.05**2, abs=1e-12)
    assert report['errors']['position_error'] == pytest.approx(0.05, abs=1e-12)
    # differences of positions over 0.1 s
    assert report['errors']['velocity_error'] == pytest.approx(0.0, abs=1e-11)
    assert report['errors']['spin_error'] == pytest.approx(0.0, abs=1e-7)
    assert report['laws']['predicted']['rotational_energy'] > 0
    assert (report['steps'], report['dt'], report['spheres']) == (19, 0.1, 3)
    frames = report['frames']
    assert (frames['tracked'], frames['predicted'], frames['compared']) == (30, 20, 20)
    assert (frames['restarts'], frames['missing'], frames['interpolated']) == (0, 0, 0)
    timing = report['timing']
    assert timing['lateness_p50_ms'] == pytest.approx(9.5)
    assert timing['lateness_max_ms'] == pytest.approx(19.0)
    assert timing['period_mean_ms'] == pytest.approx(101.0)  # a millisecond later each time
    assert timing['period_std_ms'] == pytest.approx(0.0, abs=1e-9)
    assert timing['publishing_rate_hz'] == pytest.approx(1 / 0.101)
    assert (timing['step_p50_ms'], timing['step_max_ms']) == (1.5, 2.0)
    assert report['recording']['model'] == 'gns'


def test_tracked_poses_between_the_predicted_times_are_interpolated(tmp_path):
    bag = write_bag(
        tmp_path / 'bag', every_period(1, 21), every_period(0, 30, PERIOD // 2), error=0.0
    )
    report = evaluate_bag(bag)
    assert report['frames']['interpolated'] == 20
    # a chord of free flight lies g T^2 / 8 below it
    assert report['errors']['position_error'] == pytest.approx(9.81 * 0.1**2 / 8, rel=1e-6)
    assert report['errors']['rotation_error'] == pytest.approx(0.0, abs=1e-7)
    assert any('20 of 20 tracked poses are interpolated' in note for note in report['notes'])


def test_only_the_longest_stretch_of_one_start_is_compared(tmp_path):
    # 5 predictions, a restart half a period later, 12 predictions, of which one is missing
    stamps = every_period(1, 6) + every_period(6, 18, PERIOD // 2)
    del stamps[9]
    report = evaluate_bag(write_bag(tmp_path / 'bag', stamps, every_period(0, 60, 0)))
    frames = report['frames']
    assert (frames['restarts'], frames['missing'], frames['bridged']) == (1, 1, 1)
    assert (frames['predicted'], frames['compared']) == (16, 12)
    notes = ' '.join(report['notes'])
    assert 'restarted 1 times; the longest run with tracked poses, 1.1 s' in notes
    assert '1 predictions are missing and were interpolated' in notes


def test_a_long_gap_ends_a_stretch(tmp_path):
    stamps = every_period(1, 6) + every_period(10, 20)
    report = evaluate_bag(write_bag(tmp_path / 'bag', stamps, every_period(0, 30)))
    frames = report['frames']
    assert (frames['restarts'], frames['missing'], frames['compared']) == (0, 4, 10)


def test_predictions_from_every_frame_follow_an_uneven_tracker(tmp_path):
    rng = np.random.default_rng(0)
    tracked = [stamp + int(rng.integers(-5_000_000, 5_000_000)) for stamp in every_period(0, 30)]
    predicted = [stamp + PERIOD for stamp in tracked[:20]]
    report = evaluate_bag(write_bag(tmp_path / 'bag', predicted, tracked, start='every'))
    assert report['frames']['compared'] == 20
    assert any('one period ahead' in note for note in report['notes'])


def test_only_the_time_that_was_tracked_is_compared(tmp_path):
    report = evaluate_bag(write_bag(tmp_path / 'bag', every_period(1, 40), every_period(3, 20)))
    assert report['frames']['compared'] == 17


def test_tracked_frames_that_the_node_refuses_are_left_out(tmp_path):
    def poses(stamp: int) -> np.ndarray:
        values = flight(stamp)
        if stamp == START + 5 * PERIOD:
            values[1, 2] = np.nan
        if stamp == START + 6 * PERIOD:
            values[1, 3:] = 1e9
        return values

    tracked = [*every_period(0, 10), *every_period(8, 20)]
    report = evaluate_bag(write_bag(tmp_path / 'bag', every_period(1, 18), tracked, poses=poses))
    assert report['frames']['tracked_refused'] == 4
    assert any(
        '1 for their quaternion, 2 for their duplicate, 1 for their unseen' in note
        for note in report['notes']
    )


def test_what_is_missing_is_named_with_what_is_there(tmp_path):
    with BagWriter(tmp_path / 'other') as bag:
        bag.add_topic('/lab/tracked_poses', POSE_ARRAY, 'sensor_data')
    with pytest.raises(
        ValueError,
        match=r'no topic .*predicted_poses .*--predicted. The bag holds '
        r'/lab/tracked_poses \(geometry_msgs/msg/PoseArray, 0 messages\)',
    ):
        evaluate_bag(tmp_path / 'other')
    apart = write_bag(tmp_path / 'apart', every_period(1, 10), every_period(50, 60))
    with pytest.raises(ValueError, match='do not overlap: predictions are for 1700000000.223'):
        evaluate_bag(apart)
    single = write_bag(tmp_path / 'single', every_period(1, 2), every_period(0, 10))
    with pytest.raises(ValueError, match='no two in a row'):
        evaluate_bag(single)
    counts = write_bag(tmp_path / 'counts', every_period(1, 10), every_period(0, 20))
    with BagWriter(tmp_path / 'four') as bag:
        bag.add_topic('/tracked_poses', POSE_ARRAY, 'reliable')
        bag.add_topic('/predicted_poses', POSE_ARRAY, 'reliable')
        for stamp in every_period(0, 10):
            cdr = PoseArrayCodec('world', 4).encode(np.ones((4, 7)), stamp)
            bag.write('/tracked_poses', cdr, stamp)
            cdr = PoseArrayCodec('world', 3).encode(flight(stamp), stamp)
            bag.write('/predicted_poses', cdr, stamp)
    with pytest.raises(ValueError, match='no .*/scene topic .* --scene'):
        evaluate_bag(tmp_path / 'four')
    with pytest.raises(
        ValueError, match=r'3 spheres in frame .world.*refused: 10 for their count'
    ):
        evaluate_bag(tmp_path / 'four', scene='box_154')
    with pytest.raises(ValueError, match='no topic /nowhere of type'):
        evaluate_bag(counts, tracked='/nowhere')


def test_a_bag_of_another_recorder_needs_only_topics_and_a_scene(tmp_path):
    bag = write_bag(
        tmp_path / 'bag', every_period(1, 10), every_period(0, 20), scene=False, namespace=''
    )
    (bag / 'metadata.yaml').unlink()
    report = evaluate_bag(
        bag / 'bag_0.mcap', scene='box_154', tracked='/tracked_poses', predicted='/predicted_poses'
    )
    assert report['errors']['position_error'] == pytest.approx(0.05, abs=1e-12)
    assert report['recording']['model'] == 'unknown'


def test_command_line_prints_and_writes_beside_the_bag(tmp_path, capsys):
    bag = write_bag(tmp_path / 'bag', every_period(1, 10), every_period(0, 20))
    assert evaluate([str(bag), '--no-figure']) == 0
    printed = capsys.readouterr().out
    report = read_json(tmp_path / 'bag_evaluation.json')
    assert format_report(report) in printed
    assert 'Lateness p50' in printed
    assert f'numbers: {tmp_path / "bag_evaluation.json"}' in printed
    assert sorted(file.name for file in bag.iterdir()) == ['bag_0.mcap', 'metadata.yaml']
    assert evaluate([str(tmp_path / 'nowhere')]) == 2
    assert 'no such bag' in capsys.readouterr().err


def test_figure_is_drawn(tmp_path):
    pytest.importorskip('matplotlib', reason='matplotlib is not installed')
    bag = write_bag(tmp_path / 'bag', every_period(1, 6), every_period(0, 10))
    numbers, figure = tmp_path / 'a.json', tmp_path / 'a.png'
    assert evaluate([str(bag), '--json', str(numbers), '--figure', str(figure)]) == 0
    assert numbers.is_file()
    assert figure.read_bytes().startswith(b'\x89PNG')


def test_evaluation_needs_no_ros(tmp_path):
    bag = write_bag(tmp_path / 'bag', every_period(1, 10), every_period(0, 20))
    code = (
        'import sys\n'
        'for name in ("rclpy", "geometry_msgs", "std_msgs", "torch", "pybullet", "matplotlib"):\n'
        '    sys.modules[name] = None\n'
        'from rigid_gns_core.commands.cli import evaluate\n'
        f'sys.exit(evaluate([{str(bag)!r}]))\n'
    )
    done = subprocess.run(
        [sys.executable, '-c', code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert 'not drawn, as matplotlib is not installed' in done.stdout


# --- passes, gaps ---


def test_two_passes_of_simulated_time_are_not_mixed(tmp_path):
    """A world that was reset: stamps and log times go back; the second pass is the longer one."""
    folder, codec = tmp_path / 'bag', PoseArrayCodec('world', 3)
    with BagWriter(folder) as bag:
        for topic in ('/tracked_poses', '/predicted_poses'):
            bag.add_topic(topic, POSE_ARRAY, 'reliable')
        for first, last, off in ((0, 25, 0.0), (0, 40, 7.0)):  # the second 7 m beside the first
            for k in range(first, last):
                stamp, poses = START + k * PERIOD, flight(START + k * PERIOD)
                poses[:, 1] += off
                bag.write('/tracked_poses', codec.encode(poses, stamp), stamp)
                bag.write('/predicted_poses', codec.encode(poses, stamp), stamp)
    scene = tmp_path / 'scene.yaml'
    scene.write_text('scene: {radius: 1.0}\n')
    report = evaluate_bag(folder, scene=scene)
    assert (report['frames']['compared'], report['frames']['restarts']) == (40, 1)
    assert report['frames']['tracked_refused'] == 25
    assert report['errors']['position_error'] == pytest.approx(0.0, abs=1e-12)


def test_a_gap_of_the_tracker_is_not_interpolated(tmp_path):
    tracked = every_period(0, 10) + every_period(30, 50)
    report = evaluate_bag(write_bag(tmp_path / 'bag', every_period(1, 45), tracked))
    frames = report['frames']
    # 30 to 44 are compared; 1 to 9 lie before the gap, 10 to 29 in it
    assert (frames['compared'], frames['untracked'], frames['interpolated']) == (15, 29, 0)
    assert report['errors']['position_error'] == pytest.approx(0.05, abs=1e-12)
    assert any('29 predictions are left out' in note for note in report['notes'])
