# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Kills in the moments in which most is half done: compiling, and beginning a bag's next file."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Any

import numpy as np

BAGS = Path(__file__).parents[1] / 'bags'
sys.path.insert(0, str(BAGS))
SPLIT_MB = 0.04  # a file holds one or two messages of each topic
LONGEST = 3.0  # a kill of a recorder comes so long after its bag began at most [s]
COMPILING = 20.0  # and of a compiler [s]
AT_ONCE = 2
FILTER = [sys.executable, '-m', 'rigid_gns_core.tracking']


def kills_while_splitting(folder: Path, runs: int) -> dict[str, Any]:
    """Kill recorders that begin a file with every other message; ten for each run."""
    import bag_kills

    count = 10 * runs
    moments = np.random.default_rng(0).uniform(0.1, LONGEST, count)

    def one(number: int) -> bag_kills.Kill:
        return bag_kills.kill_recorder(folder / str(number), float(moments[number]), SPLIT_MB)

    with ThreadPoolExecutor(AT_ONCE) as pool:
        kills = list(pool.map(one, range(count)))
    wrong = [k for k in kills if not k.read or not k.whole_bytes or k.evaluated is False]
    return {
        'runs': count,
        'wrong': len(wrong),
        'worst_s': round(max(k.loss_s for k in kills if k.loss_s is not None), 2),
        'files': max(k.files for k in kills),
        'said': 'a warning on reading that the recorder did not finish',
        'each': [vars(k) for k in kills],
    }


def kills_while_compiling(folder: Path, runs: int) -> dict[str, Any]:
    """Kill processes that compile into one cache, then compile to the end and compare results.

    The cache is of the tracking filter; that of the engine is the same code.
    """
    environment = {**os.environ, 'NUMBA_CACHE_DIR': str(folder / 'cache')}
    # of another processor: machine code of this one may lie beside the sources
    environment['NUMBA_CPU_NAME'] = 'generic'
    rng = np.random.default_rng(0)
    kept, wrong = [], 0
    for _ in range(runs):
        process = subprocess.Popen(FILTER, env=environment, stderr=subprocess.DEVNULL)
        time.sleep(float(rng.uniform(2.0, COMPILING)))
        process.send_signal(signal.SIGKILL)
        wrong += process.wait() not in (-signal.SIGKILL, 0)
        kept.append(len([path for path in (folder / 'cache').rglob('*') if path.is_file()]))
    began = time.monotonic()
    done = subprocess.run(FILTER, env=environment, capture_output=True, text=True, check=False)
    again = subprocess.run(FILTER, env=environment, capture_output=True, text=True, check=False)
    wrong += done.returncode != 0 or 'compiling' in again.stderr
    return {
        'runs': runs,
        'wrong': wrong,
        'worst_s': 0.0,
        'files_kept': kept,
        'to_the_end_s': round(time.monotonic() - began, 1),
        'said': 'the next start compiles what is missing, the one after that nothing',
    }
