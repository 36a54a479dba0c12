# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Import of spheres whose order in the message changes, and of bags without a scene."""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path

import numpy as np
import pytest
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.commands.cli import main
from rigid_gns_core.commands.import_bags import format_report
from rigid_gns_core.data.records import Dataset
from rigid_gns_core.messages.poses import encode_string, PoseArrayCodec
from rigid_gns_core.prediction.load import load_simulator
from rigid_gns_core.recordings.importing.import_bags import import_bags
from rigid_gns_core.recordings.importing.options import ImportOptions
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.state import rotation_between, Trajectory

START = 1_700_000_000_123_456_789
POSE_ARRAY, STRING = 'geometry_msgs/msg/PoseArray', 'std_msgs/msg/String'
SCENE = Scene(surfaces=Plane.box(60.0, 60.0))
PLACES = np.array([[-6.0, 0.0, 12.0], [0.0, 0.0, 20.0], [6.0, 0.0, 30.0], [9.0, 5.0, 25.0]])
# table tennis: a ball of 20 mm at 10 m/s goes 7 radii in a step of 14 ms
FAST = Scene(radius=0.02, surfaces=Plane.box(0.6, 0.6), restitution=0.97, friction=0.0)
# of frame number and poses, shape (n, 7), what the tracker says
Seen = Callable[[int, np.ndarray], np.ndarray]


@pytest.fixture(scope='module')
def slow() -> Trajectory:
    """8 s of four spheres that fall, spin and bounce, up to 2 radii a step."""
    spins = np.tile([0.3, -1.0, 0.5], (4, 1))
    return load_simulator().rollout(SCENE, PLACES, None, spins, steps=80)


@pytest.fixture(scope='module')
def fast() -> Trajectory:
    """120 steps of 27 balls at 10 m/s in a box of 30 radii: they strike what they can."""
    rng = np.random.default_rng(0)
    sites = np.array([[i, j, k] for i in range(3) for j in range(3) for k in range(3)], float)
    ways = rng.normal(size=(27, 3))
    ways *= 10.0 / np.linalg.norm(ways, axis=1, keepdims=True)
    places = 0.1 * sites + [-0.1, -0.1, 0.05]
    return load_simulator().rollout(FAST, places, ways, steps=120)


def write_bag(
    folder: Path,
    truth: Trajectory,
    scene: Scene | str | None,
    seen: Seen = lambda _, poses: poses,
    *,
    matching: bool = False,
) -> Path:
    """Record a tracker, and what a simulator (or, of a text, somebody else) said on .../scene."""
    with BagWriter(folder) as bag:
        bag.add_topic('/tracked_poses', POSE_ARRAY, 'sensor_data')
        text = json.dumps('')
        if isinstance(scene, Scene):
            parameters = {'match_spheres': matching, 'velocity_window': 5}
            said = {'scene': scene.to_mapping(), 'parameters': parameters}
            text = json.dumps(said | {'topics': {'tracked': '/tracked_poses'}})
        if scene is not None:
            name = '/simulator/scene' if isinstance(scene, Scene) else '/world/scene'
            bag.add_topic(name, STRING, 'latched')
            bag.write(name, encode_string(scene if isinstance(scene, str) else text), START)
        for number in range(len(truth)):
            poses = np.concatenate([truth.positions[number], truth.quaternions[number]], axis=1)
            found = seen(number, poses)
            stamp = START + round(number * truth.dt * 1e9)
            cdr = PoseArrayCodec('lab', len(found)).encode(found, stamp)
            bag.write('/tracked_poses', cdr, stamp)
    return folder


def any_order(number: int, poses: np.ndarray) -> np.ndarray:
    return np.random.default_rng(number).permutation(poses)


def one_missing(number: int, poses: np.ndarray) -> np.ndarray:
    """One sphere is not seen in every fifth frame, once all are known."""
    return any_order(number, poses)[: -1 if 10 < number < 80 and number % 5 == 0 else None]


def swapped(frames: range) -> Seen:
    def seen(number: int, poses: np.ndarray) -> np.ndarray:
        return poses[[1, 0, *range(2, len(poses))]] if number in frames else poses

    return seen


def scene_file(tmp_path: Path, scene: Scene = SCENE) -> Path:
    path = tmp_path / 'scene.yaml'
    path.write_text(json.dumps({'scene': scene.to_mapping()}))
    return path


