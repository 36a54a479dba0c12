# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rotations that never change are unknown, whether a tracker sends one, NaN or none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rigid_gns_core import load_scene, load_simulator, Scene
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.data.tracks import known_rotations, load_tracks
from rigid_gns_core.messages.poses import PoseArrayCodec, PoseArrayFrame
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


@pytest.mark.parametrize('matched', [False, True])
def test_the_node_takes_it_so(matched: bool, scene: Scene, rolling: Trajectory) -> None:
    window = tracking_window(
        max_spheres=4,
        gravity=scene.gravity,
        radius=float(np.max(scene.radius)),
        scene=scene,
        matched=matched,
        noise=1e-4,
    )
    for time, places in zip(rolling.times[:FRAMES], rolling.positions[:FRAMES], strict=True):
        stamp = 10**9 + round(time * 1e9)
        poses = np.concatenate([places, CONSTANT[None]], axis=1)
        window.add(PoseArrayFrame(stamp, 'world', poses), stamp)
    check(scene, rolling, window.start()[1])


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


def test_import_and_evaluation_say_that_they_are_unknown(
    tmp_path: Path, scene: Scene, rolling: Trajectory
) -> None:
    def poses(places: Array) -> Array:
        return np.concatenate([places, CONSTANT[None]], axis=1)

    with BagWriter(tmp_path / 'bag') as bag:
        bag.add_topic('/tracked_poses', 'geometry_msgs/msg/PoseArray', 'reliable')
        for time, places in zip(rolling.times, rolling.positions, strict=True):
            stamp = 10**18 + round(time * 1e9)
            cdr = PoseArrayCodec('world', 1).encode(poses(places), stamp)
            bag.write('/tracked_poses', cdr, stamp)
    import_bags([tmp_path / 'bag'], tmp_path / 'data', ImportOptions(scene='billiards'))
    (track,) = load_tracks(tmp_path / 'data')
    assert track.quaternions is None
    scored = score_bag(
        read_bag(tmp_path / 'bag'), scene='billiards', tracked='/tracked_poses', model='laws'
    )
    report = scored.report
    assert report['errors']['spin_error'] is report['errors']['rotation_error'] is None
    assert report['laws']['reference']['rotational_energy'] is None
    assert any('Rotations are not tracked' in note for note in report['notes'])
    assert report['errors']['position_error'] < 2e-3  # with the spin of rolling, as above
