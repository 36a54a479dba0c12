# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.bags.topics import find_topics
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.commands.cli import evaluate
from rigid_gns_core.files.strict_json import read_json
from rigid_gns_core.forecasts.forecaster import Forecaster
from rigid_gns_core.forecasts.window_setup import window_of
from rigid_gns_core.messages.poses import decode_pose_array, encode_string, PoseArrayCodec
from rigid_gns_core.recordings.scoring.reproduce import reproduce, Reproduction
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.scene_file import load_scene

START = 1_700_000_000_123_456_789
PERIOD = 100_000_000  # [ns], the shipped model's at radius 1 m
POSE_ARRAY = 'geometry_msgs/msg/PoseArray'
COUNT = 5


def tracked(number: int) -> np.ndarray:
    """Spheres that fall, with the noise of a tracker, shape (5, 7)."""
    t = number * PERIOD * 1e-9
    poses = np.zeros((COUNT, 7))
    poses[:, 0] = 4.0 * np.arange(COUNT) + 0.3 * t
    poses[:, 2], poses[:, 6] = 20.0 - 4.905 * t * t, 1.0
    poses[:, :3] += np.random.default_rng(number).normal(scale=1e-3, size=(COUNT, 3))
    return poses


@pytest.fixture(scope='module')
def model() -> Forecaster:
    return Forecaster('', load_scene('box_154'))


def write_bag(
    folder: Path,
    model: Forecaster,
    *,
    start: str = 'first',
    said: bool = True,
    change: Callable[[int, np.ndarray], np.ndarray] = lambda _, poses: poses,
    reset: int | None = None,
    card: dict[str, Any] | None = None,
) -> Path:
    """Return a bag as the simulator makes it: 20 frames; `reset` forgets all before that frame."""
    parameters = {'start': start, 'velocity_window': 3, 'rate': 0.0, 'threads': 1}
    parameters |= {'frame_id': 'world', 'max_spheres': 1000, 'model': '', 'scene': 'box_154'}
    scene = {**model.description, 'parameters': parameters}
    scene |= {'model_card': card or model.simulator.card}
    codec, window = PoseArrayCodec('world', COUNT), window_of(model, parameters)
    forecast, published = None, 0
    with BagWriter(folder) as bag:
        for name in ('/tracked_poses', '/predicted_poses'):
            bag.add_topic(name, POSE_ARRAY, 'reliable')
        for name in ('/simulator/scene', '/simulator/start'):
            bag.add_topic(name, 'std_msgs/msg/String', 'latched')
        bag.write('/simulator/scene', encode_string(json.dumps(scene)), START)
        for number in range(20):
            stamp = START + number * PERIOD
            if number == reset:
                window.clear()
                forecast = None
            cdr = codec.encode(tracked(number), stamp)
            window.add(decode_pose_array(cdr), stamp)
            bag.write('/tracked_poses', cdr, stamp)
            if window.full and (forecast is None or start == 'every'):
                frames = [stamp - k * PERIOD for k in (2, 1, 0)]
                reason = 'every' if forecast and start == 'every' else 'first'
                reason = 'reset' if reset and number == reset + 2 else reason
                forecast = model.forecast(window.start()[1], stamp, window.ids)
                text = json.dumps({'stamp_ns': stamp, 'window_ns': frames, 'reason': reason})
                if said:
                    bag.write('/simulator/start', encode_string(text), stamp)
            if forecast:
                poses = change(published, forecast.advance_to(stamp + PERIOD).poses)
                bag.write('/predicted_poses', codec.encode(poses, stamp + PERIOD), stamp + 1)
                published += 1
    return folder


def again(folder: Path) -> Reproduction:
    bag = read_bag(folder)
    return reproduce(bag, find_topics(bag))


def test_tilted_planes_of_the_node_are_the_same_in_the_bag_and_in_replay(tmp_path):
    rng = np.random.default_rng(0)
    tilted = [
        Plane(tuple(rng.normal(size=3) - [0, 0, 5]), n, rng.normal(size=3), *rng.uniform(1, 9, 2))
        for n in rng.normal(size=(50, 3))
    ]
    ramp = Plane((0, 0, -5.0), (0.1, 0.2, 1.0), (1.0, 0.3, 0.0))
    model = Forecaster('', Scene(surfaces=(ramp, *tilted), friction=0.37))
    folder = write_bag(tmp_path / 'bag', model, start='every')
    read = Scene.from_mapping(find_topics(read_bag(folder)).recorded['scene'])
    assert read == model.scene
    for plane, given in zip(read.surfaces, model.scene.surfaces, strict=True):
        assert plane.axes.tobytes() == given.axes.tobytes()
    result = again(folder)
    assert (result.predictions, result.same, result.different) == (18, 18, 0)


