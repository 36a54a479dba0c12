# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags of tracked poses as data: resampling, gaps, noise, other counts, and bad input."""

from __future__ import annotations

from collections.abc import Callable, Iterable
import json
import os
from pathlib import Path

import numpy as np
import pytest
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.commands.cli import main
from rigid_gns_core.data.common_scene import common_scene
from rigid_gns_core.data.records import Dataset
from rigid_gns_core.data.tracks import load_tracks
from rigid_gns_core.forecasts.interpolation import interpolate
from rigid_gns_core.messages.poses import encode_string, PoseArrayCodec
from rigid_gns_core.recordings.importing.import_bags import import_bags
from rigid_gns_core.recordings.importing.options import ImportOptions
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.state import rotate_quaternions, rotation_between
import yaml

START = 1_700_000_000_123_456_789
GRAVITY = 9.81
SCENE = Scene(restitution=0.9, rolling_friction=0.0)
PAIR = 0.81  # of two materials of 0.9
DROPS = np.array([1.5, 4.0, 9.0])  # of the lowest points above the ground [m]
SPIN = np.array([0.3, -1.0, 2.0])  # [rad/s]
POSE_ARRAY = 'geometry_msgs/msg/PoseArray'


def height(time: float, drop: float) -> float:
    """Of a ball that bounces for ever, above the ground."""
    fall = np.sqrt(2.0 * drop / GRAVITY)
    if time <= fall:
        return drop - 0.5 * GRAVITY * time**2
    time, speed = time - fall, PAIR * GRAVITY * fall
    while time > 2.0 * speed / GRAVITY:
        time, speed = time - 2.0 * speed / GRAVITY, PAIR * speed
        if speed < 1e-3:
            return 0.0  # bounces without end, in a time that ends
    return speed * time - 0.5 * GRAVITY * time**2


def bouncing(time: float, drops: np.ndarray = DROPS) -> np.ndarray:
    """Poses of balls that bounce side by side, shape (n, 7)."""
    places = np.array(
        [[5.0 * i + time, 2.0 * time, 1.0 + height(time, d)] for i, d in enumerate(drops)]
    )
    turns = rotate_quaternions(np.tile([0.0, 0.0, 0.0, 1.0], (len(drops), 1)), SPIN * time)
    return np.concatenate([places, turns], axis=1)


def write_bag(
    folder: Path,
    times: Iterable[float],
    poses: Callable[[float], np.ndarray] = bouncing,
    *,
    scene: Scene | None = SCENE,
    topic: str = '/lab/tracked_poses',
) -> Path:
    with BagWriter(folder) as bag:
        bag.add_topic(topic, POSE_ARRAY, 'sensor_data')
        if scene is not None:
            bag.add_topic('/lab/simulator/scene', 'std_msgs/msg/String', 'latched')
            said = {'scene': scene.to_mapping(), 'topics': {'tracked': topic}}
            bag.write('/lab/simulator/scene', encode_string(json.dumps(said)), START)
        for time in times:
            frame, stamp = poses(time), START + round(time * 1e9)
            bag.write(topic, PoseArrayCodec('world', len(frame)).encode(frame, stamp), stamp)
    return folder


def every(interval: float, end: float = 3.0) -> np.ndarray:
    return np.arange(round(end / interval) + 1) * interval


def noisy(std: float) -> Callable[[float], np.ndarray]:
    rng = np.random.default_rng(0)

    def poses(time: float) -> np.ndarray:
        found = bouncing(time)
        found[:, :3] += rng.normal(0.0, std, (3, 3))
        found[:, 3:] = rotate_quaternions(found[:, 3:], rng.normal(0.0, std, (3, 3)))
        return found

    return poses


