# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Training learns, resumes to the same weights, and keeps the best of its rollouts."""

from dataclasses import replace
import json
import os
import signal

from killed_writes import killed_at
import numpy as np
import pytest
from rigid_gns_core.data.common_scene import common_scene
from rigid_gns_core.data.records import Record
from rigid_gns_core.files.config import ConfigError, from_mapping, to_mapping
from rigid_gns_core.gns.config import GNSConfig
from rigid_gns_core.prediction.load import load_simulator
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.similarity import ModelUnits
from rigid_gns_core.scenes.state import Trajectory
from rigid_gns_core.training.gns.closed_loop import batch_of
from rigid_gns_core.training.gns.learner import GNSLearner, GNSTrainConfig
from rigid_gns_core.training.gns.windows import Noise, Source
from rigid_gns_core.training.train import _memory_told, find_device, load_recipe, Trainer
import torch

UNITS = ModelUnits(radius=1.0, gravity=9.81, dt=0.1)
CONFIG = GNSTrainConfig(
    model=GNSConfig(message_passing_steps=1, width=16),
    steps=20,
    batch=4,
    validate_every=10,
    validation_steps=8,
    average=0.9,
    warm_up=5,
)


def falling(seed, scene=None, count=6, steps=12):
    """Free fall in closed form: what a network can learn in seconds."""
    rng = np.random.default_rng(seed)
    time = (np.arange(steps + 1) * 0.1)[:, None, None]
    start = rng.uniform(-10, 10, (count, 3)) + [0, 0, 40]
    velocity = rng.normal(size=(count, 3))
    gravity = np.array([0, 0, -9.81])
    positions = start + velocity * time + 0.5 * gravity * time**2
    quaternions = np.tile([0.0, 0, 0, 1.0], (steps + 1, count, 1))
    trajectory = Trajectory(
        positions=positions,
        quaternions=quaternions,
        velocities=velocity + gravity * time,
        angular_velocities=np.zeros_like(positions),
        dt=0.1,
    )
    return Record(
        trajectory=trajectory, scene=scene or Scene(surfaces=Plane.box(40, 40)), seed=seed
    )


RECORDS = [falling(seed) for seed in range(4)]
HELD_OUT = [falling(seed) for seed in (10, 11)]


def test_resumed_run_gives_the_same_bytes(tmp_path):
    Trainer(CONFIG, RECORDS, HELD_OUT, tmp_path / 'whole').run()
    Trainer(CONFIG, RECORDS, HELD_OUT, tmp_path / 'parts').run(stop_at=7)
    Trainer(CONFIG, RECORDS, HELD_OUT, tmp_path / 'parts').run(stop_at=13)
    Trainer(CONFIG, RECORDS, HELD_OUT, tmp_path / 'parts').run()
    for name in ('best.safetensors', 'state.safetensors', 'best.json'):
        assert (tmp_path / 'whole' / name).read_bytes() == (tmp_path / 'parts' / name).read_bytes()


def test_a_state_is_loaded_to_where_the_network_is():
    """A fused Adam on a GPU also reads its count of steps there; meta stands for one."""
    learner = GNSLearner.of(CONFIG, RECORDS)
    learner.advance()
    learner.device = torch.device('meta')
    learner.load_state(learner.state())
    states = [learner.optimizer.state[parameter] for parameter in learner.parameters]
    assert {'step', 'exp_avg', 'exp_avg_sq'} == set(states[0])
    assert {value.device.type for state in states for value in state.values()} == {'meta'}


def test_seeds_differ():
    first, second = (
        GNSLearner(
            replace(CONFIG, seed=s), [Source.of(RECORDS[0].trajectory, RECORDS[0].scene)], UNITS
        )
        for s in (0, 1)
    )
    assert not torch.equal(first.network.decoder.last.weight, second.network.decoder.last.weight)


