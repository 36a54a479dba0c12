# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rotations are unknown that are NaN or zero, also in some frames only, or that never change."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rigid_gns_core import load_scene, load_simulator, Scene
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.data.tracks import known_rotations, load_tracks
from rigid_gns_core.errors import UserError
from rigid_gns_core.messages.poses import decode_pose_array, PoseArrayCodec
from rigid_gns_core.recordings.importing.import_bags import import_bags
from rigid_gns_core.recordings.importing.options import ImportOptions
from rigid_gns_core.recordings.scoring.evaluate import score_bag
from rigid_gns_core.scenes.state import Array, Trajectory
from rigid_gns_core.tracking import estimate_state
from tracking_windows import tracking_window

SPEED = 0.8  # [m/s]
CONSTANT = np.array([0.0, 0.6, 0.0, 0.8])  # any, but always the same
FRAMES = 12


@pytest.fixture(scope='module')
def scene() -> Scene:
    return load_scene('billiards')


@pytest.fixture(scope='module')
def rolling(scene: Scene) -> Trajectory:
    """A ball that rolls without sliding, by the laws."""
    radius = float(np.max(scene.radius))
    spin = [0.0, SPEED / radius, 0.0]
    place = [-1.0, 0.1, radius]
    return load_simulator().rollout(scene, [place], [[SPEED, 0.0, 0.0]], [spin], steps=80)


def check(scene: Scene, rolling: Trajectory, state: Any) -> None:
    """Compare a state at frame `FRAMES - 1`, and where the ball is half a second later."""
    now = FRAMES - 1
    np.testing.assert_allclose(
        state.angular_velocities[0], rolling.angular_velocities[now, 0], atol=0.01 * SPEED / 0.028
    )
    steps = round(0.5 / rolling.dt)
    forecast = load_simulator().rollout(
        scene, state.positions, state.velocities, state.angular_velocities, steps=steps
    )
    off = np.linalg.norm(forecast.positions[-1, 0] - rolling.positions[now + steps, 0])
    # without spin it slides first, and is off by 2/7 of its way, 0.1 m
    assert off < 2e-3


@pytest.mark.parametrize('sent', ['none', 'one', 'NaN'])
def test_a_ball_that_rolls_has_the_spin_of_rolling(
    sent: str, scene: Scene, rolling: Trajectory
) -> None:
    turns = {
        'none': None,
        'one': np.tile(CONSTANT, (FRAMES, 1, 1)),
        'NaN': np.full((FRAMES, 1, 4), np.nan),
    }[sent]
    estimate = estimate_state(
        scene, rolling.times[:FRAMES], rolling.positions[:FRAMES], turns, noise=1e-4
    )
    check(scene, rolling, estimate.state)


def sent_as(turns: Array, frame: int, sent: str) -> Array:
    """Rotations of a frame, shape (n, 4), as a tracker sends them that does not know all."""
    found = np.array(turns)
    unknown = {'NaN': np.nan, 'zero': 0.0, 'inf': np.inf}
    if sent in unknown:
        found[:] = unknown[sent]
    elif sent == 'one':
        found[:] = CONSTANT
    elif frame in (4, 10):  # 'some'
        found[0] = np.nan
    return found


@pytest.mark.parametrize('sent', ['one', 'NaN', 'zero', 'inf', 'some'])
@pytest.mark.parametrize('matched', [False, True])
def test_the_node_takes_it_so(matched: bool, sent: str, scene: Scene, rolling: Trajectory) -> None:
    window = tracking_window(
        max_spheres=4,
        gravity=scene.gravity,
        radius=float(np.max(scene.radius)),
        scene=scene,
        matched=matched,
        noise=1e-4,
    )
    for frame, time in enumerate(rolling.times[:FRAMES]):
        stamp = 10**9 + round(time * 1e9)
        turns = sent_as(rolling.quaternions[frame], frame, sent)
        poses = np.concatenate([rolling.positions[frame], turns], axis=1)
        window.add(decode_pose_array(PoseArrayCodec('world', 1).encode(poses, stamp)), stamp)
    assert window.counts['lost spheres'] == 0
    state = window.start()[1]
    check(scene, rolling, state)
    np.testing.assert_allclose(np.linalg.norm(state.quaternions, axis=1), 1.0, atol=1e-12)


