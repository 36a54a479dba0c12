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

"""Runs a cell, in whatever process; returns what its JSON will hold."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
from pathlib import Path
import threading
import time
import traceback
from typing import Any, TYPE_CHECKING

from .cell import Cell
from .devices import Devices
from .measure import columns, describe, floor_of, least_floor, measure, roll_outs, Values
from .sets import references, training_set
from .speed import measure_speed
from .store import commit
from .tally import Tally
from ...data.common_scene import fingerprint
from ...data.records import Record
from ...scoring import LAW_KEYS
from ...scoring.evaluate import Velocities

if TYPE_CHECKING:
    import torch

LOG = 'output.txt'
# a cluster's worker may have threads, but seeds and standard error are of the process
_ONE_AT_A_TIME = threading.Lock()


def run_cell(
    cell: Cell, data: Path, runs: Path, *, quiet: bool = False, devices: Devices | None = None
) -> dict[str, Any]:
    """Do the work of a cell; what was trained before is not trained again.

    Args:
        cell: What to do.
        data: Folder of the data sets, see `sets.make_sets`.
        runs: Folder of checkpoints, one for each cell.
        quiet: Write progress into `output.txt` of the run's folder, not to standard error.
        devices: CUDA devices, of which this process takes its own; None: what the budget says.

    Returns:
        The result, with `seconds`, those of earlier processes included; or `error` with a
        traceback, so that others go on.
    """
    with _ONE_AT_A_TIME:
        return _run_cell(cell, data, runs, quiet, devices)


def _run_cell(
    cell: Cell, data: Path, runs: Path, quiet: bool, devices: Devices | None
) -> dict[str, Any]:
    import torch

    torch.set_num_threads(1)  # cells run side by side
    begin = time.monotonic()
    folder = runs / (cell.training_key if cell.kind == 'train' else cell.key)
    try:
        with _redirected(folder / LOG) if quiet else contextlib.nullcontext():
            if cell.kind == 'teacher':
                result = _teacher(cell, data)
            elif cell.kind == 'speed':
                result = measure_speed(cell, references(cell.budget, data, 'test'))
            else:
                result = _train(cell, data, folder, devices)
    except Exception:
        return {'error': traceback.format_exc()}
    seconds = result.get('seconds', {})
    whole = seconds.get('earlier_processes', 0.0) + time.monotonic() - begin
    return {**result, 'seconds': {**seconds, 'all': whole}}


def device_for(cell: Cell, devices: Devices | None) -> torch.device:
    """Return where a cell is trained and rolled out by this process."""
    import torch

    from ...training.distributed import find_device

    if devices is not None:
        return torch.device('cuda', devices.mine())
    return find_device(cell.budget.device)


def _train(cell: Cell, data: Path, folder: Path, devices: Devices | None) -> dict[str, Any]:
    """Train, then roll out on the test set and on the scenes unlike the training set."""
    from ...rollout.rollout import load_simulator
    from ...training.train import Trainer

    config = cell.budget.training(cell.changes, cell.seed)
    device = device_for(cell, devices)
    records = training_set(cell.budget, data)
    begin = time.monotonic()
    trainer = Trainer(config, records, [], folder, cell.budget.data.named.train, device)
    done = trainer.learner.step
    failed = None
    tally = Tally(folder, done, commit(), begin)
    try:
        with tally:
            trainer.run()
    except FloatingPointError as error:  # a result too: this variant cannot be trained so
        failed = str(error)
    result: dict[str, Any] = {
        'training': {
            'data_sha256': fingerprint(records),
            'steps': trainer.learner.step,
            'device': device.type,
            'failed': failed,
            'parameters': sum(parameter.numel() for parameter in trainer.learner.parameters),
        },
        'seconds': {
            'training': tally.earlier + time.monotonic() - begin,
            'resumed_at_step': done,
            'counted_from_step': tally.counted_from_step,
            'earlier_processes': tally.earlier,
        },
        'commits': tally.commits,
        'measures': {},
    }
    if failed is not None:
        return result
    del trainer, records
    begin = time.monotonic()
    on_gpu = device.type != 'cpu'
    options: dict[str, Any] = {'backend': 'torch', 'device': str(device)} if on_gpu else {}
    simulator = load_simulator(folder / 'best', **options)
    for which in ('test', 'ood'):
        held_out = references(cell.budget, data, which)
        if not held_out:  # a budget may have no unseen scenes
            continue
        lengths = cell.steps(which)
        rows: dict[int, list[Values]] = {steps: [] for steps in lengths}
        made = roll_outs(simulator, held_out, lengths[-1], at_once=on_gpu)
        for record, predicted in zip(held_out, made, strict=True):
            for steps in lengths:
                rows[steps].append(measure(predicted, record, steps))
        result['measures'][which] = _by_steps(held_out, rows)
    result['seconds']['evaluation'] = time.monotonic() - begin
    return result


def _teacher(cell: Cell, data: Path) -> dict[str, Any]:
    """Laws of the reference by both kinds of velocities, and the floor of chaos."""
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
            bounds = {f'least_{key}': least_floor(key, record) for key in floor}
            floors[steps].append(floor | {k: v for k, v in bounds.items() if v is not None})
    result['floor'] = _by_steps(held_out, floors)
    return result


def _laws(record: Record, steps: int, velocities: Velocities) -> Values:
    """Of the reference itself, which has no error."""
    values = measure(record.trajectory, record, steps, velocities)
    return {key: values[key] for key in (*LAW_KEYS, 'escaped', 'diverged_at')}


def _by_steps(records: list[Record], rows: dict[int, list[Values]]) -> dict[str, Any]:
    return {**describe(records), **{str(steps): columns(row) for steps, row in rows.items()}}


@contextlib.contextmanager
def _redirected(path: Path) -> Iterator[None]:
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, 'a', encoding='utf-8') as stream, contextlib.redirect_stderr(stream):
        yield