def test_a_bag_becomes_a_data_set_to_train_on(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'bag', every(0.1))
    (report,) = import_bags([bag], tmp_path / 'data')
    assert report['poses'] == {
        'tracked': 93,
        'flight': 0,
        'carried': 0,
        'bounce': 0,
        'straight': 0,
    }
    (record,) = Dataset(tmp_path / 'data')
    trajectory = record.trajectory
    assert (trajectory.steps, trajectory.count, trajectory.dt) == (30, 3, 0.1)
    truth = np.stack([bouncing(time) for time in trajectory.times])
    # kept as float32, of places up to 16 m
    np.testing.assert_allclose(trajectory.positions, truth[..., :3], atol=2e-6)
    assert np.abs(rotation_between(trajectory.quaternions, truth[..., 3:])).max() < 1e-6
    # velocities by differences (thesis section 3.3)
    np.testing.assert_allclose(
        trajectory.velocities[1:], np.diff(trajectory.positions, axis=0) / 0.1, atol=1e-12
    )
    assert record.scene == SCENE
    # and what the tracker gave, beside it
    (track,) = load_tracks(tmp_path / 'data')
    np.testing.assert_allclose(track.times, 0.1 * np.arange(31), atol=1e-9)
    np.testing.assert_array_equal(track.positions, truth[..., :3])
    assert track.quaternions is not None and track.begin == pytest.approx(START * 1e-9)
    assert common_scene([record])[1]['restitution'] == 0.9
    recipe = yaml.safe_load((tmp_path / 'data' / 'recipe.yaml').read_text())
    assert recipe['teacher']['source'] == 'tracked poses'
    assert [one['bag'] for one in recipe['teacher']['bags']] == ['bag']


@pytest.mark.parametrize('interval', [0.013, 0.03, 0.07])
def test_another_rate_is_resampled_and_bounces_are_met_from_both_sides(
    tmp_path: Path, interval: float
) -> None:
    def poses(time: float) -> np.ndarray:
        return bouncing(time, np.linspace(1.2, 9.0, 30))

    times = every(interval, 2.0)
    (report,) = import_bags([write_bag(tmp_path / 'bag', times, poses)], tmp_path / 'data')
    (record,) = Dataset(tmp_path / 'data')
    got = record.trajectory
    truth = np.stack([poses(time) for time in got.times])
    stamps, wanted = (np.round(1e9 * values).astype(np.int64) for values in (times, got.times))
    frames = np.stack([poses(time) for time in times])
    straight = interpolate(stamps, frames, np.minimum(wanted, stamps[-1]))
    ours = np.linalg.norm(got.positions - truth[..., :3], axis=-1)
    chords = np.linalg.norm(straight[..., :3] - truth[..., :3], axis=-1)
    assert report['poses']['bounce'] > 0
    assert report['poses']['straight'] <= 3, 'at the end alone, where nothing comes after a bounce'
    ours, chords = ours[:-1], chords[:-1]
    # flights are parabolas: only float32 and stamps of whole nanoseconds are left
    assert np.median(ours) < 1e-5
    # a contact is found to a part of 33 of a step, in which speeds of 24 m/s turn round
    assert ours.max() < 24.0 * interval / 33 + 1e-3
    assert chords.max() > 3.0 * ours.max(), 'what a straight line would have done'


def test_a_straight_line_through_two_contacts_is_counted(tmp_path: Path) -> None:
    def ping_pong(time: float) -> np.ndarray:
        found = bouncing(time)
        found[0, 0] = abs((11.0 * time + 0.4) % 2.0 - 1.0)  # turns round every 91 ms
        return found

    bag = write_bag(tmp_path / 'bag', every(0.07), ping_pong)
    (report,) = import_bags([bag], tmp_path / 'data')
    assert report['poses']['straight'] > 0


def test_gaps_cut_and_single_frames_are_bridged(tmp_path: Path) -> None:
    times = [t for t in every(0.1, 6.0) if not 2.05 < t < 2.95 and abs(t - 4.0) > 0.01]
    (report,) = import_bags([write_bag(tmp_path / 'bag', times)], tmp_path / 'data')
    assert report['cuts'] == {'gap': 1}
    first, second = Dataset(tmp_path / 'data')
    assert (first.trajectory.steps, second.trajectory.steps) == (20, 30)
    truth = np.stack([bouncing(3.0 + time) for time in second.trajectory.times])
    off = np.abs(second.trajectory.positions - truth[..., :3])
    assert off[[k for k in range(31) if k != 10]].max() < 2e-6
    assert sum(report['poses'][kind] for kind in ('flight', 'bounce', 'straight')) == 3
    (report,) = import_bags([tmp_path / 'bag'], tmp_path / 'other', ImportOptions(max_gap=0.15))
    # the second stretch falls into one of 9 steps, too short, and one of 19
    assert (report['cuts'], report['too_short']) == ({'gap': 2}, 1)
    assert [record.trajectory.steps for record in Dataset(tmp_path / 'other')] == [20, 19]


