# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Costs of a fresh process: time to its first prediction, and memory.

`python -m rigid_gns_core.studies.benchmark.fresh_process first` or `... memory SPHERES` is that
process; it prints one line of JSON.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from typing import Any

import numpy as np

SPHERES = 154
"""Number of spheres of a first prediction."""


def first_prediction(repeats: int) -> dict[str, Any]:
    """Time processes, one after the other, that load the shipped model and predict one step.

    Args:
        repeats: Number of processes; the first may find a cold disk cache.

    Returns:
        `seconds` of wall clock until the process has ended: `median`, `first`, `worst`;
        `most_resident`, the peak memory [bytes] or None; `spheres`, `processes`.

    Raises:
        OSError: A process failed.
    """
    walls, peaks = [], []
    for _ in range(repeats):
        begin = time.perf_counter()
        answer = _ask('first', SPHERES)
        walls.append(time.perf_counter() - begin)
        peaks.append(answer['most_resident'])
    return {
        'spheres': SPHERES,
        'processes': repeats,
        'seconds': {'median': float(np.median(walls)), 'first': walls[0], 'worst': max(walls)},
        'most_resident': None if None in peaks else max(peaks),
    }


def memory_per_sphere(spheres: int) -> dict[str, Any]:
    """Resident memory that a rollout of a bouncing box adds to a process that predicted before.

    Returns:
        `spheres`; `before` and `most_resident` [bytes]; `per_sphere`, their difference divided by
        the number of spheres. None each where this is not Linux.
    """
    return _ask('memory', spheres)


def _ask(what: str, spheres: int) -> dict[str, Any]:
    command = [sys.executable, '-m', __name__, what, str(spheres)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise OSError(f'a process to measure failed: {done.stderr.strip()[-500:]}')
    report: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return report


def _predict(spheres: int, steps: int) -> None:
    from .scaling import bouncing_box
    from ...prediction.load import load_simulator

    scene, start = bouncing_box(spheres)
    load_simulator().rollout(scene, start.positions, steps=steps)


def _first(spheres: int) -> dict[str, Any]:
    from ...running.machine import resident_bytes

    _predict(spheres, 1)
    return {'most_resident': resident_bytes('VmHWM')}


def _memory(spheres: int) -> dict[str, Any]:
    from ...running.machine import resident_bytes

    _predict(10, 3)  # loads code and weights
    before = resident_bytes()
    _predict(spheres, 3)
    most = resident_bytes('VmHWM')
    each = None if before is None or most is None else (most - before) / spheres
    return {'spheres': spheres, 'before': before, 'most_resident': most, 'per_sphere': each}


def main(what: str, spheres: str) -> int:
    """Run as the fresh process; the exit code."""
    answer = {'first': _first, 'memory': _memory}[what](int(spheres))
    print(json.dumps(answer))
    return 0


if __name__ == '__main__':
    sys.exit(main(*sys.argv[1:]))
