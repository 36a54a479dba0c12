# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Hashes of rollouts by the laws, to check that a change of code changes no bit of a prediction.

    PYTHONPATH=OTHER_TREE python benchmarks/rollout_hashes.py --out before.json
    python benchmarks/rollout_hashes.py --against before.json    # exit code 1: they differ

It runs on trees from 48f91d5 on, where the laws were `contact` without its network. Machine code
depends on the processor, so that hashes compare on one machine only. Trees before sums were no
longer fused give other bits in the process that compiles: run it twice on those.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
import hashlib
import json
from pathlib import Path
import sys
import warnings

import numpy as np
from rigid_gns_core import load_simulator, Scene, State

try:
    from rigid_gns_core.studies.benchmark.scenes import bench_scenes
    from rigid_gns_core.studies.hard_cases.cases import hard_cases
except ModuleNotFoundError:  # before the core had folders by stage
    from rigid_gns_core.benchmark.scenes import bench_scenes
    from rigid_gns_core.hard_cases.cases import hard_cases

STEPS = 200
RENAMED = {'precision': 'heap'}
"""Hard cases by their former names."""


def starts() -> Iterator[tuple[str, Scene, State]]:
    """Scenes of the benchmark and the hard cases."""
    for scene in bench_scenes():
        yield f'benchmark {scene.name}', scene.scene, scene.start
    for case in hard_cases(quick=True):
        yield f'hard case {RENAMED.get(case.name, case.name)}', case.scene, case.start


def hashes() -> dict[str, str]:
    """SHA-256 of each rollout: positions, quaternions, velocities and angular velocities."""
    try:
        simulator = load_simulator('laws')
    except ValueError:  # before they had a name of their own
        simulator = load_simulator('contact', network=False)
    found = {}
    for name, scene, start in starts():
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            trajectory = simulator.rollout(scene, steps=STEPS, **vars(start))
        digest = hashlib.sha256()
        for part in ('positions', 'quaternions', 'velocities', 'angular_velocities'):
            digest.update(np.ascontiguousarray(getattr(trajectory, part)).tobytes())
        found[name] = digest.hexdigest()
        print(f'{found[name][:16]}  {name}', flush=True)
    return found


def main() -> int:
    """Write hashes, or compare with those of another commit; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--out', type=Path, help='JSON file to write')
    parser.add_argument('--against', type=Path, help='JSON file of another commit')
    arguments = parser.parse_args()
    found = hashes()
    if arguments.out:
        arguments.out.write_text(json.dumps(found, indent=1) + '\n', encoding='utf-8')
    if not arguments.against:
        return 0
    known = json.loads(arguments.against.read_text(encoding='utf-8'))
    differing = [name for name in known if found.get(name) != known[name]]
    print(f'{len(known) - len(differing)} of {len(known)} the same', *differing, sep='\n  ')
    return 1 if differing else 0


if __name__ == '__main__':
    sys.exit(main())
