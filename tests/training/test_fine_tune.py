# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Training from a checkpoint: its weights, its units, and what cannot be started from it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('torch', reason='training needs torch')

from rigid_gns_core.commands.cli import main
from rigid_gns_core.data.recipe import DataRecipe, recipe_hash
from rigid_gns_core.data.records import Record, record_path, write_recipe, write_record
from rigid_gns_core.files.checkpoint import CheckpointError
from rigid_gns_core.files.config import ConfigError, from_mapping
from rigid_gns_core.prediction.load import load_simulator
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.scenes.state import Trajectory
from rigid_gns_core.training.fine_tune import StartingPoint
from rigid_gns_core.training.gns.learner import GNSLearner
from rigid_gns_core.training.gns.windows import Source
from rigid_gns_core.training.recipes import load_recipe
from rigid_gns_core.training.train import Trainer
import torch

STEPS = 12


def tracked(radius: float = 1.0, dt: float = 0.1) -> Record:
    """Four spheres in flight over a floor that they do not reach, by their poses."""
    times = dt * np.arange(STEPS + 1)[:, None]
    places = np.zeros((STEPS + 1, 4, 3))
    places[..., 0] = radius * (4.0 * np.arange(4) + times / dt)
    places[..., 2] = 20.0 * radius - 0.5 * 9.81 * times**2
    quaternions = np.tile([0.0, 0.0, 0.0, 1.0], (*places.shape[:2], 1))
    return Record(
        trajectory=Trajectory.from_poses(places, quaternions, dt),
        scene=Scene(radius=radius, restitution=0.9),
        seed=0,
        teacher={'engine': 'tracker'},
        name='flight',
    )


@pytest.fixture(scope='module')
def point() -> StartingPoint:
    return StartingPoint.of('gns')


def test_a_learner_starts_with_the_weights_and_normalisers(point: StartingPoint) -> None:
    learner = GNSLearner.of(load_recipe('gns_finetune'), point.records([tracked()]))
    point.load(learner)
    shipped = load_simulator('gns').tensors
    for name, value in learner.network.state_dict().items():
        np.testing.assert_array_equal(value.numpy(), shipped[name], err_msg=name)
    assert any('normaliser' in name for name in shipped)
    for average, parameter in zip(learner.averaged, learner.parameters, strict=True):
        assert torch.equal(average, parameter)
    learner.advance()
    before = {name: value.clone() for name, value in learner.network.state_dict().items()}
    point.load(learner)
    for name, value in learner.network.state_dict().items():
        assert torch.equal(value, before[name]), 'a run that has begun goes on'


def test_records_of_small_spheres_come_in_the_units_of_the_model(point: StartingPoint) -> None:
    (small,) = point.records([tracked(0.04, 0.02)])
    (large,) = point.records([tracked()])
    assert (small.scene.radius, small.trajectory.dt) == (1.0, 0.1)
    assert small.scene.gravity == (0.0, 0.0, -9.81)
    for name in ('positions', 'velocities'):
        ours, theirs = getattr(small.trajectory, name), getattr(large.trajectory, name)
        np.testing.assert_allclose(ours, theirs, atol=1e-9)  # roundings of numbers up to 20


def test_tracked_flights_start_with_the_velocity_of_the_instant(point: StartingPoint) -> None:
    (record,) = point.records([tracked()])
    # frame 0 has no difference of its own; after it the fall's speed is g dt, and the mean over
    # the next step g dt / 2 more
    assert record.trajectory.steps == tracked().trajectory.steps - 1
    np.testing.assert_allclose(record.trajectory.velocities[0, :, 2], -0.981, atol=1e-9)
    np.testing.assert_allclose(record.trajectory.velocities[1, :, 2], -1.4715, atol=1e-9)


