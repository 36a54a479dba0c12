# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A camera that is slower than its publisher, and a clock that is set back."""

from __future__ import annotations

import contextlib
from pathlib import Path
import tracemalloc

import numpy as np
import pytest
from rigid_gns_core import Plane, Scene
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.data.tracks import load_tracks
from rigid_gns_core.messages.poses import PoseArrayCodec, PoseArrayFrame
from rigid_gns_core.recordings.importing.import_bags import import_bags
from rigid_gns_core.recordings.importing.options import ImportOptions
from rigid_gns_core.scenes.state import Array
from rigid_gns_core.tracking.repeats import Repeats
from rigid_gns_core.tracking.usable_frames import RejectedFrame, usable_passes
from rigid_gns_core.tracking.window import TrackingWindow
from tracking_windows import tracking_window

SCENE = Scene(surfaces=(Plane(),), radius=0.02, mass=0.003)
VELOCITIES = np.array([[1.0, 0.2, 3.0], [0.5, -1.0, 2.0]])
PLACES = np.array([[0.0, 0.1, 1.0], [1.0, 1.0, 1.5]])
CHANGES = ('appeared', 'vanished', 'missed')
START = 10**18  # [ns]


def flight(time: float) -> Array:
    """Poses of two balls in free flight, shape (2, 7)."""
    fall = 0.5 * np.array(SCENE.gravity) * time**2
    return np.concatenate([PLACES + VELOCITIES * time + fall, np.tile([0, 0, 0, 1.0], (2, 1))], 1)


def window(*, matched: bool) -> TrackingWindow:
    return tracking_window(gravity=SCENE.gravity, scene=SCENE, matched=matched, noise=1e-4)


def frames_of(rate: float, each: int, count: int) -> list[PoseArrayFrame]:
    """Frames at `rate` [Hz] in which every measurement is sent `each` times."""
    stamps = [START + round(k / rate * 1e9) for k in range(count)]
    shown = [stamps[k - k % each] for k in range(count)]
    return [
        PoseArrayFrame(stamp, 'world', flight((seen - START) * 1e-9))
        for stamp, seen in zip(stamps, shown, strict=True)
    ]


@pytest.mark.parametrize('matched', [False, True])
@pytest.mark.parametrize(('rate', 'each'), [(100.0, 2), (120.0, 3), (240.0, 8)])
def test_each_measurement_counts_once(rate: float, each: int, matched: bool) -> None:
    found = window(matched=matched)
    for k, frame in enumerate(frames_of(rate, each, 12 * each)):
        with contextlib.suppress(RejectedFrame):
            found.add(frame, frame.stamp_ns)
        if not found.full or k < each:  # the first alone shows no motion
            continue
        stamp, state = found.start()
        time = (stamp - START) * 1e-9
        assert found.count == 2
        # exact places, each at its own time: the fit is that of a parabola
        np.testing.assert_allclose(state.positions, flight(time)[:, :3], atol=1e-3)
        velocities = VELOCITIES + np.array(SCENE.gravity) * time
        np.testing.assert_allclose(state.velocities, velocities, atol=0.05)
    assert found.full
    # all, but for repeats of the first that may have left the memory
    repeated = 12 * (each - 1)
    assert repeated - max(each - 6, 0) <= found.counts['content'] <= repeated


def test_balls_at_rest_are_no_repeats() -> None:
    found = window(matched=False)
    poses = flight(0.0)
    poses[:, 2] = SCENE.radius
    for k in range(40):
        stamp = START + k * 10_000_000
        found.add(PoseArrayFrame(stamp, 'world', poses), stamp)
    assert found.counts['accepted'] == 40
    assert np.abs(found.start()[1].velocities).max() < 1e-12  # rounding of a fit


def test_a_recording_is_judged_alike() -> None:
    frames = frames_of(100.0, 2, 40)
    stamps = np.array([frame.stamp_ns for frame in frames])
    ((taken), *others), refused = usable_passes(frames, stamps, frame_id='world', radius=0.02)
    assert not others and taken == list(range(0, 40, 2))
    assert refused == {'content': 20}


def write_bag(folder: Path, rate: float, back: float) -> Path:
    """Two seconds of flight, in the middle of which the clock of all is set back by `back` [s]."""
    count = round(1.2 * rate)
    with BagWriter(folder) as bag:
        bag.add_topic('/tracked_poses', 'geometry_msgs/msg/PoseArray', 'reliable')
        for k in range(count):
            time = k / rate
            stamp = START + round((time - back * (k >= count // 2)) * 1e9)
            poses = flight(time)
            poses[:, 2] += 6.0  # above the floor throughout
            bag.write('/tracked_poses', PoseArrayCodec('world', 2).encode(poses, stamp), stamp)
    return folder


@pytest.mark.parametrize('rate', [70.0, 240.0])
@pytest.mark.parametrize('back', [0.5, 0.251, 2.0])
def test_a_clock_that_is_set_back_cuts_and_loses_nothing(
    tmp_path: Path, rate: float, back: float
) -> None:
    bag = write_bag(tmp_path / 'bag', rate, back)
    scene = tmp_path / 'scene.yaml'
    scene.write_text('scene: {radius: 0.02, mass: 0.003}')
    (report,) = import_bags([bag], tmp_path / 'data', ImportOptions(scene=scene))
    assert (report['cuts'], report['refused']) == ({'anew': 1}, {})
    first, second = load_tracks(tmp_path / 'data')
    assert len(first.times) + len(second.times) == round(1.2 * rate)
    for track in first, second:
        speeds = (
            np.linalg.norm(np.diff(track.positions, axis=0), axis=-1)
            / np.diff(track.times)[:, None]
        )
        assert speeds.max() < 12.0  # what gravity gives; joined, a step had far more


@pytest.mark.parametrize('matched', [False, True])
@pytest.mark.parametrize('back', [0.5, 0.26])
def test_the_node_begins_anew_too(matched: bool, back: float) -> None:
    """At 20 Hz half a second lies within the frames in memory, as late frames do."""
    found = window(matched=matched)
    restarts = 0
    for k in range(40):
        time = 0.05 * k
        stamp = START + round((time - back * (k >= 20)) * 1e9)
        with contextlib.suppress(RejectedFrame):
            restarts += found.add(PoseArrayFrame(stamp, 'world', flight(time)), stamp)
    assert set(found.counts) <= {'accepted', 'duplicate', 'late', 'reordered', *CHANGES}
    assert restarts == 1
    state = found.start()[1]
    velocities = VELOCITIES + np.array(SCENE.gravity) * 0.05 * 39
    np.testing.assert_allclose(state.velocities, velocities, atol=0.05)


def test_repeats_of_many_spheres_take_no_memory_for_each_pair() -> None:
    """Of 3000 all pairs took 0.6 GB and 3 s, of 100 000 they would not fit into memory."""
    rng, repeats = np.random.default_rng(0), Repeats(0.02)
    poses = np.concatenate(
        [rng.normal(size=(3000, 3)), np.tile([0, 0, 0, 1.0], (3000, 1))], axis=1
    )
    for index in range(2):
        repeats.took(PoseArrayFrame(START + index * 10**7, 'world', poses + 0.01 * index))
    again = PoseArrayFrame(START + 2 * 10**7, 'world', poses + 0.01)
    tracemalloc.start()
    with pytest.raises(RejectedFrame, match='its poses are those of the frame'):
        repeats.check(again)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 100 * poses.nbytes
