# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Experiments as they are configured: what a cell is, and what tables make of results."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rigid_gns_core.commands.cli import main
from rigid_gns_core.files.config import ConfigError
from rigid_gns_core.files.strict_json import read_json, write_compact_json
from rigid_gns_core.studies.thesis.aggregate import make_table
from rigid_gns_core.studies.thesis.budget import Budget, load_budget, merged
from rigid_gns_core.studies.thesis.cell import Cell, cells_of, Store, teacher_cells
from rigid_gns_core.studies.thesis.chart import write_chart
from rigid_gns_core.studies.thesis.experiments import (
    Experiment,
    load_experiment,
    shipped_experiments,
    Variant,
)
from rigid_gns_core.studies.thesis.panels import panels_of
from rigid_gns_core.studies.thesis.tables import format_table, printed, spread

pytest.importorskip('pybullet', reason="a cell's key holds the teacher's defaults")
BUDGET = load_budget('cpu')
BASE = Cell('train', 'base', 0, BUDGET)
KEPT = Path(__file__).parents[2] / 'docs' / 'thesis' / 'cpu' / 'cells'


@pytest.mark.parametrize('budget', ['smoke', 'cpu', 'full'])
def test_every_variant_of_every_experiment_is_a_valid_recipe(budget: str) -> None:
    loaded = load_budget(budget)
    names: dict[str, set[str]] = {}
    for experiment in shipped_experiments().values():
        for cell in cells_of(experiment, loaded, experiment.variants, [0]):
            names.setdefault(f'{cell.kind} {cell.name}', set()).add(cell.key)
    # the same name is the same cell in all experiments, and another name another cell
    keys = [key for found in names.values() for key in found]
    assert len(keys) == len(set(keys)) == len(names)


def test_the_thesis_numbers_are_the_same_in_all_experiments() -> None:
    found: dict[tuple[str, str, str], Any] = {}
    for experiment in shipped_experiments().values():
        for variant in experiment.variants:
            for which, values in variant.thesis.items():
                for metric, value in values.items():
                    known = found.setdefault((variant.name, which, metric), value)
                    assert value == known, (experiment.name, variant.name, metric)
    assert found['base', 'ood', 'chamfer'] == [1.25e6, 1.03e6]  # table 2


def test_a_key_is_of_what_determines_the_result_alone() -> None:
    same = [
        Cell('train', 'another_name', 0, BUDGET, {'model': {'history': 2}, 'rotate': True}),
        Cell('train', 'base', 0, replace(BUDGET, words='others', seeds=(5,), name='mine')),
    ]
    assert {replace(cell, changes={}).key for cell in same} == {BASE.key}
    other = [
        replace(BASE, seed=1),
        replace(BASE, changes={'model': {'history': 1}}),
        replace(BASE, budget=replace(BUDGET, steps=400)),
        replace(BASE, budget=replace(BUDGET, changes=merged(BUDGET.changes, {'batch': 11}))),
        replace(BASE, budget=replace(BUDGET, data=replace(BUDGET.data, train='gns_test'))),
    ]
    assert len({cell.key for cell in [BASE, *other]}) == 1 + len(other)


def test_unseen_scenes_and_the_base_are_rolled_out_for_longer() -> None:
    other = replace(BASE, changes={'rotate': False})
    assert (BASE.steps('test'), BASE.steps('ood')) == ((500, 2000), (500, 2000))
    assert (other.steps('test'), other.steps('ood')) == ((500,), (500, 2000))


def test_shorter_rollouts_are_another_cell_with_the_same_weights() -> None:
    other = replace(BASE, changes={'rotate': False})
    shorter = replace(other, budget=replace(BUDGET, long_steps=1500))
    assert shorter.key != other.key
    assert shorter.training_key == other.training_key
    seeds = [replace(other, seed=1), BASE]
    assert len({cell.training_key for cell in [other, *seeds]}) == 3


def test_a_closed_loop_costs_as_much_as_single_steps() -> None:
    assert BUDGET.training({'closed_loop_steps': 3}, 0).batch == BUDGET.training({}, 0).batch // 3
    assert load_budget('smoke').training({'closed_loop_steps': 4}, 0).batch == 1