def test_free_fall_is_learned(tmp_path):
    config = replace(CONFIG, steps=300, validate_every=150, learning_rate=5e-3, average=0.98)
    Trainer(config, RECORDS, HELD_OUT, tmp_path).run()
    log = [json.loads(line) for line in (tmp_path / 'log.jsonl').read_text().splitlines()]
    # normalised targets have variance 1: predicting their mean gives a loss near 1
    assert log[-1]['loss'] < 0.02
    simulator = load_simulator(tmp_path / 'best')
    reference = HELD_OUT[0].trajectory.window(0, 9)
    predicted = simulator.rollout(
        HELD_OUT[0].scene, reference[0].positions, reference[0].velocities, steps=8
    )
    fallen = np.abs(reference.positions[-1] - reference.positions[0]).max()
    error = np.linalg.norm(predicted.positions[-1] - reference.positions[-1], axis=1).mean()
    assert error < 0.2 * fallen  # a network that stands still is wrong by all of it


def test_best_is_the_best_of_the_log(tmp_path):
    best = Trainer(replace(CONFIG, steps=40), RECORDS, HELD_OUT, tmp_path).run()
    log = [json.loads(line) for line in (tmp_path / 'log.jsonl').read_text().splitlines()]
    assert best == pytest.approx(min(entry['validation'] for entry in log))
    card = json.loads((tmp_path / 'best.json').read_text())
    assert card['validation']['root_chamfer_radii'] == pytest.approx(best)
    assert card['units'] == {'radius': 1.0, 'gravity': 9.81, 'dt': 0.1}


def test_another_recipe_in_the_same_folder_is_refused(tmp_path):
    Trainer(CONFIG, RECORDS, [], tmp_path).run(stop_at=1)
    with pytest.raises(ConfigError, match='differs from the recipe and data asked for in batch'):
        Trainer(replace(CONFIG, batch=5), RECORDS, [], tmp_path)


def test_other_data_in_the_same_folder_are_refused(tmp_path):
    Trainer(CONFIG, RECORDS, HELD_OUT, tmp_path).run(stop_at=1)
    for records, held_out in ((RECORDS[:3], HELD_OUT), (RECORDS, HELD_OUT[:1])):
        with pytest.raises(ConfigError, match='asked for in sha256'):
            Trainer(CONFIG, records, held_out, tmp_path)


def test_validation_that_cannot_be_used_is_refused(tmp_path):
    config = replace(CONFIG, validation_steps=50)
    with pytest.raises(ValueError, match='no validation trajectory has 50 steps'):
        Trainer(config, RECORDS, HELD_OUT, tmp_path)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_within_a_step_leaves_whole_steps(tmp_path, number):
    Trainer(CONFIG, RECORDS, HELD_OUT, tmp_path / 'whole').run()
    trainer = Trainer(CONFIG, RECORDS, HELD_OUT, tmp_path / 'parts')
    advance = trainer.learner.advance

    def interrupted():
        if trainer.learner.step == 5:
            os.kill(os.getpid(), number)
        return advance()

    trainer.learner.advance = interrupted
    with pytest.raises(KeyboardInterrupt):
        trainer.run()
    assert trainer.learner.step == 6
    Trainer(CONFIG, RECORDS, HELD_OUT, tmp_path / 'parts').run()
    for name in ('best.safetensors', 'state.safetensors'):
        assert (tmp_path / 'whole' / name).read_bytes() == (tmp_path / 'parts' / name).read_bytes()


def test_a_run_that_is_killed_loses_little(tmp_path, monkeypatch):
    monkeypatch.setattr('rigid_gns_core.training.train.SAVE_EVERY', 0.0)  # after each step
    Trainer(CONFIG, RECORDS, HELD_OUT, tmp_path / 'whole').run()
    trainer = Trainer(CONFIG, RECORDS, HELD_OUT, tmp_path / 'parts')
    advance = trainer.learner.advance

    def killed():
        if trainer.learner.step == 5:
            raise MemoryError
        return advance()

    trainer.learner.advance = killed
    with pytest.raises(MemoryError):
        trainer.run()
    other = Trainer(CONFIG, RECORDS, HELD_OUT, tmp_path / 'parts')
    assert other.learner.step == 5
    other.run()
    for name in ('best.safetensors', 'state.safetensors'):
        assert (tmp_path / 'whole' / name).read_bytes() == (tmp_path / 'parts' / name).read_bytes()