def test_no_window_is_told_what_it_has_to_predict(point: StartingPoint) -> None:
    """What a sphere did before its first window is not what it does in it."""
    struck = tracked()
    positions = struck.trajectory.positions.copy()
    positions[1:] += [0.0, 0.0, 1.0]  # off its way between frames 0 and 1
    whole = Trajectory.from_poses(positions, struck.trajectory.quaternions, struck.trajectory.dt)
    (record,) = point.records([replace(struck, trajectory=whole)])
    source = Source.of(record.trajectory, record.scene)
    np.testing.assert_allclose(source.velocities[0], whole.velocities[1], atol=0.5)
    assert np.abs(source.velocities[0] - source.velocities[1])[:, 2].min() > 9.0


def test_a_record_of_one_step_is_refused(point: StartingPoint) -> None:
    whole = tracked()
    short = replace(whole, trajectory=whole.trajectory.window(0, 2))
    with pytest.raises(ValueError, match='has 1 step, expected at least 2; import it with'):
        point.records([short])


def test_models_and_records_that_do_not_fit_are_named(point: StartingPoint) -> None:
    slow = replace(tracked(), trajectory=replace(tracked().trajectory, dt=0.2))
    with pytest.raises(ValueError, match=r"'flight' has a time step of 0.2 s, .* 0.1 s .*--dt"):
        point.records([slow])
    floating = replace(tracked(), scene=replace(tracked().scene, gravity=(0.0, 0.0, 0.0)))
    with pytest.raises(ValueError, match="'flight' has no gravity, .*without --from"):
        point.records([floating])
    with pytest.raises(
        CheckpointError, match="model 'laws' has no weights .* rigid-gns calibrate"
    ):
        StartingPoint.of('laws')
    recipe = load_recipe('gns_finetune')
    other = replace(recipe, model=replace(recipe.model, width=16))
    with pytest.raises(CheckpointError, match=r'differs from the recipe \(gns\) in width'):
        point.load(GNSLearner.of(other, point.records([tracked()])))


def test_a_run_goes_on_from_its_own_start_alone(point: StartingPoint, tmp_path: Path) -> None:
    recipe, records = replace(load_recipe('gns_finetune'), steps=1), point.records([tracked()])
    other = replace(point, name='other 0123456789ab')
    Trainer(recipe, records, [], tmp_path / 'tuned', start=point).run()
    again = Trainer(recipe, records, [], tmp_path / 'tuned', start=point)
    assert again.learner.step == 1
    Trainer(recipe, records, [], tmp_path / 'fresh')
    for folder, start, before, now in (
        ('tuned', other, point.name, other.name),
        ('tuned', None, point.name, 'no model'),
        ('fresh', point, 'no model', point.name),
    ):
        words = f'{folder}/recipe.yaml: the run was started from {before}, .* from {now}; give'
        with pytest.raises(ConfigError, match=words):
            Trainer(recipe, records, [], tmp_path / folder, start=start)


def test_the_command_trains_from_a_model(tmp_path: Path) -> None:
    recipe = from_mapping(
        DataRecipe,
        {'trajectories': 1, 'seed': 0, 'steps': STEPS, 'spheres': [4, 4], 'box_side': [0, 100]},
    )
    record = replace(tracked(), recipe=recipe_hash(recipe))
    write_record(record_path(tmp_path / 'data', 0), record, 'poses')
    write_recipe(tmp_path / 'data', recipe)
    words = ['train', '--config', 'gns_finetune', '--from', 'gns', '--steps', '1']
    assert main([*words, '--data', str(tmp_path / 'data'), '--out', str(tmp_path / 'run')]) == 0
    tuned, shipped = load_simulator(tmp_path / 'run' / 'best'), load_simulator('gns')
    assert tuned.card['training']['data'].startswith('data from gns ')
    assert tuned.card['materials']['restitution'] == 0.9
    # one warm-up step of 4e-6 changes each weight by no more
    for name, value in tuned.tensors.items():
        np.testing.assert_allclose(value, shipped.tensors[name], atol=5e-6)