def test_wrong_names_are_answered_with_the_right_ones(capsys: pytest.CaptureFixture[str]) -> None:
    for options, message in (
        (['nothing'], 'ablation, connectivity, ground_truth, history'),
        (['history', '--only', 'h_9'], "no variant 'h_9', allowed: h_0, h_1, base"),
        (['history', '--budget', 'huge'], 'shipped: cpu, full, smoke'),
        (['history', '--seeds', '-1'], '--seeds is -1'),
        ([], 'name an experiment, or all'),
    ):
        assert main(['experiment', *options]) == 2
        assert message in capsys.readouterr().err
    with pytest.raises(ConfigError, match=r"unknown key 'historie', allowed: message_passing"):
        BUDGET.training({'model': {'historie': 1}}, 0)


def test_the_list_has_a_line_for_each(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['experiment', '--list']) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == [*shipped_experiments(), 'worlds']
    assert lines[0].startswith('ground_truth') and 'table 1' in lines[0]


def test_a_variant_is_checked() -> None:
    with pytest.raises(ConfigError, match=r'YAML reads 1e6 as text'):
        Variant('base', 'base', thesis={'ood': {'mse': '1e6'}})
    with pytest.raises(ConfigError, match="the one without any is called 'base'"):
        Experiment('', '', '', (Variant('h_2', 'H = 2'),))
    with pytest.raises(ConfigError, match='each name once'):
        Experiment('', '', '', (Variant('base', 'a'), Variant('base', 'b')))


def fill(store: Store, cell: Cell, mse: list[Any], diverged: list[int | None]) -> None:
    """Results of a cell, on each set the same."""
    values = {
        'mse': mse,
        'energy_gain': [0.1, 0.3, 0.3][: len(mse)],
        'position_error_10': [1.0, 3.0, 3.0][: len(mse)],  # known, even of one that diverged later
        'diverged_at': diverged,
    }
    which = {'records': ['0'] * len(mse), 'spheres': [3] * len(mse), '500': values, '2000': values}
    measures = {'test': which, 'ood': which}
    training = {'failed': None, 'steps': 3000}
    store.write(cell, {'training': training, 'measures': measures, 'seconds': {'all': 60.0}})


def results(folder: Path) -> tuple[Experiment, Store]:
    """Return an experiment whose base ran with two seeds; with one a rollout diverged."""
    experiment, store = load_experiment('history'), Store(folder)
    floor = {'mse': [1.0, 4.0], 'least_mse': [0.25, 0.25]}
    for cell in teacher_cells(BUDGET):
        floors = {'records': ['0', '1'], 'spheres': [3, 3], '500': floor, '2000': floor}
        store.write(cell, {'floor': floors, 'laws': {}, 'seconds': {'all': 1.0}})
    fill(store, BASE, [2.0, 4.0], [None, None])
    fill(store, replace(BASE, seed=1), [6.0, float('inf')], [None, 123])
    return experiment, store


def test_divergence_is_counted_not_averaged(tmp_path: Path) -> None:
    experiment, store = results(tmp_path)
    table = make_table(experiment, BUDGET, (0, 1, 2), store)
    row = next(row for row in table['rows'] if row['variant'] == 'base')
    assert row['seeds'] == [0, 1] and row['missing'] == [2]
    score = row['sets']['ood']['500']
    assert (score['diverged'], score['rollouts']) == (1, 4)
    mse = score['metrics']['mse']
    # seeds have means 3 and 6 over their finite rollouts; std with n - 1
    assert mse == {'mean': 4.5, 'std': pytest.approx(4.5**0.5), 'seeds': 2, 'infinite': 1}
    # 2/1, 4/4 and 6/1: ratios of each rollout to its own floor
    assert score['metrics']['mse_ratio']['mean'] == pytest.approx((1.5 + 6.0) / 2)
    text = format_table(table)
    assert '1 of 4' in text and '4.5 ± 2.1' in text and '3.36e5 ± 3.1e5' in text
    assert ' thesis, 2000 steps: MSE |' in text
    assert 'Not run yet: H = 0, H = 1, H = 3, H = 4.' in text
    assert 'Not with all seeds yet: H = 2.' in text
    assert '2.5' in next(line for line in text.splitlines() if 'Bullet against itself' in line)


