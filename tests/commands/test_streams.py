# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Standard streams that are closed, as by a service manager, or on a full disk."""

from __future__ import annotations

import os
from pathlib import Path
import subprocess
import sys

import numpy as np
import pytest
from rigid_gns_core.commands import cli
from rigid_gns_core.data.records import read_record

PROGRAM = [sys.executable, '-m', 'rigid_gns_core.commands.cli']
ROLLOUT = [*PROGRAM, 'rollout', '--steps', '1', '--scene', 'table_tennis', '--out']
FULL = Path('/dev/full')


@pytest.mark.parametrize('closed', [(0,), (1,), (2,), (0, 1, 2)], ids=str)
def test_closed_streams_cost_no_work(tmp_path: Path, closed: tuple[int, ...]) -> None:
    done = subprocess.run(
        [*ROLLOUT, str(tmp_path / 'a.h5')],
        preexec_fn=lambda: [os.close(stream) for stream in closed],
        timeout=300,
        check=False,
    )
    assert done.returncode == 0
    assert np.isfinite(read_record(tmp_path / 'a.h5').trajectory.positions).all()


@pytest.mark.skipif(not FULL.exists(), reason='there is no /dev/full')
def test_a_full_log_costs_no_work(tmp_path: Path) -> None:
    with FULL.open('w') as full:
        done = subprocess.run([*ROLLOUT, str(tmp_path / 'a.h5')], stderr=full, timeout=300)
        wrong = subprocess.run([*ROLLOUT, str(tmp_path)], stderr=full, timeout=300)
    assert (done.returncode, wrong.returncode) == (0, cli.BAD_INPUT)
    assert np.isfinite(read_record(tmp_path / 'a.h5').trajectory.positions).all()


@pytest.mark.skipif(not FULL.exists(), reason='there is no /dev/full')
def test_numbers_that_cannot_be_printed_are_an_error() -> None:
    with FULL.open('w') as full:
        done = subprocess.run(
            [*PROGRAM, 'info', '--json'], stdout=full, stderr=subprocess.PIPE, timeout=300
        )
    assert done.returncode == cli.BAD_INPUT
    assert done.stderr == b'rigid-gns info: error: [Errno 28] No space left on device\n'
