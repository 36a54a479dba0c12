# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames per second and memory of many spheres that fall as a lattice into a pile.

    python benchmarks/lattice.py --spheres 10000 --columns 22 --frames 60
    python benchmarks/lattice.py --spheres 100000 --columns 70 --frames 40

The box is that of the benchmark's pile, only wider: restitution 0.4 of each pair, 3 radii from one
sphere to the next. Two trees are compared by runs in turns, with PYTHONPATH set to each: the last
column is a hash of all positions so far.
"""

from __future__ import annotations

import argparse
import hashlib
import resource
import time

import numpy as np
from rigid_gns_core import load_simulator, Plane, Scene
from rigid_gns_core.studies.benchmark.scenes import lattice

PITCH = 3.0
TOLD = 10
"""Frames of a row."""


def resident() -> float:
    """Largest resident memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    """Print a row for every ten frames."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--spheres', type=int, default=10_000)
    parser.add_argument('--columns', type=int, default=22, help='along x, and along y')
    parser.add_argument('--frames', type=int, default=60)
    arguments = parser.parse_args()
    count, columns = arguments.spheres, arguments.columns
    side = PITCH * columns + 6.0
    scene = Scene(
        surfaces=Plane.box(side, side), restitution=0.6325, friction=0.5, rolling_friction=0.03
    )
    simulator = load_simulator('laws')
    simulator.warm_up()
    before, digest = resident(), hashlib.sha256()
    rollout = simulator.start(scene, lattice((columns, columns), count, PITCH, 1.8, 0.3))
    print('frames     frames/s  of processor time  [KB] a sphere  bytes')
    for first in range(0, arguments.frames, TOLD):
        frames = min(TOLD, arguments.frames - first)
        wall, busy = time.perf_counter(), time.process_time()
        for _ in range(frames):
            digest.update(np.ascontiguousarray(rollout.step().positions).tobytes())
        wall, busy = time.perf_counter() - wall, time.process_time() - busy
        print(
            f'{first:3d} to {first + frames:3d} {frames / wall:9.2f} {frames / busy:18.2f} '
            f'{1024 * (resident() - before) / count:14.1f}  {digest.hexdigest()[:12]}',
            flush=True,
        )


if __name__ == '__main__':
    main()