def test_a_diverged_rollout_is_in_all_medians_and_in_errors_before_it(tmp_path: Path) -> None:
    experiment, store = results(tmp_path)
    table = make_table(experiment, BUDGET, (0, 1), store)
    base = next(row for row in table['rows'] if row['variant'] == 'base')
    metrics = base['sets']['ood']['500']['metrics']
    infinite = {'mean': float('inf'), 'std': None, 'seeds': 2}
    # seeds have 3 and, with one of two diverged, infinity
    assert metrics['mse_median'] == metrics['mse_ratio_median'] == infinite
    assert metrics['energy_gain_median'] == {'mean': 0.2, 'std': 0.0, 'seeds': 2}
    assert metrics['position_error_10'] == {'mean': 2.0, 'std': 0.0, 'seeds': 2, 'infinite': 0}
    lines = format_table(table).splitlines()
    head = next(line.split('|') for line in lines if 'median MSE [m²]' in line)
    row = next(line.split('|') for line in lines if 'H = 2' in line)
    assert row[[cell.strip() for cell in head].index('median MSE [m²]')].strip() == 'inf'
    panel = next(p for p in panels_of(table) if p.which == 'ood' and p.metric == 'mse_median')
    assert not panel.points[2].finite and panel.limits == (0.0, 1.4 * 2.5)
    assert write_chart(tmp_path / 'history.png', table) is not None


def test_one_rollout_that_nearly_diverged_does_not_rank_a_variant(tmp_path: Path) -> None:
    """As the base did against M = 1, whose worst rollout diverged and so left the mean."""
    experiment, store = load_experiment('history'), Store(tmp_path)
    near, over = [[363.0, 431.0, worst] for worst in (92744.0, float('inf'))]
    fill(store, BASE, near, [None] * 3)
    fill(store, Cell('train', 'h_1', 0, BUDGET, {'model': {'history': 1}}), over, [None, None, 99])
    rows = make_table(experiment, BUDGET, (0,), store)['rows']
    metrics = [rows[place]['sets']['test']['500']['metrics'] for place in (1, 2)]
    assert [m['mse']['mean'] for m in metrics] == [397.0, pytest.approx(31179.3, rel=1e-5)]
    assert [m['mse_median']['mean'] for m in metrics] == [431.0, 431.0]


def test_the_cells_that_were_kept_are_found() -> None:
    """A changed key would train all of them again."""
    found = {
        cell.file_name
        for experiment in shipped_experiments().values()
        for cell in cells_of(experiment, BUDGET, experiment.variants, BUDGET.seeds)
    }
    kept = {path.name for path in KEPT.glob('*.json')}
    assert kept and kept <= found


def test_metrics_of_diverged_rollouts_are_as_documented() -> None:
    """In all cells that were kept: whole-rollout metrics are infinite, the others are not."""
    lost = 0
    for path in KEPT.glob('train_*.json'):
        for which in read_json(path)['measures'].values():
            for columns in (value for key, value in which.items() if key.isdecimal()):
                for index, step in enumerate(columns.pop('diverged_at')):
                    for name, values in columns.items() if step is not None else ():
                        early = name.startswith('predictab') or name == 'escaped'
                        early |= name[-1].isdecimal() and int(name.rsplit('_', 1)[1]) < step
                        assert values[index] is None or np.isfinite(values[index]) == early, name
                    lost += step is not None
    assert lost


def test_wall_times_are_of_whole_trainings(tmp_path: Path) -> None:
    experiment, store = load_experiment('history'), Store(tmp_path)
    fill(store, BASE, [1.0, 1.0], [None, None])  # a minute
    old = store.read(BASE)
    assert old is not None
    for seed, seconds in (
        (1, {'resumed_at_step': 8000, 'all': 6.0}),  # of before seconds were added up
        (2, {'resumed_at_step': 8000, 'counted_from_step': 62, 'all': 7.0}),
        (3, {'resumed_at_step': 8000, 'counted_from_step': 0, 'all': 240.0}),
    ):
        result = {key: old[key] for key in ('training', 'measures')}
        store.write(replace(BASE, seed=seed), {**result, 'seconds': seconds})
    table = make_table(experiment, BUDGET, (0, 1, 2, 3), store)
    assert table['rows'][2]['minutes'] == [1.0, 4.0]
    text = 'Wall time of a cell: 1 to 4 minutes, the median 2.5 (2 cells).'
    assert text in format_table(table)


