# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Runs cells without a result, in parallel processes or on a cluster."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import contextlib
from dataclasses import dataclass, replace
from pathlib import Path
import threading
import time
import traceback
from typing import Any
import warnings

from .budget import Budget
from .cell import Cell, Store
from .data_sets import make_sets, references, training_set
from .metrics import columns, describe, floor_of, least_floors, measure, Values
from .speed import measure_speed
from ...data.common_scene import fingerprint
from ...data.records import Record
from ...running.progress import Progress
from ...running.workers import Workers
from ...scoring import LAW_KEYS
from ...scoring.evaluate import Velocities

LOG = 'output.txt'
# a cluster's worker may have threads, but seeds and standard error belong to the process
_ONE_AT_A_TIME = threading.Lock()


@dataclass(frozen=True)
class Folders:
    """Folders of a study.

    Args:
        data: Folder of the data sets, which are generated where absent.
        runs: Folder of the checkpoints.
        out: Folder of the results.
    """

    data: Path
    runs: Path
    out: Path


def run_cells(
    cells: Sequence[Cell], budget: Budget, folders: Folders, store: Store, workers: Workers
) -> list[str]:
    """Run the cells without a result; a line for each cell that failed.

    A cell that was stopped resumes from its last checkpoint. On a GPU of this machine, cells run
    one at a time. Timings run one at a time, after all others, in this process.
    """
    missing = [cell for cell in cells if store.find(cell) is None]
    if not missing:
        return []
    make_sets(budget, folders.data, sorted({cell.kind for cell in missing}), workers)
    side_by_side = [cell for cell in missing if cell.kind != 'speed']
    timed = [cell for cell in missing if cell.kind == 'speed']
    if workers.here and _on_gpu(budget):
        workers = replace(workers, count=1)
    failed = []
    with Progress(
        len(cells), 'cells', unit='cell', initial=len(cells) - len(missing), interval=0.0
    ) as progress:
        for group, by in ((side_by_side, workers), (timed, Workers(1))):
            alone = by.here and by.processes(len(group)) == 1
            if group and not alone:
                progress.line(f'what each cell does: {folders.runs / "*" / LOG}')
            calls = (
                (cell, folders.data, folders.runs, not alone)
                for cell in group
                if store.find(cell) is None  # again: others may work on the same folder
            )
            for cell, result in by.run(run_cell, calls, len(group)):
                if 'error' in result:
                    what = f'{cell.name}, seed {cell.seed}'
                    failed.append(f'{what}: {result["error"].strip().splitlines()[-1]}')
                    progress.line(f'{what} failed:\n{result["error"]}')
                else:
                    store.write(cell, result)
                minutes = result.get('seconds', {}).get('all', 0.0) / 60
                progress.update(cell=f'{cell.name}/{cell.seed}', minutes=minutes)
    return failed


def run_cell(
    cell: Cell, data: Path, runs: Path, quiet: bool = False
) -> tuple[Cell, dict[str, Any]]:
    """Run one cell, resuming an earlier training.

    Args:
        cell: The cell.
        data: Folder of the data sets, see `data_sets.make_sets`.
        runs: Folder of checkpoints, with a folder for each cell.
        quiet: Whether to write progress to `output.txt` in that folder instead of standard error.

    Returns:
        The cell, and its result with `seconds` of this process; or `error` with a traceback, so
        that other cells continue.
    """
    import torch

    with _ONE_AT_A_TIME:
        torch.set_num_threads(1)  # cells run in parallel
        begin = time.monotonic()
        folder = runs / (cell.training_key if cell.kind == 'train' else cell.key)
        try:
            with _redirected(folder / LOG) if quiet else contextlib.nullcontext():
                if cell.kind == 'teacher':
                    result = _teacher(cell, data)
                elif cell.kind == 'speed':
                    result = measure_speed(cell, references(cell.budget, data, 'test'))
                else:
                    result = _train(cell, data, folder)
        except Exception:
            return cell, {'error': traceback.format_exc()}
        seconds = {**result.get('seconds', {}), 'all': time.monotonic() - begin}
        return cell, {**result, 'seconds': seconds}