def test_a_measured_rotation_is_believed(scene: Scene, rolling: Trajectory) -> None:
    """A ball that slides and turns slowly has the spin that was seen."""
    slow = np.zeros((FRAMES, 1, 4))
    angle = 0.5 * rolling.times[:FRAMES]  # 1 rad/s about z
    slow[:, 0, 2], slow[:, 0, 3] = np.sin(angle), np.cos(angle)
    estimate = estimate_state(
        scene, rolling.times[:FRAMES], rolling.positions[:FRAMES], slow, noise=1e-4
    )
    np.testing.assert_allclose(estimate.state.angular_velocities[0], [0, 0, 1], atol=1e-6)


def test_of_two_spheres_each_counts_for_itself() -> None:
    turns = np.tile(CONSTANT, (5, 2, 1))
    turns[:, 1] = [[0.0, 0.0, np.sin(a), np.cos(a)] for a in 0.1 * np.arange(5)]
    found = known_rotations(turns)
    assert found is not None
    assert np.isnan(found[:, 0]).all()
    np.testing.assert_array_equal(found[:, 1], turns[:, 1])
    assert known_rotations(turns[:, :1]) is None


@pytest.mark.parametrize('match', [False, True])
@pytest.mark.parametrize('sent', ['one', 'NaN', 'zero', 'some'])
def test_import_and_evaluation_say_that_they_are_unknown(
    tmp_path: Path, rolling: Trajectory, sent: str, match: bool
) -> None:
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add_topic('/tracked_poses', 'geometry_msgs/msg/PoseArray', 'reliable')
        for frame, time in enumerate(rolling.times):
            stamp = 10**18 + round(time * 1e9)
            turns = sent_as(rolling.quaternions[frame], frame, sent)
            poses = np.concatenate([rolling.positions[frame], turns], axis=1)
            cdr = PoseArrayCodec('world', 1).encode(poses, stamp)
            bag.write('/tracked_poses', cdr, stamp)
    options = ImportOptions(scene='billiards', match=match)
    (report,) = import_bags([tmp_path / 'bag'], tmp_path / 'data', options)
    (track,) = load_tracks(tmp_path / 'data')
    assert track.quaternions is None
    assert report['filled'] == 0 and not report['refused'].get('not finite', 0)
    if match:
        return
    scored = score_bag(
        read_bag(tmp_path / 'bag'), scene='billiards', tracked='/tracked_poses', model='laws'
    )
    report = scored.report
    assert report['errors']['spin_error'] is report['errors']['rotation_error'] is None
    assert report['laws']['reference']['rotational_energy'] is None
    assert any('Rotations are not tracked' in note for note in report['notes'])
    assert report['errors']['position_error'] < 2e-3  # with the spin of rolling, as above


@pytest.mark.parametrize('cell', ['', 'nan', '0', 'x'])
def test_a_table_may_leave_a_rotation_out(tmp_path: Path, rolling: Trajectory, cell: str) -> None:
    path = tmp_path / 'balls.csv'
    lines = ['track,sphere,time,x,y,z,qx,qy,qz,qw']
    for frame, time in enumerate(rolling.times):
        place = ','.join(map(repr, rolling.positions[frame, 0].tolist()))
        turn = ','.join(map(repr, rolling.quaternions[frame, 0].tolist()))
        lines.append(f'0,0,{time:.9f},{place},{",".join([cell] * 4) if frame == 9 else turn}')
    path.write_text('\n'.join(lines))
    options = ImportOptions(scene='billiards')
    if cell == 'x':
        with pytest.raises(UserError, match='line 11.*qx is'):
            import_bags([path], tmp_path / 'data', options)
        return
    import_bags([path], tmp_path / 'data', options)
    (track,) = load_tracks(tmp_path / 'data')
    assert track.quaternions is not None and track.seen.all()
    assert np.flatnonzero(np.isnan(track.quaternions[:, 0, 0])).tolist() == [9]
    end = FRAMES + 1
    estimate = estimate_state(
        load_scene('billiards'), track.times[:end], track.positions[:end],
        track.quaternions[:end], noise=1e-4,
    )  # fmt: skip
    spin = estimate.state.angular_velocities[0]
    np.testing.assert_allclose(spin, rolling.angular_velocities[end - 1, 0], atol=0.3)