def test_a_figure_shows_what_there_is(tmp_path: Path) -> None:
    experiment, store = results(tmp_path)
    table = make_table(experiment, BUDGET, (0, 1), store)
    panel = next(p for p in panels_of(table) if p.which == 'ood' and p.metric == 'mse_median')
    assert panel.floor == 2.5 and panel.points[2].lost == 1
    assert not panel.bounded
    table['floor']['ood']['2000']['mse_median'] = 0.1
    panel = next(p for p in panels_of(table) if p.which == 'ood' and p.metric == 'mse_median')
    assert panel.floor == 0.25 and panel.bounded, 'half a radius counts where it is more'
    assert panel.limits[1] < 100, 'numbers of the thesis that are far off do not set the scale'
    path = write_chart(tmp_path / 'history.png', table)
    assert path is not None and path.read_bytes().startswith(b'\x89PNG')
    nothing = make_table(experiment, replace(BUDGET, steps=7), (0,), store)
    assert write_chart(tmp_path / 'nothing.png', nothing) is None


def test_a_variant_that_cannot_be_trained_is_marked(tmp_path: Path) -> None:
    experiment, store = results(tmp_path)
    cell = Cell('train', 'h_1', 0, BUDGET, {'model': {'history': 1}})
    training = {'failed': 'the loss is nan at step 7', 'steps': 7}
    store.write(cell, {'training': training, 'measures': {}, 'seconds': {'all': 1.0}})
    text = format_table(make_table(experiment, BUDGET, (0,), store))
    assert 'H = 1: the loss did not stay finite with any seed.' in text


def test_frames_per_second_are_of_all_frames_together(tmp_path: Path) -> None:
    """A mean of rates would be ruled by the trajectory with the fewest spheres."""
    experiment, store = load_experiment('speed'), Store(tmp_path)
    seconds = [0.001, 0.009]
    values = {'seconds_per_frame': seconds, 'frames_per_second': [1 / one for one in seconds]}
    values |= {'edges': [2.0, 4.0], 'surface_edges': [1.0, 3.0]}
    result = {'spheres': [1, 9], 'cpu': 'one', 'values': values, 'seconds': {'all': 1.0}}
    store.write(Cell('speed', 'base', 0, BUDGET), result)
    table = make_table(experiment, BUDGET, (0,), store)
    assert ' 200 |' in format_table(table)
    (panel,) = panels_of(table)
    assert panel.points[0].mean == pytest.approx(200.0)


def test_json_is_strict_and_short(tmp_path: Path) -> None:
    path = tmp_path / 'one.json'
    report = {'a': [1.23456789, np.float32('inf'), None], 'b': {'c': 1}, 'd': [{'e': 2}]}
    write_compact_json(path, report, digits=6)
    assert len(path.read_text().splitlines()) == 11
    assert read_json(path) == {'a': [1.23457, float('inf'), None], 'b': {'c': 1}, 'd': [{'e': 2}]}
    with pytest.raises(ValueError, match='Out of range float'):
        write_compact_json(path, {'a': float('nan')}, digits=6)


def test_what_diverged_and_what_the_thesis_prints() -> None:
    assert spread(None, None) == 'diverged' and spread(2.0, 0.25) == '2 ± 0.25'
    assert [printed(v) for v in (None, 'diverged', 40, [1.0, 2.0])] == [
        '',
        'diverged',
        '40',
        '1 ± 2',
    ]


def test_a_budget_is_checked() -> None:
    with pytest.raises(ConfigError, match='long_steps is 10, expected at least 500'):
        replace(BUDGET, long_steps=10)
    with pytest.raises(ConfigError, match='seeds is'):
        Budget('words', (), BUDGET.data)
