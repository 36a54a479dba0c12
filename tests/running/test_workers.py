# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calls on processes and on a Dask cluster: the same results, whoever makes them."""

from __future__ import annotations

import operator
from pathlib import Path
import subprocess
import sys

import pytest
from rigid_gns_core.commands.cli import main
from rigid_gns_core.data.records import record_path
from rigid_gns_core.files.strict_json import read_json
from rigid_gns_core.running.workers import Workers


@pytest.mark.parametrize('workers', [Workers(1), Workers(2)])
def test_calls_run_on_every_backend(workers: Workers) -> None:
    calls = [(number, 2) for number in range(5)]
    assert sorted(workers.run(operator.pow, iter(calls), 5)) == [0, 1, 4, 9, 16]


def test_wrong_workers_are_refused() -> None:
    with pytest.raises(ValueError, match='workers is 0, expected at least 1'):
        Workers(0)
    with pytest.raises(ValueError, match="backend is 'threads', allowed: loky, dask"):
        Workers(backend='threads')
    with pytest.raises(ValueError, match='a scheduler needs the backend dask'):
        Workers(scheduler='tcp://localhost:1')


@pytest.mark.slow
def test_a_dask_cluster_takes_cells_and_trajectories(tmp_path: Path) -> None:
    pytest.importorskip('pybullet', reason='generation runs Bullet')
    distributed = pytest.importorskip('distributed', reason='the cluster is one of Dask')
    # with threads, whose cells would disturb each other's seeds and output
    options = {'n_workers': 1, 'threads_per_worker': 2, 'processes': True}
    with distributed.LocalCluster(**options, dashboard_address=None) as cluster:
        on_dask = ['--backend', 'dask', '--scheduler', cluster.scheduler_address]
        command = ['generate', '--config', 'experiment_smoke', '--trajectories', '3']
        assert main([*command, '--out', str(tmp_path / 'dask'), *on_dask]) == 0
        assert main([*command, '--out', str(tmp_path / 'here'), '--workers', '1']) == 0
        for index in range(3):
            one, other = (record_path(tmp_path / where, index) for where in ('dask', 'here'))
            assert one.read_bytes() == other.read_bytes()
        experiment = ['experiment', 'history', '--budget', 'smoke', '--only', 'base', 'h_0', 'h_4']
        experiment.append(f'--data={tmp_path / "data"}')
        for where, by in (('dask', on_dask), ('here', ['--workers', '1'])):
            folders = [f'--{name}={tmp_path / name / where}' for name in ('runs', 'out')]
            assert main([*experiment, *folders, *by]) == 0
    cells = [tmp_path / 'out' / where / 'smoke' / 'cells' for where in ('dask', 'here')]
    names = [sorted(path.name for path in folder.iterdir()) for folder in cells]
    kinds = [name.rsplit('_', 2)[0] for name in names[0]]
    assert kinds == ['teacher_ood', 'teacher_test', 'train_base', 'train_h_0', 'train_h_4']
    assert names[0] == names[1]
    for name in names[0]:
        one, other = (read_json(folder / name) for folder in cells)
        for key in ('measures', 'floor', 'laws'):
            assert one.get(key) == other.get(key)


def test_importing_workers_needs_no_cluster() -> None:
    code = (
        'import sys, rigid_gns_core.data.generate, rigid_gns_core.running.workers\n'
        "print({'joblib', 'distributed', 'dask'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == 'set()'
