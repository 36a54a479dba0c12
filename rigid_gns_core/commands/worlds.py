# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns experiment worlds`: networks learn worlds that the laws do not know."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from functools import partial
import json
from pathlib import Path
from typing import Any, TYPE_CHECKING

from ..errors import UserError
from ..files.atomic_file import whole_file

if TYPE_CHECKING:
    from ..studies.real_balls.recorded_sets import RecordedSet
    from ..studies.worlds.study import WorldsBudget

NAME, WORLDS = 'worlds', ('soft', 'granular', 'bullet')
TITLE = 'Laws, residual network and GNS on worlds that the laws do not know (docs/residual.md)'
RUNS = Path('runs/worlds')


def run_worlds(arguments: argparse.Namespace) -> int:
    """Run the study with the options of `rigid-gns experiment`; the exit code."""
    import torch

    from ..studies.real_balls.recorded_sets import find_sets
    from ..studies.worlds.study import load_worlds_budget
    from ..studies.worlds.table import draw_world, format_world

    torch.set_num_threads(1)
    budget = load_worlds_budget(arguments.budget)
    runs = (arguments.runs or RUNS) / Path(arguments.budget).stem
    studies: dict[str, Callable[[int], list[dict[str, Any]]]]
    if arguments.recordings is None:
        studies = {
            name: partial(_simulated, name, budget, runs) for name in _chosen(arguments.only)
        }
    else:
        sets = find_sets(arguments.recordings, arguments.only)
        studies = {one.name: partial(_recorded, one, budget, runs) for one in sets}
    out = arguments.out or runs
    file = out / 'worlds.json'
    results: list[dict[str, Any]] = json.loads(file.read_text()) if file.is_file() else []
    out.mkdir(parents=True, exist_ok=True)
    for name, study in studies.items():
        seeds = () if arguments.no_run else dict.fromkeys(arguments.seeds or budget.seeds)
        for seed in seeds:
            for found in study(seed):
                same = [one for one in results if _of(one) == _of(found)]
                results = [one for one in results if one not in same] + [found]
            with whole_file(file) as unfinished:
                unfinished.write_text(json.dumps(results, indent=1) + '\n', encoding='utf-8')
        done: dict[str, list[dict[str, Any]]] = {}
        for one in results:
            if one.get('set', one['world']) == name:
                done.setdefault(one['world'], []).append(one)
        if not done:
            raise UserError(f'{file} has no results of world {name!r}; leave --no-run out')
        for world, of_seeds in done.items():
            figure = out / f'world_{world}.png'
            draw_world(world, of_seeds, figure)
            print(f'{format_world(world, of_seeds)}\nfigure:  {figure}\n')
    print(f'numbers: {file}')
    return 0


def _simulated(name: str, budget: WorldsBudget, runs: Path, seed: int) -> list[dict[str, Any]]:
    from ..studies.worlds.study import run_world

    return [run_world(name, seed, budget, runs / f'{name}_{seed}')]


def _recorded(
    one: RecordedSet, budget: WorldsBudget, runs: Path, seed: int
) -> list[dict[str, Any]]:
    from ..studies.worlds.recordings import run_recorded

    return run_recorded(one, seed, budget, runs / f'{one.name}_{seed}')


def _chosen(only: Sequence[str] | None) -> tuple[str, ...]:
    names = tuple(dict.fromkeys(only or WORLDS))
    if unknown := [name for name in names if name not in WORLDS]:
        raise UserError(f'there is no world {unknown[0]!r}, allowed: {", ".join(WORLDS)}')
    return names


def _of(result: dict[str, Any]) -> tuple[str, int]:
    return result['world'], result['seed']
