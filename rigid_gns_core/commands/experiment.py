# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns experiment`: runs experiments and writes their tables and figures.

Those of the thesis, and `worlds`, which is no study of variants and has a module of its own.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys

from . import worlds
from .arguments import add_worker_arguments, chosen_workers, completes, configs
from ..errors import UserError
from ..files.config import ConfigError
from ..files.strict_json import write_compact_json
from ..running.interrupt import end_on_sigterm
from ..studies.thesis.aggregate import make_table
from ..studies.thesis.budget import Budget, load_budget
from ..studies.thesis.cell import Cell, cells_of, DIGITS, Store
from ..studies.thesis.chart import write_chart
from ..studies.thesis.experiments import Experiment, load_experiment, shipped_experiments
from ..studies.thesis.metrics import METRICS
from ..studies.thesis.runner import Folders, run_cells
from ..studies.thesis.tables import format_table, write_page

RUNS, OUT = Path('runs/thesis'), Path('docs/thesis')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `rigid-gns experiment`."""
    names = parser.add_argument(
        'names',
        nargs='*',
        metavar='NAME',
        help='experiments of the thesis: shipped names, YAML files, or all; or worlds',
    )
    parser.add_argument('--list', action='store_true', help='list all experiments and stop')
    budget = parser.add_argument(
        '--budget',
        default='cpu',
        metavar='NAME',
        help='cpu (default), smoke, full, or a YAML file',
    )
    completes(names, lambda: [*configs('experiments')(), 'all', worlds.NAME])
    completes(budget, configs('budgets'))
    parser.add_argument('--seeds', type=int, nargs='+', help="seeds instead of the budget's")
    parser.add_argument(
        '--only', nargs='+', metavar='VARIANT', help='only these variants, or worlds'
    )
    parser.add_argument(
        '--data', type=Path, default=Path('data'), help='data sets, generated if absent (data)'
    )
    parser.add_argument('--runs', type=Path, help=f'checkpoints ({RUNS}, of worlds {worlds.RUNS})')
    parser.add_argument('--out', type=Path, help=f'results ({OUT}, of worlds --runs)')
    parser.add_argument(
        '--no-run', action='store_true', help='only write tables and figures, of finished cells'
    )
    parser.add_argument(
        '--page',
        type=Path,
        metavar='MD',
        nargs='?',
        const=Path('docs/thesis.md'),
        help='only fill the tables of this page (docs/thesis.md) from --out',
    )
    parser.add_argument(
        '--recordings',
        type=Path,
        metavar='DIR',
        help='of worlds: recordings as `rigid-gns benchmark recordings` takes them, instead of '
        'simulated worlds; --only names sets',
    )
    add_worker_arguments(parser)
    parser.epilog = (
        'examples:\n'
        '  rigid-gns experiment --list\n'
        '  rigid-gns experiment history --budget smoke --out smoke\n'
        '  rigid-gns experiment ablation --only base no_noise --workers 2\n'
        '  rigid-gns experiment worlds --only soft --seeds 0\n'
        '  rigid-gns experiment all --backend dask --scheduler tcp://host:8786\n\n'
        'A run that was stopped resumes when the same command is given again. A variant of '
        'several\nexperiments is trained once.'
    )


def run(arguments: argparse.Namespace) -> int:
    """Run `rigid-gns experiment`; the exit code, 1 where a cell failed."""
    if arguments.list:
        for name, experiment in shipped_experiments().items():
            print(f'{name:16} {experiment.title} ({experiment.source})')
        print(f'{worlds.NAME:16} {worlds.TITLE}')
        return 0
    if worlds.NAME in arguments.names:
        if arguments.names != [worlds.NAME]:
            raise UserError(f'{worlds.NAME} has a budget and a table of its own; run it alone')
        return worlds.run_worlds(arguments)
    budget = load_budget(arguments.budget)
    out = (arguments.out or OUT) / budget.name
    if arguments.page is not None:
        write_page(arguments.page, out)
        print(f'page: {arguments.page}')
        return 0
    experiments = _chosen(arguments.names)
    seeds = tuple(dict.fromkeys(arguments.seeds or budget.seeds))
    for one in seeds:
        if not 0 <= one < 2**63:
            raise UserError(f'--seeds is {one}, expected whole numbers from 0 to {2**63 - 1}')
    chosen = {e.name: e.only(arguments.only) for e in experiments}
    cells = {
        cell.key: cell for e in experiments for cell in cells_of(e, budget, chosen[e.name], seeds)
    }
    # all variants with the first seed before any with the next
    order = sorted(cells.values(), key=lambda cell: (cell.kind != 'teacher', cell.seed))
    folders = Folders(arguments.data, arguments.runs or RUNS, out)
    store = Store(out / 'cells')
    failed = [] if arguments.no_run else _run_cells(order, budget, folders, store, arguments)
    for experiment in experiments:
        table = make_table(experiment, budget, seeds, store)
        write_compact_json(out / f'{experiment.name}.json', table, DIGITS)
        chart = out / f'{experiment.name}.png'
        figure = write_chart(chart, table)
        print(f'{experiment.title}\n{budget.words}\n\n{format_table(table)}')
        print(f'numbers: {out / experiment.name}.json')
        if figure is not None:
            print(f'figure:  {figure}')
        else:
            chart.unlink(missing_ok=True)  # an outdated one
        print()
    for line in failed:
        print(f'failed: {line}')
    return int(bool(failed))


def _run_cells(
    cells: list[Cell],
    budget: Budget,
    folders: Folders,
    store: Store,
    arguments: argparse.Namespace,
) -> list[str]:
    """Run the cells; a line for each that failed."""
    try:
        with end_on_sigterm():
            return run_cells(cells, budget, folders, store, chosen_workers(arguments))
    except KeyboardInterrupt:
        done = sum(store.find(cell) is not None for cell in cells)
        print(
            f'\nstopped: {done} of {len(cells)} cells are done in {store.folder}; give the same '
            'command again to go on',
            file=sys.stderr,
        )
        raise


def _chosen(names: list[str]) -> list[Experiment]:
    if not names:
        known = ', '.join([*shipped_experiments(), worlds.NAME])
        raise UserError(f'name an experiment, or all; allowed: {known}')
    if names == ['all']:
        return list(shipped_experiments().values())
    experiments = [load_experiment(name) for name in dict.fromkeys(names)]
    for experiment in experiments:
        known = METRICS[experiment.kind]
        for metric in experiment.metrics:
            if metric not in known:
                raise ConfigError(
                    f'experiment {experiment.name}: unknown metric {metric!r}, allowed: '
                    f'{", ".join(known)}'
                )
    return experiments
