# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns worlds`: a residual network learns worlds that the laws do not know."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import json
from pathlib import Path
from typing import Any

import numpy as np

from .arguments import completes, configs, positive
from ..files.atomic_file import whole_file
from ..files.tables import format_rows

WORLDS = ('soft', 'granular', 'bullet')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `rigid-gns worlds`."""
    parser.add_argument(
        'names', nargs='+', choices=WORLDS, metavar='WORLD', help=', '.join(WORLDS)
    )
    budget = parser.add_argument(
        '--budget', default='cpu', metavar='NAME', help='cpu (default), smoke, or a YAML file'
    )
    completes(budget, configs('worlds'))
    parser.add_argument('--seeds', type=int, nargs='+', help="seeds instead of the budget's")
    parser.add_argument('--runs', type=Path, default=Path('runs/worlds'), help='trained weights')
    parser.add_argument(
        '--json', type=Path, metavar='FILE', help='add the results to those in this file'
    )
    parser.add_argument('--threads', type=positive, default=1, help='CPU threads (default 1)')
    parser.epilog = 'example:\n  rigid-gns worlds soft --budget cpu --json worlds.json'


def run(arguments: argparse.Namespace) -> int:
    """Run `rigid-gns worlds`; the exit code."""
    import torch

    from ..studies.worlds.study import load_worlds_budget, run_world

    torch.set_num_threads(arguments.threads)
    budget = load_worlds_budget(arguments.budget)
    results = _known(arguments.json)
    for world in arguments.names:
        for seed in arguments.seeds or budget.seeds:
            folder = arguments.runs / f'{world}_{seed}'
            found = run_world(world, seed, budget, folder)
            same = [one for one in results if (one['world'], one['seed']) == (world, seed)]
            results = [one for one in results if one not in same] + [found]
            if arguments.json is not None:
                with whole_file(arguments.json) as partial:
                    partial.write_text(json.dumps(results, indent=1) + '\n', encoding='utf-8')
        print(format_world(world, [one for one in results if one['world'] == world]))
    return 0


def format_world(world: str, results: Sequence[dict[str, Any]]) -> str:
    """Table of a world: mean and standard deviation over its seeds.

    Args:
        world: Name of the world.
        results: Of `run_world`, one a seed.
    """
    horizons = list(results[0]['errors']['laws fitted'])
    rows = []
    for name in results[0]['errors']:
        cells = []
        for horizon in horizons:
            values = [100.0 * one['errors'][name][horizon] for one in results]
            cells.append(f'{np.mean(values):.2f} ± {np.std(values):.2f}')
        rows.append([name, *cells])
    head = ['mean position error [cm]', *(f'{horizon} s' for horizon in horizons)]
    speeds = {
        name: np.mean([one['frames_per_second'][name] for one in results])
        for name in results[0]['frames_per_second']
    }
    said = ', '.join(f'{name} {value:.0f}' for name, value in speeds.items())
    return f'world {world}, {len(results)} seeds\n{format_rows(head, rows)}\nframes/s: {said}'


def _known(path: Path | None) -> list[dict[str, Any]]:
    if path is None or not path.is_file():
        return []
    known: list[dict[str, Any]] = json.loads(path.read_text(encoding='utf-8'))
    return known
