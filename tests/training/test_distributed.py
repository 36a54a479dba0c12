# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Training by two processes: the gradients of one, one log, one set of checkpoints, and resume."""

from dataclasses import replace
import importlib.util
import json
import os
from pathlib import Path
import subprocess
import sys

import pytest
from rigid_gns_core.commands.cli import main
from rigid_gns_core.data.recipe import DataRecipe, recipe_hash
from rigid_gns_core.data.records import Dataset, Record, record_path, write_recipe, write_record
from rigid_gns_core.files.config import to_mapping
from rigid_gns_core.training.distributed import find_device, Mean, Processes
from rigid_gns_core.training.train import Trainer
from safetensors.torch import load_file
import torch
import yaml

ROOT = Path(__file__).resolve().parents[2]
WORKER = Path(__file__).with_name('distributed_worker.py')


@pytest.fixture(scope='module')
def worker():
    spec = importlib.util.spec_from_file_location('distributed_worker', WORKER)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def torchrun(*arguments):
    command = [sys.executable, '-m', 'torch.distributed.run', '--nproc_per_node=2', '--standalone']
    environment = {**os.environ, 'OMP_NUM_THREADS': '1'}
    done = subprocess.run(
        [*command, *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env=environment,
        check=False,
    )
    return done.returncode, done.stdout + done.stderr


@pytest.mark.slow
def test_two_processes_have_the_gradients_of_one(tmp_path, worker):
    code, output = torchrun(WORKER, tmp_path)
    assert code == 0, output
    shares = [load_file(tmp_path / f'{rank}.safetensors') for rank in (0, 1)]
    alone = worker.gradients()
    assert {*alone, 'stops'} == set(shares[0]) == set(shares[1])
    for share in shares:
        assert share['stops'].tolist() == [True, False]  # a signal to one stops both
    for name, expected in alone.items():
        kind = name.split('.')[0]
        gradients = [value for key, value in alone.items() if key.startswith(kind)]
        scale = max(gradient.abs().max().item() for gradient in gradients)
        for share in shares:
            # float32 sums in another order: some ten roundings of 6e-8 of the largest gradient
            assert (share[name] - expected).abs().max().item() <= 2e-6 * scale, name
        assert torch.equal(shares[0][name], shares[1][name])


@pytest.mark.slow
def test_a_run_of_one_process_goes_on_with_two(tmp_path, worker):
    data = DataRecipe(trajectories=3, seed=0, steps=8)
    (tmp_path / 'data').mkdir()
    write_recipe(tmp_path / 'data', data)
    for index, count in enumerate((2, 7, 25)):
        record = Record(
            trajectory=worker.flying(count),
            scene=worker.SCENE,
            seed=0,
            index=index,
            recipe=recipe_hash(data),
        )
        write_record(record_path(tmp_path / 'data', index), record)
    config = replace(worker.GNS, steps=6, validate_every=3, validation_steps=4, average=0.9)
    recipe = tmp_path / 'recipe.yaml'
    recipe.write_text(yaml.safe_dump({'kind': 'gns', **to_mapping(config)}))
    options = ['--config', recipe, '--data', tmp_path / 'data', '--validation', tmp_path / 'data']
    train = ['train', *map(str, options), '--device', 'cpu']
    assert main([*train, '--out', str(tmp_path / 'alone')]) == 0
    records = list(Dataset(tmp_path / 'data'))
    Trainer(config, records, records, tmp_path / 'both', 'data').run(stop_at=3)

    code, output = torchrun(
        '-m', 'rigid_gns_core.commands.cli', *train, '--out', tmp_path / 'both'
    )
    assert code == 0, output
    assert output.count('step 6: loss') == output.count('weights: ') == 1  # the first one speaks
    logs = [
        [json.loads(line) for line in (tmp_path / name / 'log.jsonl').read_text().splitlines()]
        for name in ('alone', 'both')
    ]
    assert [entry['step'] for entry in logs[1]] == [3, 6]
    assert logs[0][0] == logs[1][0]
    for key in ('loss', 'validation'):
        # float32 sums in another order, through three steps of Adam and four of a rollout
        assert logs[1][1][key] == pytest.approx(logs[0][1][key], rel=1e-3)
    cards = [json.loads((tmp_path / name / 'best.json').read_text()) for name in ('alone', 'both')]
    assert cards[0]['training'] == cards[1]['training']


def test_a_single_process_does_all_work():
    processes = Processes()
    items = [1, 2, 3]
    assert processes.share(items) is items
    assert processes.first
    assert processes.sum(2.5) == 2.5
    value = torch.tensor(1.5)
    assert processes.fair(Mean(value, 7)) is value


def test_absent_devices_are_named(monkeypatch):
    monkeypatch.setattr(torch.cuda, 'is_available', lambda: False)
    assert find_device('auto') == find_device('cpu') == torch.device('cpu')
    with pytest.raises(ValueError, match='device is cuda, but torch finds no CUDA device'):
        find_device('cuda')
    monkeypatch.setattr(torch.cuda, 'is_available', lambda: True)
    monkeypatch.setattr(torch.cuda, 'device_count', lambda: 1)
    assert find_device('auto') == torch.device('cuda', 0)
    monkeypatch.setenv('LOCAL_RANK', '1')
    with pytest.raises(
        ValueError, match='process 1 of this machine has no CUDA device, there are 1'
    ):
        find_device('cuda')