@pytest.mark.parametrize('start', ['first', 'every'])
def test_predictions_are_the_same_bytes(tmp_path, model, start):
    result = again(write_bag(tmp_path / 'bag', model, start=start))
    assert (result.predictions, result.same, result.different, result.unknown) == (18, 18, 0, 0)
    assert result.starts == (18 if start == 'every' else 1)
    assert result.first_difference is None


def test_a_reset_starts_from_what_came_after_it(tmp_path, model):
    result = again(write_bag(tmp_path / 'bag', model, reset=9))
    assert (result.predictions, result.same, result.starts) == (16, 16, 2)


def test_the_first_difference_is_named(tmp_path, model):
    def change(number: int, poses: np.ndarray) -> np.ndarray:
        if number >= 4:
            poses[2, 0] = np.nextafter(poses[2, 0], np.inf)  # one bit of one number
        return poses

    result = again(write_bag(tmp_path / 'bag', model, change=change))
    assert (result.same, result.different) == (4, 14)
    assert result.first_difference is not None
    assert result.first_difference['index'] == 4
    assert result.first_difference['stamp_s'] == '1700000000.823456789'
    assert result.first_difference['values'] == 1
    assert 0 < result.first_difference['largest_m'] < 1e-14
    assert 'first to differ: prediction 4 for 1700000000.8234' in str(result)


def test_without_recorded_starts_the_first_window_is_taken(tmp_path, model):
    result = again(write_bag(tmp_path / 'bag', model, said=False))
    assert (result.predictions, result.same, result.unknown) == (18, 18, 0)
    restarted = again(write_bag(tmp_path / 'restarted', model, said=False, reset=9))
    # the stamps after it are on the grid of those before, so nothing tells of the reset
    assert (restarted.same, restarted.different) == (7, 9)
    assert 'one that no stamp tells of shows as a difference' in restarted.notes[0]
    every = again(write_bag(tmp_path / 'every', model, start='every', said=False))
    assert (every.same, every.unknown) == (0, 18)
    assert 'holds no ~/start' in every.notes[0]


def test_missing_frames_are_reported(tmp_path, model):
    folder = write_bag(tmp_path / 'bag', model)
    bag = read_bag(folder)
    topic = bag.topics['/tracked_poses']
    del topic.messages[1]
    bag.topics['/tracked_poses'] = type(topic)(
        topic.name, topic.type_name, np.delete(topic.times, 1), topic.messages,
        np.delete(topic.indices, 1),
    )  # fmt: skip
    result = reproduce(bag, find_topics(bag))
    assert (result.same, result.unknown) == (0, 18)
    assert '1 of its 3 tracked frames are not in the bag' in result.notes[0]


def test_another_model_is_refused(tmp_path, model):
    trained = {'kind': 'gns', 'weights_sha256': '0' * 64}
    folder = write_bag(tmp_path / 'trained', model, card=trained)
    with pytest.raises(ValueError, match='weights 000000000000.*; here: laws with .*--model'):
        again(folder)
    card = model.simulator.card
    finer = {**card, 'options': {**card['options'], 'substeps': 16}}
    folder = write_bag(tmp_path / 'finer', model, card=finer)
    with pytest.raises(ValueError, match='substeps 16; here: laws with options .* substeps 8'):
        again(folder)


def test_a_bag_of_another_recorder_cannot_be_reproduced(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:
        for name in ('/tracked_poses', '/predicted_poses'):
            bag.add_topic(name, POSE_ARRAY, 'reliable')
            cdr = PoseArrayCodec('world', COUNT).encode(tracked(0), START)
            bag.write(name, cdr, START)
    with pytest.raises(ValueError, match='nothing on ~/scene says the scene'):
        again(tmp_path / 'bag')


def test_the_exit_code_shows_differences(tmp_path, model, capsys):
    numbers = tmp_path / 'again.json'
    folder = str(write_bag(tmp_path / 'same', model))
    assert evaluate([folder, '--reproduce', '--json', str(numbers)]) == 0
    assert '18 of 18 predictions are the same bytes' in capsys.readouterr().out
    assert read_json(numbers)['same'] == 18
    other = write_bag(tmp_path / 'other', model, change=lambda _, poses: poses + 1e-9)
    assert evaluate([str(other), '--reproduce']) == 1
    assert '0 of 18' in capsys.readouterr().out
    assert load_scene('box_154').to_mapping() == model.scene.to_mapping()
