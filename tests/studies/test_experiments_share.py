# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cells over several processes: what each has of the time; on a GPU one after the other."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rigid_gns_core.running.workers import Workers
from rigid_gns_core.studies.thesis import runner
from rigid_gns_core.studies.thesis.budget import load_budget
from rigid_gns_core.studies.thesis.cell import Cell, Store
from rigid_gns_core.studies.thesis.runner import Tally

torch = pytest.importorskip('torch', reason='experiments train')


def test_processes_that_were_stopped_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = iter(['first', 'second', 'third', 'first'])
    monkeypatch.setattr(runner, 'commit', lambda: next(names))
    with pytest.raises(KeyboardInterrupt), Tally(tmp_path, 0) as first:
        raise KeyboardInterrupt
    with Tally(tmp_path, 8):
        pass
    # who begins at step 8 too shows that the second left nothing behind
    last = Tally(tmp_path, 8)
    assert 0 < last.earlier <= first.seconds and last.commits == ['first', 'third']
    last = Tally(tmp_path, 9)
    assert last.commits == ['first', 'second'] and last.counted_from_step == 0


def test_the_seconds_before_a_kill_are_not_known(tmp_path: Path) -> None:
    Tally(tmp_path, 0).__enter__()
    with Tally(tmp_path, 5) as tally:
        assert tally.counted_from_step == 5
    assert Tally(tmp_path, 7).counted_from_step == 5


def test_a_training_that_an_older_source_began_is_not_counted_as_whole(tmp_path: Path) -> None:
    with Tally(tmp_path, 3) as tally:
        assert tally.counted_from_step == 3


@pytest.mark.parametrize(
    ('device', 'gpu', 'count'), [('auto', True, 1), ('auto', False, 8), ('cpu', True, 8)]
)
def test_on_a_gpu_cells_run_one_by_one(
    device: str, gpu: bool, count: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    used: list[int | None] = []

    def run(self: Workers, _: Any, calls: Any, count: int) -> list[Any]:
        if count:
            used.append(self.count)
        return []

    monkeypatch.setattr(torch.cuda, 'is_available', lambda: gpu)
    monkeypatch.setattr(Workers, 'run', run)
    monkeypatch.setattr(runner, 'make_sets', lambda *words: None)
    budget = replace(load_budget('full'), device=device)
    cells = [Cell('train', 'base', seed, budget) for seed in (0, 1)]
    folders = runner.Folders(tmp_path, tmp_path, tmp_path)
    runner.run_cells(cells, budget, folders, Store(tmp_path), Workers(8))
    assert used == [count]