def _on_gpu(budget: Budget) -> bool:
    if budget.device == 'cpu':
        return False
    import torch

    return torch.cuda.is_available()


def _train(cell: Cell, data: Path, folder: Path) -> dict[str, Any]:
    """Train, then roll out on the test set and on the unseen scenes."""
    from ...prediction.load import load_simulator
    from ...training.train import find_device, Trainer

    config = cell.budget.training(cell.changes, cell.seed)
    device = find_device(cell.budget.device)
    records = training_set(cell.budget, data)
    trainer = Trainer(config, records, [], folder, cell.budget.data.named.train, device)
    begun_at, begin, failed = trainer.learner.step, time.monotonic(), None
    try:
        trainer.run()
    except FloatingPointError as error:  # a result too: this variant cannot be trained
        failed = str(error)
    result: dict[str, Any] = {
        'training': {
            'data_sha256': fingerprint(records),
            'steps': trainer.learner.step,
            'device': device.type,
            'failed': failed,
            'parameters': sum(parameter.numel() for parameter in trainer.learner.parameters),
        },
        'seconds': {'training': time.monotonic() - begin, 'resumed_at_step': begun_at},
        'measures': {},
    }
    if failed is not None:
        return result
    del trainer, records
    begin = time.monotonic()
    simulator = load_simulator(folder / 'best', device=str(device))
    for which in ('test', 'ood'):
        held_out = references(cell.budget, data, which)
        if not held_out:  # a budget may have no unseen scenes
            continue
        lengths = cell.steps(which)
        rows: dict[int, list[Values]] = {steps: [] for steps in lengths}
        for record in held_out:
            with warnings.catch_warnings():
                warnings.simplefilter('ignore')  # divergences are counted
                start = vars(record.trajectory[0])
                predicted = simulator.rollout(record.scene, steps=lengths[-1], **start)
            for steps in lengths:
                rows[steps].append(measure(predicted, record, steps))
        result['measures'][which] = _by_steps(held_out, rows)
    result['seconds']['evaluation'] = time.monotonic() - begin
    return result


def _teacher(cell: Cell, data: Path) -> dict[str, Any]:
    """Laws of the reference for both kinds of velocities, and the floor of chaos."""
    held_out = references(cell.budget, data, cell.name)
    others = [references(cell.budget, data, cell.name, ending) for ending in ('half', 'twice')]
    result: dict[str, Any] = {'laws': {}, 'floor': {}}
    lengths = cell.steps(cell.name)
    kinds: tuple[Velocities, ...] = ('poses', 'given')
    for velocities in kinds:
        rows = [_laws(r, lengths[-1], velocities) for r in held_out]
        result['laws'][velocities] = _by_steps(held_out, {lengths[-1]: rows})
    floors: dict[int, list[Values]] = {steps: [] for steps in lengths}
    for record, *pair in zip(held_out, *others, strict=True):
        for steps in lengths:
            floor = floor_of(record, pair, steps)
            floors[steps].append(floor | least_floors(floor, record))
    result['floor'] = _by_steps(held_out, floors)
    return result


def _laws(record: Record, steps: int, velocities: Velocities) -> Values:
    """Laws of the reference itself."""
    values = measure(record.trajectory, record, steps, velocities)
    return {key: values[key] for key in (*LAW_KEYS, 'escaped', 'diverged_at')}


def _by_steps(records: list[Record], rows: dict[int, list[Values]]) -> dict[str, Any]:
    return {**describe(records), **{str(steps): columns(row) for steps, row in rows.items()}}


@contextlib.contextmanager
def _redirected(path: Path) -> Iterator[None]:
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, 'a', encoding='utf-8') as stream, contextlib.redirect_stderr(stream):
        yield