def test_a_run_killed_as_it_writes_goes_on_to_the_same_files(tmp_path, monkeypatch):
    """Killed before and after each file is put in its place; signals leave half of the losses."""
    Trainer(CONFIG, RECORDS, HELD_OUT, tmp_path / 'whole').run()
    for last in range(1, 8):
        folder = tmp_path / f'{last}'
        with monkeypatch.context() as patched:
            patched.setattr(os, 'replace', killed_at(last))
            with pytest.raises(MemoryError):
                Trainer(CONFIG, RECORDS, HELD_OUT, folder).run()
        (folder / '.state.safetensors.1.tmp').touch()  # what a kill leaves
        if (log := folder / 'log.jsonl').exists():
            log.write_text(log.read_text() + '{"step": 99')
        Trainer(CONFIG, RECORDS, HELD_OUT, folder).run(stop_at=7)
        Trainer(CONFIG, RECORDS, HELD_OUT, folder).run()
        assert sorted(os.listdir(folder)) == sorted(os.listdir(tmp_path / 'whole'))
        for file in (tmp_path / 'whole').iterdir():
            assert file.read_bytes() == (folder / file.name).read_bytes(), (last, file.name)


def test_a_full_disk_leaves_the_recipe_of_a_run(tmp_path, monkeypatch):
    Trainer(CONFIG, RECORDS, [], tmp_path).run(stop_at=1)
    before = (tmp_path / 'recipe.yaml').stat()
    Trainer(CONFIG, RECORDS, [], tmp_path)
    after = (tmp_path / 'recipe.yaml').stat()
    assert (before.st_ino, before.st_mtime_ns) == (after.st_ino, after.st_mtime_ns)


@pytest.mark.parametrize(
    ('line', 'message'),
    [
        ('kind: [gns]', r"kind is \['gns'\], allowed: gns, residual"),
        ('clip: .inf', 'clip is inf, expected a finite number'),
        ('noise: {std: .inf}', 'std of the noise is inf, expected a finite number'),
        ('batch: 1000000000', 'batch is 1000000000, expected at most 100000'),
    ],
)
def test_recipes_that_cannot_be_used_are_refused(tmp_path, line, message):
    kind = '' if line.startswith('kind') else 'kind: gns\n'
    (tmp_path / 'recipe.yaml').write_text(f'{kind}{line}\n')
    with pytest.raises(ConfigError, match=message):
        load_recipe(tmp_path / 'recipe.yaml')


def test_too_little_memory_is_told():
    with pytest.raises(MemoryError, match='train with a smaller batch'), _memory_told():
        torch.empty(10**15)


def quiet_batch(learner):
    windows = learner.windows(learner.draw(0, 3, Noise(std=0.0)), 1)
    return batch_of(windows, 0, windows.start, corrects_target=False)


def test_energy_regulariser_is_the_energy_that_the_prediction_gains():
    source = Source.of(RECORDS[0].trajectory, RECORDS[0].scene)
    learner = GNSLearner(CONFIG, [source], UNITS)
    batch = quiet_batch(learner)
    motion = batch.graph.motion
    predicted = motion.clone()
    predicted[:, 2] = 0.0  # level flight: no potential energy is won
    predicted[:, :2] *= 2
    gained = 0.5 * (predicted[:, :3].square() - motion[:, :3].square()).sum(1)
    expected = [max(part.mean().item(), 0.0) / 9.81 for part in gained.split(6)]
    assert learner.energy_gain(predicted, batch).item() == pytest.approx(
        np.mean(expected), rel=1e-5
    )
    slower = motion * torch.tensor([0.5, 0.5, 1.0, 1, 1, 1])
    slower[:, 2] = torch.minimum(slower[:, 2], torch.zeros(())) * 0.5
    assert learner.energy_gain(slower, batch).item() == 0.0


