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

"""Cells over several processes and devices: what each has of the time, and of the GPUs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import subprocess
import sys
import time
from typing import Any

import pytest
from rigid_gns_core.files.strict_json import read_json
from rigid_gns_core.running.workers import Workers
from rigid_gns_core.studies.thesis import runner
from rigid_gns_core.studies.thesis.budget import load_budget
from rigid_gns_core.studies.thesis.cell import Cell
from rigid_gns_core.studies.thesis.devices import Devices, shared_out
from rigid_gns_core.studies.thesis.store import Store
from rigid_gns_core.studies.thesis.tally import NAME, Tally

torch = pytest.importorskip('torch', reason='experiments train')
HOLD = """
from pathlib import Path
import sys
from rigid_gns_core.studies.thesis.devices import Devices
print(Devices(2, Path(sys.argv[1])).mine(), flush=True)
sys.stdin.read()
"""


def until(true: Callable[[], bool]) -> None:
    end = time.monotonic() + 60
    while not true():
        assert time.monotonic() < end, 'waited in vain'
        time.sleep(0.01)


def test_a_killed_process_counts_up_to_its_last_word(tmp_path: Path) -> None:
    killed = Tally(tmp_path, 0, 'first', time.monotonic() - 100, every=0.01)
    with killed:
        begin = read_json(tmp_path / NAME)['runs'][0]['seconds']
        until(lambda: read_json(tmp_path / NAME)['runs'][0]['seconds'] > begin)
        as_killed = (tmp_path / NAME).read_text()
    (tmp_path / NAME).write_text(as_killed)
    with Tally(tmp_path, 8, 'second', time.monotonic() - 50):
        pass
    # who begins at step 8 too shows that the second left nothing behind
    last = Tally(tmp_path, 8, 'third', time.monotonic())
    assert 100 < last.earlier < 150 and last.commits == ['first', 'third']
    last = Tally(tmp_path, 9, 'first', time.monotonic())
    assert 150 < last.earlier < 250 and last.commits == ['first', 'second']
    assert last.counted_from_step == 0


def test_a_training_that_an_older_source_began_is_not_counted_as_whole(tmp_path: Path) -> None:
    with Tally(tmp_path, 3, None, time.monotonic()) as tally:
        assert tally.counted_from_step == 3 and tally.commits == []


@pytest.fixture
def two_gpus(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, 'is_available', lambda: True)
    monkeypatch.setattr(torch.cuda, 'device_count', lambda: 2)


@pytest.mark.usefixtures('two_gpus')
@pytest.mark.parametrize(
    ('device', 'asked', 'count'),
    [('auto', None, 2), ('cuda', 8, 2), ('auto', 1, 1), ('cpu', 8, 8), ('cpu', None, None)],
)
def test_there_are_no_more_workers_than_gpus(
    device: str, asked: int | None, count: int | None, tmp_path: Path
) -> None:
    workers, devices = shared_out(device, Workers(asked), tmp_path)
    assert workers == Workers(count)
    assert devices == (None if device == 'cpu' else Devices(2, tmp_path))


@pytest.mark.usefixtures('two_gpus')
def test_a_cluster_has_devices_of_its_own(tmp_path: Path) -> None:
    workers = Workers(8, 'dask')
    assert shared_out('auto', workers, tmp_path) == (workers, None)


def test_auto_without_a_gpu_is_the_cpu(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(torch.cuda, 'is_available', lambda: False)
    assert shared_out('auto', Workers(8), tmp_path) == (Workers(8), None)


def test_each_process_has_a_device_of_its_own(tmp_path: Path) -> None:
    """Until it ends; then the next one has it."""
    from rigid_gns_core.studies.thesis.work import device_for

    def other() -> subprocess.Popen[str]:
        words = [sys.executable, '-c', HOLD, str(tmp_path)]
        return subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def said(process: subprocess.Popen[str]) -> str:
        assert process.stdout is not None
        return process.stdout.readline().strip()

    cell = Cell('train', 'base', 0, load_budget('smoke'))
    with other() as first:
        assert said(first) == '0'
        for _ in range(2):  # it keeps the same
            assert device_for(cell, Devices(2, tmp_path)) == torch.device('cuda', 1)
        with other() as waits:
            first.kill()
            assert said(waits) == '0'
            waits.kill()
    assert device_for(cell, None) == torch.device('cpu')


@pytest.mark.usefixtures('two_gpus')
def test_cells_are_sent_to_the_gpus(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """With one worker, in this process; no training, which needs a GPU."""
    sent: list[Any] = []

    def run_cell(*words: Any, quiet: bool, devices: Devices | None) -> dict[str, Any]:
        assert devices is not None
        sent.append((devices.count, devices.mine()))
        return {'error': 'no GPU'}

    monkeypatch.setattr(runner, 'run_cell', run_cell)
    monkeypatch.setattr(runner, 'make_sets', lambda *words: None)
    budget = load_budget('full')
    cells = [Cell('train', 'base', seed, budget) for seed in (0, 1)]
    folders = runner.Folders(tmp_path, tmp_path, tmp_path)
    failed = runner.run_cells(cells, budget, folders, Store(tmp_path), Workers(1))
    assert sent == [(2, 0), (2, 0)] and len(failed) == 2
