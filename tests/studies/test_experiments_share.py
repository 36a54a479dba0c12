# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cells over several processes: on a GPU one after the other."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rigid_gns_core.running.workers import Workers
from rigid_gns_core.studies.thesis import runner
from rigid_gns_core.studies.thesis.budget import load_budget
from rigid_gns_core.studies.thesis.cell import Cell, Store

torch = pytest.importorskip('torch', reason='experiments train')


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