def test_free_flight_gains_no_energy():
    # backward differences make E[k+1] - E[k] = -m g^2 dt^2 / 2 in free flight: never a gain
    source = Source.of(RECORDS[0].trajectory, RECORDS[0].scene)
    learner = GNSLearner(CONFIG, [source], UNITS)
    batch = quiet_batch(learner)
    assert learner.energy_gain(batch.next_motion, batch).item() < 1e-5  # float32 of 9.81 * 40


@pytest.mark.parametrize('broken', ['loss', 'gradient'])
def test_what_is_not_finite_stops_the_run_before_it_reaches_the_weights(tmp_path, broken):
    trainer = Trainer(CONFIG, RECORDS, [], tmp_path)
    trainer.run(stop_at=10)
    saved = (tmp_path / 'state.safetensors').read_bytes()
    bias = trainer.learner.network.decoder.bias
    if broken == 'loss':
        with torch.no_grad():
            bias.fill_(float('inf'))
    else:
        bias.register_hook(lambda gradient: gradient * float('nan'))
    with pytest.raises(FloatingPointError, match='learning_rate'):
        trainer.run()
    assert (tmp_path / 'state.safetensors').read_bytes() == saved
    if broken == 'gradient':
        assert torch.isfinite(bias).all()


@pytest.mark.parametrize(
    ('name', 'value'),
    [('steps', 0), ('clip', -1.0), ('average', 1.5), ('warm_up', -5), ('start_fraction', 2.0)],
)
def test_recipes_out_of_range_are_named(name, value):
    with pytest.raises(ValueError, match=name):
        replace(CONFIG, **{name: value})


@pytest.mark.parametrize(
    ('scenes', 'message'),
    [
        ([Scene(restitution=0.5), Scene(restitution=0.6)], 'differ'),
        ([Scene(restitution=(0.5, 0.6, 0.5, 0.5, 0.5, 0.5))], 'restitution from 0.5 to 0.6'),
        ([Scene(surfaces=Plane(restitution=0.1))], 'restitution from 0.1 to 0.6'),
        ([Scene(gravity=(9.81, 0.0, 0.0))], 'expected along -z'),
        ([Scene(mass=(1.0, 2.0, 1, 1, 1, 1))], 'mass from 1 to 2'),
        ([], 'no training trajectories'),
    ],
)
def test_records_of_several_kinds_are_refused(scenes, message):
    with pytest.raises(ValueError, match=message):
        common_scene([falling(0, scene) for scene in scenes])


def test_learning_rate_warms_up_and_falls():
    rates = [CONFIG.learning_rate_at(step) for step in range(CONFIG.steps + 1)]
    assert rates[0] == pytest.approx(CONFIG.learning_rate / 5)
    assert max(rates) == pytest.approx(CONFIG.learning_rate)
    assert rates[-1] == pytest.approx(CONFIG.final_learning_rate)
    assert all(np.diff(rates[5:]) < 0)


def test_the_shipped_weights_follow_the_shipped_recipe():
    config = load_recipe('gns_closed_loop')
    training = load_simulator('gns').card['training']
    assert {key: training[key] for key in to_mapping(config)} == to_mapping(config)


def test_an_unknown_key_lists_the_allowed_ones():
    with pytest.raises(ConfigError, match="unknown key 'momentum', allowed: seed, steps"):
        from_mapping(GNSTrainConfig, {'momentum': 1})


def test_a_device_that_is_not_there_is_named(monkeypatch):
    monkeypatch.setattr(torch.cuda, 'is_available', lambda: False)
    assert find_device('auto') == find_device('cpu') == torch.device('cpu')
    with pytest.raises(ValueError, match='device is cuda, but torch finds no CUDA device'):
        find_device('cuda')
    monkeypatch.setattr(torch.cuda, 'is_available', lambda: True)
    assert find_device('auto') == torch.device('cuda')
