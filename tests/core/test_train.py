"""Training learns, resumes to the same weights, and keeps the best of its rollouts."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch
import yaml

from rigid_gns_core.config import ConfigError, find_config, from_mapping, load_yaml
from rigid_gns_core.dataset import Record
from rigid_gns_core.learner import Learner, TrainConfig
from rigid_gns_core.models.gns import GNSConfig
from rigid_gns_core.rollout import load_simulator
from rigid_gns_core.scene import Plane, Scene
from rigid_gns_core.similarity import ModelUnits
from rigid_gns_core.state import Trajectory
from rigid_gns_core.train import Trainer, common_scene
from rigid_gns_core.windows import Noise, Source

UNITS = ModelUnits(radius=1.0, gravity=9.81, dt=0.1)
CONFIG = TrainConfig(
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


def test_seeds_differ():
    first, second = (
        Learner(
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
    with pytest.raises(ConfigError, match='differs from the recipe'):
        Trainer(replace(CONFIG, batch=5), RECORDS, [], tmp_path)


def test_energy_regulariser_is_the_energy_that_the_prediction_gains():
    source = Source.of(RECORDS[0].trajectory, RECORDS[0].scene)
    learner = Learner(CONFIG, [source], UNITS)
    batch = learner.batch(0, 3, Noise(std=0.0))
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
    learner = Learner(CONFIG, [source], UNITS)
    batch = learner.batch(0, 3, Noise(std=0.0))
    assert learner.energy_gain(batch.next_motion, batch).item() < 1e-5  # float32 of 9.81 * 40


def test_a_loss_that_is_not_finite_stops_the_run(tmp_path):
    trainer = Trainer(CONFIG, RECORDS, [], tmp_path)
    with torch.no_grad():
        trainer.learner.network.decoder.bias.fill_(float('inf'))
    with pytest.raises(FloatingPointError, match='learning_rate'):
        trainer.run()


@pytest.mark.parametrize(
    ('scenes', 'message'),
    [
        ([Scene(restitution=0.5), Scene(restitution=0.6)], 'differ'),
        ([Scene(restitution=(0.5,) * 6)], 'per-sphere'),
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


def test_shipped_recipes_are_read():
    for path in sorted(find_config('train', 'gns').parent.glob('*.yaml')):
        config = from_mapping(TrainConfig, load_yaml(path), str(path))
        assert config.model.message_passing_steps >= 1
        assert (
            yaml.safe_load(path.read_text())['model']['connectivity'] == config.model.connectivity
        )


def test_an_unknown_key_lists_the_allowed_ones():
    with pytest.raises(ConfigError, match="unknown key 'momentum', allowed: model, noise, seed"):
        from_mapping(TrainConfig, {'momentum': 1})