def test_another_number_of_spheres_starts_another_record(tmp_path: Path) -> None:
    def two_then_three(time: float) -> np.ndarray:
        return bouncing(time)[: 2 if time < 1.45 else 3]

    bag = write_bag(tmp_path / 'bag', every(0.1), two_then_three)
    (report,) = import_bags([bag], tmp_path / 'data')
    assert report['cuts'] == {'count': 1}
    assert [record.trajectory.count for record in Dataset(tmp_path / 'data')] == [2, 3]
    each = write_bag(
        tmp_path / 'each', every(0.1), two_then_three, scene=Scene(radius=(1.0, 1.0, 1.0))
    )
    with pytest.raises(ValueError, match=r'each: .*with 2 spheres, but the scene has .* of 3'):
        import_bags([each], tmp_path / 'none')
    assert not (tmp_path / 'none').exists()


@pytest.mark.parametrize('std', [1e-4, 1e-3, 1e-2])
def test_noise_is_estimated(tmp_path: Path, std: float) -> None:
    bag = write_bag(tmp_path / 'bag', every(0.04, 6.0), noisy(std))
    (report,) = import_bags([bag], tmp_path / 'data')
    # 150 frames of 9 coordinates: 3 % by chance; up to 25 % more by bounces taken for noise
    assert 0.9 * std < report['noise_m'] < 1.3 * std
    assert 0.9 * std < report['noise_rad'] < 1.3 * std
    (record,) = Dataset(tmp_path / 'data')
    truth = np.stack([bouncing(time) for time in record.trajectory.times])
    off = np.linalg.norm(record.trajectory.positions - truth[..., :3], axis=-1)
    assert np.median(off) < 3.0 * std  # of a distance, 1.5 standard deviations of a coordinate
    assert off.max() < 6.0 * std + 0.05  # a bounce is met less well in noise: 24 m/s over 1 ms


def test_a_tracker_without_rotations_is_seen(tmp_path: Path) -> None:
    def unturned(time: float) -> np.ndarray:
        found = bouncing(time)
        found[:, 3:] = [0.0, 0.0, 0.0, 1.0]
        return found

    (report,) = import_bags([write_bag(tmp_path / 'bag', every(0.1), unturned)], tmp_path / 'data')
    assert report['noise_rad'] is None


def test_frames_that_are_no_measurement_are_left_out(tmp_path: Path) -> None:
    def broken(time: float) -> np.ndarray:
        found = bouncing(time)
        if abs(time - 0.5) < 0.01:
            found[1, 0] = np.nan
        if abs(time - 1.5) < 0.01:
            found[2, 3:] = 1e9
        return found

    times = [
        *every(0.1, 2.0),
        1.95,
        *every(0.1, 4.0)[21:],
    ]  # and one that comes late, but has a place
    (report,) = import_bags([write_bag(tmp_path / 'bag', times, broken)], tmp_path / 'data')
    # a lost sphere costs its own pose alone, which the frames around it give
    assert report['refused'] == {'quaternion': 1} and report['filled'] == 1
    (record,) = Dataset(tmp_path / 'data')
    assert record.trajectory.steps == 40


@pytest.mark.parametrize('lengths', [(6.0, np.inf), (np.inf, 6.0), (6.0, 6.0)])
def test_balls_below_a_strip_or_a_plate_are_in_no_surface(
    tmp_path: Path, lengths: tuple[float, float]
) -> None:
    shelf = Plane((0.0, 0.0, 500.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), *lengths)
    bag = write_bag(tmp_path / 'bag', every(0.1), scene=Scene(surfaces=(Plane(), shelf)))
    import_bags([bag], tmp_path / 'data')
    (record,) = Dataset(tmp_path / 'data')
    assert record.scene.surfaces[1] == shelf


