# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Experiments on data, scenes and variants of one's own: found, named, or refused in time."""

from __future__ import annotations

from dataclasses import replace
import json
from pathlib import Path

import pytest
from rigid_gns_core.commands.cli import main
from rigid_gns_core.data.records import DatasetError, read_record
from rigid_gns_core.files.config import ConfigError, find_config, load_yaml
from rigid_gns_core.running.workers import Workers
from rigid_gns_core.studies.thesis.budget import Data, load_budget
from rigid_gns_core.studies.thesis.cell import Cell, Store
from rigid_gns_core.studies.thesis.data_sets import make_sets, ood_path, references
from rigid_gns_core.studies.thesis.experiments import Experiment, Variant
import yaml

SMOKE = load_budget('smoke')
SCENE = {
    'scene': {'surfaces': [{'point': [0, 0, 0], 'normal': [0, 0, 1]}], 'radius': 0.25},
    'start': {'at': [[0, 0, 1.0], [2, 0, 1.5]]},
}


def own(folder: Path, scene: Path | str, **changes: object) -> Path:
    """Write the smallest budget with that as its one unseen scene."""
    budget = load_yaml(find_config('budgets', 'smoke'))
    budget['data'] |= {'ood': [str(scene)], **changes}
    path = folder / 'own.yaml'
    path.write_text(yaml.safe_dump(budget))
    return path


def write_scene(folder: Path, scene: dict = SCENE) -> Path:
    path = folder / 'mine.yaml'
    path.write_text(yaml.safe_dump(scene))
    return path


def test_an_own_scene_of_another_size_gets_its_own_time_step(tmp_path: Path) -> None:
    pytest.importorskip('pybullet', reason='experiments make their own data')
    pytest.importorskip('torch', reason='experiments train')
    budget = own(tmp_path, write_scene(tmp_path))
    folders = [f'--{name}={tmp_path / "made" / name}' for name in ('data', 'runs', 'out')]
    words = ['experiment', 'stability', '--budget', str(budget), '--workers', '1', *folders]
    assert main(words) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ['made', 'mine.yaml', 'own.yaml']
    (record,) = references(load_budget(budget), tmp_path / 'made' / 'data', 'ood')
    assert record.trajectory.dt == pytest.approx(0.05)  # 0.1 s at a radius of 1 m
    (cell,) = (tmp_path / 'made' / 'out' / 'own' / 'cells').glob('train_*')
    text = cell.read_text()
    assert str(tmp_path) not in text
    assert json.loads(text)['budget']['data']['ood'] == ['mine']
    assert set(json.loads(text)['measures']['ood']) == {'records', 'spheres', '8', '12'}


def test_another_start_than_that_of_the_file_is_named(tmp_path: Path) -> None:
    pytest.importorskip('pybullet', reason='references are of Bullet')
    budget = load_budget(own(tmp_path, write_scene(tmp_path)))
    make_sets(budget, tmp_path / 'data', ['teacher'], Workers(1))
    make_sets(budget, tmp_path / 'data', ['teacher'], Workers(1))  # it is there
    start = {'at': [*SCENE['start']['at'], [4, 0, 1.0]]}
    write_scene(tmp_path, {**SCENE, 'start': start})
    with pytest.raises(DatasetError, match=r'mine.h5: start is another, .* remove the file'):
        make_sets(budget, tmp_path / 'data', ['teacher'], Workers(1))
    write_scene(tmp_path, {**SCENE, 'scene': {**SCENE['scene'], 'friction': 0.1}})
    with pytest.raises(DatasetError, match='scene is another'):
        make_sets(budget, tmp_path / 'data', ['teacher'], Workers(1))
    path = ood_path(tmp_path / 'data', str(tmp_path / 'mine.yaml'))
    assert read_record(path).trajectory.count == 2, 'what is there stays'


def test_a_budget_may_have_no_unseen_scenes(tmp_path: Path) -> None:
    pytest.importorskip('pybullet', reason='experiments make their own data')
    pytest.importorskip('torch', reason='experiments train')
    budget = own(tmp_path, '', ood=[])
    folders = [f'--{name}={tmp_path / name}' for name in ('data', 'runs', 'out')]
    words = ['experiment', 'stability', '--budget', str(budget), '--workers', '1', *folders]
    assert main(words) == 0
    table = json.loads((tmp_path / 'out' / 'own' / 'stability.json').read_text())
    assert list(table['rows'][0]['sets']) == ['test']


def test_references_are_as_long_as_rollouts(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r'data.ood_steps is 12, expected at least 20'):
        replace(SMOKE, long_steps=20)
    budget = replace(SMOKE, long_steps=20, data=replace(SMOKE.data, ood_steps=20))
    with pytest.raises(DatasetError, match='trajectories of 12 steps, but rollouts .* up to 20'):
        make_sets(budget, tmp_path, ['speed'], Workers(1))
    assert not list(tmp_path.iterdir())


def test_two_files_of_one_name_are_refused() -> None:
    with pytest.raises(ConfigError, match=r'data names a/set.yaml and b/set.yaml, .*; rename'):
        Data(train='a/set.yaml', test='b/set.yaml', half='half', twice='twice')
    with pytest.raises(ConfigError, match=r'both be called ood_a'):
        replace(SMOKE.data, ood=('ood_a', 'mine/ood_a.yaml'))
    assert replace(SMOKE.data, ood=('mine/one.v2.yaml',)).named.ood == ('one.v2',)


@pytest.mark.parametrize('damage', ['', '{"key": "', '[]', '{}', '{"key": "of another"}'])
def test_a_damaged_cell_is_named_with_what_to_do(tmp_path: Path, damage: str) -> None:
    store, cell = Store(tmp_path), Cell('train', 'base', 0, SMOKE)
    path = store.write(cell, {})
    assert store.read(cell) is not None
    path.write_text(damage)
    with pytest.raises(ConfigError, match=rf'{path.name}: damaged .* remove it, and the same'):
        store.read(cell)


def test_mistakes_in_an_own_experiment_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(ConfigError, match="'lr/2': a name is a part of file names"):
        Variant('lr/2', 'half', {'rotate': False})
    with pytest.raises(ConfigError, match=r'thesis.tset of base: unknown set, allowed: test, ood'):
        Variant('base', 'base', thesis={'tset': {'mse': 1.0}})
    with pytest.raises(ConfigError, match="'train': the teacher is measured on a set"):
        Experiment('', '', '', (Variant('train', ''),), kind='teacher')
    path = tmp_path / 'mine.yaml'
    variants = [{'name': 'base', 'label': 'base'}]
    mine = {'title': '', 'source': '', 'claim': '', 'metrics': ['chamfr'], 'variants': variants}
    path.write_text(yaml.safe_dump(mine))
    assert main(['experiment', str(path)]) == 2
    error = capsys.readouterr().err
    assert "unknown metric 'chamfr', allowed: energy_gain" in error and 'chamfer' in error


def test_a_figure_of_another_table_goes(tmp_path: Path) -> None:
    out = tmp_path / 'smoke'
    out.mkdir()
    figure = out / 'history.png'
    figure.write_bytes(b'of cells that are gone')
    words = ['experiment', 'history', '--budget', 'smoke', '--no-run', '--out', str(tmp_path)]
    assert main(words) == 0
    assert not figure.exists() and (out / 'history.json').is_file()