def test_spheres_are_matched_where_the_simulator_matched_them(
    tmp_path: Path, slow: Trajectory
) -> None:
    bag = write_bag(tmp_path / 'bag', slow, SCENE, one_missing, matching=True)
    (report,) = import_bags([bag], tmp_path / 'data')
    (record,) = Dataset(tmp_path / 'data')
    got, since = record.trajectory, len(slow) - len(record.trajectory)
    assert since <= 6, 'frames before all were found'
    assert report['refused'] == {'unseen': since}
    apart = np.linalg.norm(got.positions[0][:, None] - slow.positions[since][None], axis=-1)
    who = apart.argmin(axis=1)
    assert sorted(who) == [0, 1, 2, 3]
    off = np.linalg.norm(got.positions - slow.positions[since:, who], axis=-1)
    assert report['filled'] == 13
    # a chord of a flight of 0.2 s is 49 mm too low in its middle
    assert np.sort(off.ravel())[-report['filled'] // 2] < 1e-3
    assert off.max() < 1.0
    turned = rotation_between(got.quaternions, slow.quaternions[since:, who])
    assert np.median(np.abs(turned)) < 1e-6
    text = format_report(report)
    assert 'spheres: matched from frame to frame, as by the simulator' in text
    assert '13 poses put in where one was not seen' in text


def test_match_is_for_bags_without_a_recorded_simulator(
    tmp_path: Path, slow: Trajectory, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = write_bag(tmp_path / 'bag', slow, None, any_order)
    words = ['import', str(bag), '--scene', str(scene_file(tmp_path)), '--out']
    assert main([*words, str(tmp_path / 'refused')]) == 2
    told = capsys.readouterr().err
    assert 'spheres change places in the message' in told
    assert '--match finds out who is who' in told
    assert main([*words, str(tmp_path / 'data'), '--match']) == 0
    assert 'matched from frame to frame, as --match asks' in capsys.readouterr().out
    (record,) = Dataset(tmp_path / 'data')
    steps = np.linalg.norm(np.diff(record.trajectory.positions, axis=0), axis=-1)
    truth = np.linalg.norm(np.diff(slow.positions, axis=0), axis=-1)
    assert steps.max() == pytest.approx(truth.max(), rel=1e-5)


def test_another_set_of_spheres_starts_another_record(tmp_path: Path, slow: Trajectory) -> None:
    def gone(number: int, poses: np.ndarray) -> np.ndarray:
        return any_order(number, poses if number < 40 else poses[1:])

    bag = write_bag(tmp_path / 'bag', slow, SCENE, gone, matching=True)
    (report,) = import_bags([bag], tmp_path / 'data')
    assert report['cuts'] == {'set': 1}
    assert [record.trajectory.count for record in Dataset(tmp_path / 'data')] == [4, 3]


def test_spheres_that_are_lost_now_and_then_name_the_option(
    tmp_path: Path, slow: Trajectory
) -> None:
    bag = write_bag(tmp_path / 'bag', slow, SCENE, lambda k, poses: poses[: 3 + k % 2])
    with pytest.raises(
        ValueError, match='no stretch .*; --match follows spheres that are missing'
    ):
        import_bags([bag], tmp_path / 'data')


def test_each_sphere_keeps_its_own_properties(tmp_path: Path, slow: Trajectory) -> None:
    """The last is lost for good: the others stay those of the scene's first three."""
    own = Scene(surfaces=SCENE.surfaces, mass=(1.0, 2.0, 3.0, 4.0))
    bag = write_bag(
        tmp_path / 'bag', slow, own, lambda k, p: p if k < 40 else p[:3], matching=True
    )
    import_bags([bag], tmp_path / 'data')
    whole, rest = (record.scene.mass for record in Dataset(tmp_path / 'data'))
    assert whole == (1.0, 2.0, 3.0, 4.0)
    assert len(rest) == 3
    assert set(rest) < set(whole)

    def replaced(number: int, poses: np.ndarray) -> np.ndarray:
        return poses if number < 40 else poses + [200.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]

    bag = write_bag(tmp_path / 'others', slow, own, replaced, matching=True)
    with pytest.raises(ValueError, match=r'others: .* has no properties: .* give one number'):
        import_bags([bag], tmp_path / 'none')


@pytest.mark.parametrize(
    ('truth', 'scene', 'seen'),
    [
        ('slow', SCENE, any_order),
        ('fast', FAST, any_order),
        ('slow', SCENE, lambda k, poses: swapped(range(10, 80, 2))(k, poses)),
        ('fast', FAST, lambda k, poses: swapped(range(10, 120, 2))(k, poses)),
    ],
)
def test_poses_in_any_order_are_refused(
    tmp_path: Path, request: pytest.FixtureRequest, truth: str, scene: Scene, seen: Seen
) -> None:
    bag = write_bag(tmp_path / 'bag', request.getfixturevalue(truth), scene, seen)
    with pytest.raises(ValueError, match=r'bag: /tracked_poses: spheres change .*--match'):
        import_bags([bag], tmp_path / 'data')
    assert not (tmp_path / 'data').exists()


@pytest.mark.parametrize(('truth', 'scene', 'frame'), [('slow', SCENE, 50), ('fast', FAST, 5)])
def test_a_single_exchange_is_a_warning(
    tmp_path: Path, request: pytest.FixtureRequest, truth: str, scene: Scene, frame: int
) -> None:
    trajectory = request.getfixturevalue(truth)
    bag = write_bag(tmp_path / 'bag', trajectory, scene, swapped(range(frame, 1000)))
    (report,) = import_bags([bag], tmp_path / 'data')
    (warning,) = report['warnings']
    stamp = START + round(frame * trajectory.dt * 1e9)
    assert 'spheres seem to change places in the message, in 1 frames' in warning
    assert f'of stamp {stamp // 10**9}.{stamp % 10**9:09d} s; --match' in warning
    assert warning in format_report(report)


@pytest.mark.parametrize('every', [1, 2])
def test_fast_balls_that_strike_each_other_are_motion(
    tmp_path: Path, fast: Trajectory, every: int
) -> None:
    """Steps are up to 9 radii long, or 17; a contact breaks every fifth, or every second."""
    steps = np.linalg.norm(np.diff(fast.positions[::every], axis=0), axis=-1)
    assert np.quantile(steps, 0.9) > 5.0 * every * FAST.radius
    thinned = Trajectory.from_poses(
        fast.positions[::every], fast.quaternions[::every], every * fast.dt
    )
    bag = write_bag(tmp_path / 'bag', thinned, FAST)
    (report,) = import_bags([bag], tmp_path / 'data')
    assert not any('change places' in warning for warning in report['warnings'])
    if every == 1:
        assert report['warnings'] == []


def test_a_carousel_of_spheres_is_motion(tmp_path: Path) -> None:
    """Each goes on to the place of the one before it: with others, no sphere would move."""
    turn = 2.0 * np.pi / 12
    angles = turn * (np.arange(60)[:, None] + np.arange(12))
    places = np.stack([4.5 * np.cos(angles), 4.5 * np.sin(angles), 1.0 + 0.0 * angles], axis=-1)
    turned = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (60, 12, 4))
    bag = write_bag(tmp_path / 'bag', Trajectory.from_poses(places, turned, 0.1), SCENE)
    (report,) = import_bags([bag], tmp_path / 'data')
    assert not any('change places' in warning for warning in report['warnings'])


def test_noise_instead_of_motion_is_a_warning(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    places = rng.uniform(1.0, 500.0, (60, 3, 3))
    turned = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (60, 3, 4))
    bag = write_bag(tmp_path / 'bag', Trajectory.from_poses(places, turned, 0.1), Scene())
    (report,) = import_bags([bag], tmp_path / 'data')
    assert '% of the steps of spheres do not go on' in report['warnings'][-1]


@pytest.mark.parametrize('text', ['kitchen', '"kitchen"', '{"scene": "kitchen"}', '[1]'])
def test_a_scene_topic_of_another_node(tmp_path: Path, slow: Trajectory, text: str) -> None:
    foreign = write_bag(tmp_path / 'foreign', slow, text)
    with pytest.raises(ValueError, match=r'foreign: /world/scene holds no scene .*with --scene'):
        import_bags([foreign], tmp_path / 'none')
    options = ImportOptions(scene=scene_file(tmp_path))
    (report,) = import_bags([foreign], tmp_path / 'data', options)
    assert report['records'] == [[4, 80]]
