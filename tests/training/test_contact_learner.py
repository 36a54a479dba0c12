# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Training of the contact model, its recipes, and the options of its simulator."""

from dataclasses import asdict, replace
import json

import numpy as np
import pytest
from rigid_gns_core import load_simulator, Plane, Scene
from rigid_gns_core.data.records import Record
from rigid_gns_core.engine.stepper import EngineStepper
from rigid_gns_core.files.checkpoint import save_model, tensors_of
from rigid_gns_core.files.config import ConfigError, to_mapping
from rigid_gns_core.gns.config import ContactConfig
from rigid_gns_core.models.contact.network import ContactNetwork
from rigid_gns_core.models.contact.stepper import ContactStepper
from rigid_gns_core.prediction.simulators import ContactSimulator
from rigid_gns_core.training.contact import ContactLearner, ContactTrainConfig
from rigid_gns_core.training.gns.learner import GNSTrainConfig
from rigid_gns_core.training.train import load_recipe, Trainer
import torch

MODEL = ContactConfig(substeps=2, rounds=2, width=8)
CONFIG = ContactTrainConfig(
    model=MODEL,
    frames=2,
    steps=4,
    batch=1,
    validate_every=2,
    validation_rollouts=1,
    validation_steps=4,
    warm_up=2,
    average=0.9,
)
CARD = {
    'kind': 'contact',
    'config': asdict(MODEL),
    'units': {'radius': 1.0, 'gravity': 9.81, 'dt': 0.1},
    'materials': {'restitution': [0.0, 0.7]},
    'training': {},
    'validation': {},
}
SCENE = Scene(surfaces=Plane.box(5.0, 5.0))


def network(seed=0):
    torch.manual_seed(seed)
    made = ContactNetwork(MODEL)
    with torch.no_grad():
        for parameter in made.heads.parameters():
            parameter.normal_(std=0.5)
    return made


def piled(seed, scene=SCENE, steps=9):
    """Spheres that fall onto each other in a narrow box, by more substeps of the model itself."""
    rng = np.random.default_rng(seed)
    grid = 2.1 * np.stack(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [0, 1]), -1).reshape(-1, 3)
    start = grid + rng.uniform(-0.03, 0.03, grid.shape) + [0, 0, 1.2]
    teacher = ContactSimulator(tensors_of(ContactNetwork(MODEL)), CARD, 'teacher', substeps=4)
    return Record(trajectory=teacher.rollout(scene, start, steps=steps), scene=scene, seed=seed)


@pytest.fixture(scope='module')
def records():
    return [piled(0), piled(1)]


def test_the_loss_has_a_finite_gradient_and_falls_along_it(records):
    learner = ContactLearner(replace(CONFIG, noise=(0, 0)), records)
    learner.network.load_state_dict(network().state_dict())
    loss = learner.loss_at(0)
    loss.backward()
    gradients = [p.grad for p in learner.network.parameters() if p.grad is not None]
    assert len(gradients) == len(learner.parameters)
    norm = torch.stack([g.square().sum() for g in gradients]).sum().sqrt()
    assert torch.isfinite(norm)
    assert norm > 0
    with torch.no_grad():
        for parameter, gradient in zip(learner.network.parameters(), gradients, strict=True):
            parameter.sub_(1e-3 * gradient / norm)
        assert learner.loss_at(0) < loss


def test_the_same_seed_gives_the_same_losses(records):
    runs = []
    for seed in (0, 0, 1):
        learner = ContactLearner(replace(CONFIG, seed=seed), records)
        runs.append([learner.advance() for _ in range(2)])
    assert runs[0] == runs[1]
    assert runs[0] != runs[2]


def test_resumed_run_gives_the_same_bytes(records, tmp_path):
    Trainer(CONFIG, records, records[:1], tmp_path / 'whole').run()
    Trainer(CONFIG, records, records[:1], tmp_path / 'parts').run(stop_at=1)
    Trainer(CONFIG, records, records[:1], tmp_path / 'parts').run()
    for name in ('best.safetensors', 'state.safetensors', 'best.json'):
        assert (tmp_path / 'whole' / name).read_bytes() == (tmp_path / 'parts' / name).read_bytes()
    card = json.loads((tmp_path / 'whole' / 'best.json').read_text())
    assert card['kind'] == 'contact'
    assert card['config'] == to_mapping(MODEL)
    assert card['materials']['restitution'] == [0.6, 0.6]
    moved = load_simulator(tmp_path / 'whole' / 'best').rollout(SCENE, [[0.0, 0, 3]], steps=2)
    assert moved.diverged_at is None