@pytest.mark.parametrize(
    ('times', 'changes', 'options', 'message'),
    [
        (every(0.1), {'topic': '/lab/poses_of_balls'}, {}, r'no topic \.\.\./tracked_poses'),
        (every(0.1), {'scene': None}, {}, 'no .*/scene topic says what the scene is.*--scene'),
        (every(0.5), {}, {}, 'are 0.5 s apart, expected at most 2 time steps of 0.1 s'),
        (every(0.1, 0.5), {}, {}, 'no stretch .* is 10 steps .* longest has 0.5 s'),
        (every(0.1)[:1], {}, {}, 'holds 1 frames, no two of which follow'),
        ([], {}, {}, 'holds no messages'),
        (every(0.1), {}, {'topic': '/nowhere'}, 'no topic /nowhere .* --topic'),
        (
            every(0.1),
            {'poses': lambda t: bouncing(t) - 3.0 * np.eye(7)[2]},
            {},
            'm behind surface 0',
        ),
    ],
)
def test_bad_input_is_named_and_nothing_is_written(
    tmp_path: Path, times: Iterable[float], changes: dict, options: dict, message: str
) -> None:
    if changes.get('topic'):
        changes = {**changes, 'scene': None}
    good = write_bag(tmp_path / 'good', every(0.1))
    bad = write_bag(tmp_path / 'bad', times, **changes)
    with pytest.raises(ValueError, match=message) as caught:
        import_bags([good, bad], tmp_path / 'out', ImportOptions(**options))
    assert str(tmp_path) in str(caught.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ['bad', 'good']


def test_a_bag_is_not_counted_twice(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'bag', every(0.1))
    with pytest.raises(ValueError, match='bag: given twice'):
        import_bags([bag, bag / '..' / 'bag'], tmp_path / 'out')
    assert not (tmp_path / 'out').exists()


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        ({'radius': 0.0}, 'radius is 0.0, expected a positive'),
        ({'dt': float('nan')}, 'dt is nan'),
        ({'min_steps': 2}, 'min_steps is 2, expected at least 3'),
    ],
)
def test_options_are_checked(options: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ImportOptions(**options)


def test_small_spheres_get_the_time_step_of_their_size(tmp_path: Path) -> None:
    """Spheres of 40 mm: a fifth of the time, by dynamic similarity."""

    def small(time: float) -> np.ndarray:
        found = bouncing(5.0 * time)
        found[:, :3] *= 0.04
        return found

    bag = write_bag(tmp_path / 'bag', every(0.02, 0.6), small, scene=None)
    scene = tmp_path / 'scene.yaml'
    scene.write_text('scene: {restitution: 0.9}\n')
    import_bags([bag], tmp_path / 'data', ImportOptions(scene=scene, radius=0.04))
    (record,) = Dataset(tmp_path / 'data')
    assert record.trajectory.dt == pytest.approx(0.02)
    assert record.scene.radius == 0.04


def test_the_command_prints_what_was_found(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bags = [str(write_bag(tmp_path / name, every(0.1))) for name in ('one', 'two')]
    words = ['import', *bags, '--out', str(tmp_path / 'data')]
    assert main(words) == 0
    printed = capsys.readouterr().out
    assert 'one: 31 frames of /lab/tracked_poses every 100 ms' in printed
    assert '2 records in' in printed
    assert main(words) == 2
    assert 'exists; remove it or give another --out' in capsys.readouterr().err


def test_frames_that_arrive_in_turns_are_put_in_order(tmp_path: Path) -> None:
    """Each second one overtakes that before it, as by two ways through a network."""
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add_topic('/tracked_poses', POSE_ARRAY, 'sensor_data')
        for k in range(200):
            frame, stamp = bouncing(0.01 * k), START + 10_000_000 * k
            late = 15_000_000 if k % 2 else 0
            cdr = PoseArrayCodec('world', len(frame)).encode(frame, stamp)
            bag.write('/tracked_poses', cdr, stamp + late)
    (report,) = import_bags([tmp_path / 'bag'], tmp_path / 'data', ImportOptions(scene='box_154'))
    (track,) = load_tracks(tmp_path / 'data')
    assert report['interval_s'] == pytest.approx(0.01) and not report['refused']
    np.testing.assert_allclose(track.times, 0.01 * np.arange(200), atol=1e-9)
    expected = np.stack([bouncing(time) for time in track.times])
    np.testing.assert_allclose(track.positions, expected[..., :3], atol=1e-9)


def test_a_name_that_is_no_unicode_is_imported(tmp_path: Path) -> None:
    folder = tmp_path / os.fsdecode(b'b\xffg')
    import_bags([write_bag(folder, np.arange(0.0, 2.0, 0.01))], tmp_path / 'data')
    assert load_tracks(tmp_path / 'data')[0].name == 'b?g_0'


def test_a_link_to_itself_is_named(tmp_path: Path) -> None:
    (tmp_path / 'loop').symlink_to(tmp_path / 'loop')
    with pytest.raises(ValueError, match='loop: no such bag'):
        import_bags([tmp_path / 'loop'], tmp_path / 'data')
