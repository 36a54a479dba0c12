# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The same bytes from the process that compiles the engine, from its cache, and on threads."""

from __future__ import annotations

import os
from pathlib import Path
import shutil
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[2]
# a pile of 200: from the tenth frame on, its contacts are of one large island. Then the same in
# two parts, and as two starts at once
MAIN = """
import hashlib, os
import numpy as np
from rigid_gns_core import load_simulator
from rigid_gns_core.studies.benchmark.scenes import bench_scenes

(pile,) = bench_scenes(['pile'])
start = pile.start.positions, pile.start.velocities, pile.start.angular_velocities
simulator = load_simulator('laws')

def told(positions, velocities):
    parts = positions, velocities
    print(*(hashlib.sha256(np.ascontiguousarray(p).tobytes()).hexdigest() for p in parts))

whole = simulator.rollout(pile.scene, *start, steps=60)
told(whole.positions[1:], whole.velocities[1:])
rollout = simulator.start(pile.scene, *start)
parts = [rollout.advance(10)[0], rollout.advance(50)[0]]
told(*(np.concatenate([getattr(p, n) for p in parts]) for n in ('positions', 'velocities')))
workers = int(os.environ['OMP_NUM_THREADS'])
for one in simulator.rollout_batch(pile.scene, [pile.start] * 2, steps=60, workers=workers):
    told(one.positions[1:], one.velocities[1:])
"""


def run(package: Path, cache: Path, threads: int) -> tuple[list[str], str]:
    """Lines of the process, and what it says of compiling."""
    count = str(threads)
    names = ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'NUMBA_NUM_THREADS')
    environment = {**os.environ, **dict.fromkeys(names, count)}
    environment |= {'PYTHONPATH': str(package), 'NUMBA_CACHE_DIR': str(cache)}
    done = subprocess.run(
        [sys.executable, '-B', '-c', MAIN],
        cwd='/',
        env=environment,
        check=True,
        capture_output=True,
        text=True,
        timeout=900,
    )
    return done.stdout.splitlines(), done.stderr


@pytest.mark.slow
def test_processes_that_compile_or_read_or_have_threads_give_the_same_bytes(
    tmp_path: Path,
) -> None:
    # a copy has no machine code beside its sources
    shutil.copytree(
        ROOT / 'rigid_gns_core',
        tmp_path / 'package' / 'rigid_gns_core',
        ignore=shutil.ignore_patterns('__pycache__', 'weights'),
    )
    where = tmp_path / 'package', tmp_path / 'cache'
    compiles, said = run(*where, threads=1)
    assert 'compiling the engine' in said
    reads, said = run(*where, threads=1)
    assert 'compiling' not in said
    threads, said = run(*where, threads=2)
    assert 'compiling' not in said
    assert compiles == reads == threads
    assert len(compiles) == 4 and len(set(compiles)) == 1
