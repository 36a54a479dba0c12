# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns experiment worlds`: networks learn worlds that the laws do not know."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from ..errors import UserError
from ..files.atomic_file import whole_file

NAME, WORLDS = 'worlds', ('soft', 'granular', 'bullet')
TITLE = 'Laws, residual network and GNS on worlds that the laws do not know (docs/residual.md)'
RUNS = Path('runs/worlds')


def run_worlds(arguments: argparse.Namespace) -> int:
    """Run the study with the options of `rigid-gns experiment`; the exit code."""
    import torch

    from ..studies.worlds.study import load_worlds_budget, run_world
    from ..studies.worlds.table import draw_world, format_world

    names = tuple(dict.fromkeys(arguments.only or WORLDS))
    if unknown := [name for name in names if name not in WORLDS]:
        raise UserError(f'there is no world {unknown[0]!r}, allowed: {", ".join(WORLDS)}')
    torch.set_num_threads(1)
    budget = load_worlds_budget(arguments.budget)
    runs = (arguments.runs or RUNS) / Path(arguments.budget).stem
    out = arguments.out or runs
    file = out / 'worlds.json'
    results: list[dict[str, Any]] = json.loads(file.read_text()) if file.is_file() else []
    out.mkdir(parents=True, exist_ok=True)
    for world in names:
        seeds = () if arguments.no_run else dict.fromkeys(arguments.seeds or budget.seeds)
        for seed in seeds:
            found = run_world(world, seed, budget, runs / f'{world}_{seed}')
            same = [one for one in results if (one['world'], one['seed']) == (world, seed)]
            results = [one for one in results if one not in same] + [found]
            with whole_file(file) as partial:
                partial.write_text(json.dumps(results, indent=1) + '\n', encoding='utf-8')
        done = [one for one in results if one['world'] == world]
        if not done:
            raise UserError(f'{file} has no results of world {world!r}; leave --no-run out')
        figure = out / f'world_{world}.png'
        draw_world(world, done, figure)
        print(f'{format_world(world, done)}\nfigure:  {figure}\n')
    print(f'numbers: {file}')
    return 0