def test_the_loss_of_the_truth_is_zero():
    # free flight before any contact counts nothing, and the loss is defined all the same
    high = Scene(surfaces=())
    teacher = ContactSimulator(tensors_of(ContactNetwork(MODEL)), CARD, 'teacher')
    flight = teacher.rollout(high, [[0.0, 0, 50], [9.0, 0, 50]], steps=6)
    learner = ContactLearner(
        replace(CONFIG, noise=(0, 0)), [Record(trajectory=flight, scene=high, seed=0)]
    )
    assert learner.loss_at(0).item() == 0.0


def test_records_that_cannot_be_learned_are_refused(records):
    other = replace(records[0], scene=replace(SCENE, gravity=(0.0, 0.0, -1.6)), name='moon')
    with pytest.raises(ValueError, match=r"record 'moon' has gravity .* expected \(0, 0, -9.81\)"):
        ContactLearner(CONFIG, [other])
    with pytest.raises(ValueError, match='no training trajectories'):
        ContactLearner(CONFIG, [])
    slow = replace(records[0], trajectory=replace(records[0].trajectory, dt=0.2))
    with pytest.raises(ValueError, match=r'time steps \[0.1.*, 0.2\], expected one'):
        ContactLearner(CONFIG, [records[0], slow])


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'model': ContactConfig(network=False)}, 'nothing to train'),
        ({'frames': 0}, 'frames is 0'),
        ({'noise': (1e-3, 1e-6)}, 'noise is'),
        ({'noise': (0.0, 1e-6)}, 'noise is'),
        ({'resolution': 0.0}, 'resolution is 0'),
        ({'lost': -1.0}, 'lost is -1'),
    ],
)
def test_recipes_out_of_range_are_named(change, message):
    with pytest.raises(ValueError, match=message):
        replace(CONFIG, **change)


def test_load_recipe_knows_the_kinds(tmp_path):
    assert isinstance(load_recipe('contact'), ContactTrainConfig)
    assert isinstance(load_recipe('gns'), GNSTrainConfig)
    path = tmp_path / 'own.yaml'
    for text in ('kind: dpi\nsteps: 3\n', 'steps: 3\n'):
        path.write_text(text)
        with pytest.raises(ConfigError, match=r'own.yaml: kind is .*, allowed: gns, contact'):
            load_recipe(path)
    path.write_text('kind: contact\nhistory: 2\n')
    with pytest.raises(ConfigError, match="unknown key 'history', allowed: "):
        load_recipe(path)


@pytest.fixture(scope='module')
def saved(tmp_path_factory):
    path = tmp_path_factory.mktemp('model') / 'own'
    save_model(path, network(), CARD)
    return path


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        (
            {'gaurd': True},
            "no option 'gaurd', allowed: backend, dtype, guard, sleep, network, substeps",
        ),
        ({'dtype': 'float16'}, "dtype is 'float16', allowed: 'float32', 'float64'"),
        ({'rounds': 3}, 'rounds can be changed only with network=False'),
        ({'substeps': 0}, 'substeps is 0, expected at least 1'),
    ],
)
def test_options_that_cannot_be_are_named(saved, options, message):
    with pytest.raises(ValueError, match=message):
        load_simulator(saved, **options)


def test_options_reach_the_rollout(saved):
    simulator = load_simulator(saved, dtype='float32', guard=False, sleep=False, substeps=5)
    stepper = simulator.start(SCENE, [[0.0, 0, 3]]).stepper
    assert isinstance(stepper, ContactStepper)
    assert stepper.dtype == torch.float32
    assert stepper.guard is None and stepper.sleepers is None
    assert stepper.config == replace(MODEL, substeps=5)


def test_the_law_alone_can_be_loaded(saved):
    given = (SCENE, [[0.0, 0, 3]])
    law = {'network': False, 'rounds': 9}
    stepper = load_simulator(saved, backend='torch', **law).start(*given).stepper
    assert isinstance(stepper, ContactStepper)
    assert stepper.network is None and stepper.config.rounds == 9
    stepper = load_simulator(saved, **law).start(*given).stepper
    assert isinstance(stepper, EngineStepper)
    assert len(stepper.settings.weights.rounds) == 0 and stepper.settings.rounds == 9


def test_backends(saved):
    assert load_simulator(saved).backend == 'engine'
    assert load_simulator(saved, dtype='float32').backend == 'torch'
    with pytest.raises(ValueError, match="'engine', which has no float32; take 'torch'"):
        load_simulator(saved, dtype='float32', backend='engine')
    with pytest.raises(ValueError, match="backend is 'cuda', allowed: engine, torch"):
        load_simulator(saved, backend='cuda')


def test_materials_beyond_the_training_are_said(saved):
    simulator = load_simulator(saved)
    with pytest.warns(UserWarning, match="restitution of the scene is 0.9.*model 'own' was"):
        simulator.rollout(Scene(restitution=0.9), [[0.0, 0, 3]], steps=1)
