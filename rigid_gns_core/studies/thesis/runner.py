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

"""Runs the cells that have no result yet, side by side or on a cluster."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from .budget import Budget
from .cell import Cell
from .devices import Devices, shared_out
from .sets import make_sets
from .store import Store
from .work import LOG, run_cell
from ...running.progress import Progress
from ...running.workers import Workers


@dataclass(frozen=True)
class Folders:
    """Where things lie.

    Args:
        data: Data sets, which are made where they are absent.
        runs: Checkpoints of cells that are being trained.
        out: Results.
    """

    data: Path
    runs: Path
    out: Path


def run_cells(
    cells: Sequence[Cell], budget: Budget, folders: Folders, store: Store, workers: Workers
) -> list[str]:
    """Run what is missing; returns a line for each cell that failed.

    A cell that was stopped goes on from its last checkpoint. Where the budget's device is CUDA,
    this machine runs as many at a time as it has devices, each on its own. Timings run one at a
    time, after all else, in this process.
    """
    missing = [cell for cell in cells if store.find(cell) is None]
    if not missing:
        return []
    make_sets(budget, folders.data, sorted({cell.kind for cell in missing}), workers)
    side_by_side = [cell for cell in missing if cell.kind != 'speed']
    timed = [cell for cell in missing if cell.kind == 'speed']
    failed = []
    with (
        TemporaryDirectory() as locks,
        Progress(
            len(cells), 'cells', unit='cell', initial=len(cells) - len(missing), interval=0.0
        ) as progress,
    ):
        trainers, devices = shared_out(budget.device, workers, Path(locks))
        for group, by in ((side_by_side, trainers), (timed, Workers(1))):
            alone = by.here and by.processes(len(group)) == 1
            if group and not alone:
                progress.line(f'what each cell does: {folders.runs / "*" / LOG}')
            calls = (
                (cell, folders.data, folders.runs, not alone, devices)
                for cell in group
                if store.find(cell) is None  # still: others may work on the same folder
            )
            for cell, result in by.run(_run, calls, len(group)):
                if 'error' in result:
                    failed.append(f'{cell.name}, seed {cell.seed}: {_last_line(result["error"])}')
                    progress.line(f'{cell.name}, seed {cell.seed} failed:\n{result["error"]}')
                else:
                    store.write(cell, result)
                minutes = result.get('seconds', {}).get('all', 0.0) / 60
                progress.update(cell=f'{cell.name}/{cell.seed}', minutes=minutes)
    return failed


def _run(
    cell: Cell, data: Path, runs: Path, quiet: bool, devices: Devices | None
) -> tuple[Cell, dict[str, Any]]:
    return cell, run_cell(cell, data, runs, quiet=quiet, devices=devices)


def _last_line(text: str) -> str:
    return text.strip().splitlines()[-1]
