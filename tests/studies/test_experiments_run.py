# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns experiment` from beginning to end at the smallest budget."""

from __future__ import annotations

import json
from pathlib import Path
import shutil

import pytest
from rigid_gns_core.commands.cli import main
from rigid_gns_core.studies.thesis.budget import load_budget
from rigid_gns_core.studies.thesis.cell import Cell, Store
from rigid_gns_core.studies.thesis.data_sets import training_set
from rigid_gns_core.studies.thesis.experiments import shipped_experiments
from rigid_gns_core.studies.thesis.runner import run_cell

pytest.importorskip('pybullet', reason='experiments make their own data')
torch = pytest.importorskip('torch', reason='experiments train')
BUDGET = load_budget('smoke')


def command(folder: Path, *words: str) -> list[str]:
    folders = [f'--{name}={folder / name}' for name in ('data', 'runs', 'out')]
    return ['experiment', *words, '--budget', 'smoke', '--workers', '1', *folders]


@pytest.fixture(scope='module')
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder in which all experiments have run."""
    folder = tmp_path_factory.mktemp('experiments')
    assert main(command(folder, 'all')) == 0
    return folder


def test_all_experiments_give_table_and_figure(done: Path) -> None:
    out = done / 'out' / 'smoke'
    for name, experiment in shipped_experiments().items():
        table = json.loads((out / f'{name}.json').read_text())
        assert [row['variant'] for row in table['rows']] == [v.name for v in experiment.variants]
        assert not any(row['missing'] for row in table['rows'])
        assert table['budget']['words'] == BUDGET.words
        assert (out / f'{name}.png').read_bytes().startswith(b'\x89PNG')


def test_results_name_no_place_and_all_that_made_them(done: Path) -> None:
    cells = sorted((done / 'out' / 'smoke' / 'cells').glob('*.json'))
    for path in cells:
        text = path.read_text()
        assert str(done) not in text and str(Path.home()) not in text.replace('"/"', '')
        cell = json.loads(text)
        assert {'commit', 'versions', 'seed', 'config', 'seconds', 'key'} <= set(cell)
    trained = next(path for path in cells if path.name.startswith('train_base_0'))
    cell = json.loads(trained.read_text())
    assert cell['config']['model']['width'] == 4 and len(cell['training']['data_sha256']) == 64
    assert set(cell['measures']['test']) == {'records', 'spheres', '8', '12'}


def test_what_has_run_does_not_run_again(done: Path, tmp_path: Path) -> None:
    """Neither in the same experiment, nor in another one; what is missing comes out the same."""
    shutil.copytree(done, tmp_path / 'copy')
    cells = tmp_path / 'copy' / 'out' / 'smoke' / 'cells'
    shutil.rmtree(tmp_path / 'copy' / 'runs')
    lost = next(cells.glob('train_h_1_0_*.json'))
    before = {path: path.stat().st_mtime_ns for path in cells.iterdir() if path != lost}
    old = json.loads(lost.read_text())
    lost.unlink()
    assert main(command(tmp_path / 'copy', 'history')) == 0
    assert {path: path.stat().st_mtime_ns for path in cells.iterdir() if path != lost} == before
    assert [path.name for path in (tmp_path / 'copy' / 'runs').iterdir()] == [old['training_key']]
    assert json.loads(lost.read_text())['measures'] == old['measures']


def test_tables_are_made_of_what_is_there(done: Path, tmp_path: Path) -> None:
    cells = done / 'out' / 'smoke' / 'cells'
    shutil.copytree(cells, tmp_path / 'out' / 'smoke' / 'cells')
    next((tmp_path / 'out' / 'smoke' / 'cells').glob('train_h_1_0_*.json')).unlink()
    assert main([*command(tmp_path, 'history'), '--no-run']) == 0
    table = json.loads((tmp_path / 'out' / 'smoke' / 'history.json').read_text())
    missing = {row['variant']: row['missing'] for row in table['rows']}
    assert missing == {'h_0': [], 'h_1': [0], 'base': [], 'h_3': [], 'h_4': []}
    assert not (tmp_path / 'runs').exists() and not (tmp_path / 'data').exists()


def test_a_cell_that_was_stopped_goes_on(done: Path, tmp_path: Path) -> None:
    from rigid_gns_core.training.train import Trainer

    cell = Cell('train', 'base', 0, BUDGET)
    store = Store(tmp_path / 'cells')
    _, whole = run_cell(cell, done / 'data', tmp_path / 'whole')
    records = training_set(BUDGET, done / 'data')
    folder = tmp_path / 'parts' / cell.training_key
    trainer = Trainer(BUDGET.training({}, 0), records, [], folder, BUDGET.data.train)
    trainer.run(stop_at=2)
    store.write(*run_cell(cell, done / 'data', tmp_path / 'parts', quiet=True))
    parts = store.read(cell)
    assert parts is not None
    # the wall time of what was stopped is not known: tables leave it out
    assert parts['seconds']['resumed_at_step'] == 2
    assert whole['seconds']['resumed_at_step'] == 0
    store.write(cell, whole)
    assert parts['measures'] == (store.read(cell) or {})['measures']
    assert 'step 3: loss' in (folder / 'output.txt').read_text()


def test_a_failing_cell_does_not_stop_the_others(
    done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = tmp_path / 'wrong.yaml'
    wrong.write_text(
        'title: Too long\nsource: none\nclaim: none\nvariants:\n'
        '  - {name: endless, label: endless, changes: {closed_loop_steps: 99}}\n'
        '  - {name: base, label: base}\n'
    )
    shutil.copytree(done / 'data', tmp_path / 'data')
    assert main(command(tmp_path, str(wrong))) == 1
    output = capsys.readouterr()
    failed = 'UserError: no training trajectory has 99 steps'
    assert f'failed: endless, seed 0: rigid_gns_core.errors.{failed}' in output.out
    assert 'Not run yet: endless.' in output.out


def test_another_recipe_in_the_data_folder_is_named(
    done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = tmp_path / 'data' / 'experiment_smoke_test'
    shutil.copytree(done / 'data' / 'experiment_smoke', data)
    assert main(command(tmp_path, 'ground_truth')) == 2
    assert 'seed: 0 in the folder, 1 now' in capsys.readouterr().err


def test_the_page_is_filled(done: Path, tmp_path: Path) -> None:
    page = tmp_path / 'thesis.md'
    page.write_text(
        'Before.\n<!-- experiment: history -->\nold\n<!-- end -->\nAfter.\n'
        '<!-- experiment: speed -->\n<!-- end -->\n'
    )
    shutil.copytree(done / 'out', tmp_path / 'out')
    (tmp_path / 'out' / 'smoke' / 'speed.json').unlink()
    words = ['experiment', '--budget', 'smoke', '--out', str(tmp_path / 'out')]
    assert main([*words, '--page', str(page)]) == 0
    text = page.read_text()
    assert text.startswith('Before.\n<!-- experiment: history -->\n') and 'After.' in text
    assert 'old' not in text and '![How many previous velocities' in text
    assert '(out/smoke/history.png)' in text
    assert 'Not run yet: `rigid-gns experiment speed --budget smoke`.' in text
    page.write_text('<!-- experiment: nothing -->\n<!-- end -->\n')
    assert main([*words, '--page', str(page)]) == 2
