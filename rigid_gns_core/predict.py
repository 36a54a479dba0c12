"""`rigid-gns rollout`: predict a trajectory from a scene file's start and write it as a record."""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

from .config import positive
from .dataset import Record, write_record
from .rollout import load_simulator
from .sampling import load_scene, sample_start


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `rigid-gns rollout`."""
    parser.add_argument('--model', default='', help='name of a shipped model, or a path')
    parser.add_argument('--scene', default='box_154', help='scene file, or a name in config/scenes')
    parser.add_argument('--steps', type=int, default=300, help='steps of the model (default 300)')
    parser.add_argument('--seed', type=int, help="seed of the start instead of the scene's")
    parser.add_argument('--threads', type=positive, default=1, help='CPU threads (default 1)')
    parser.add_argument('--out', required=True, type=Path, help='HDF5 file to write')
    parser.epilog = 'example:\n  rigid-gns rollout --scene box_154 --steps 200 --out rollout.h5'


def run(arguments: argparse.Namespace) -> int:
    """Run `rigid-gns rollout`."""
    if arguments.out.exists():
        raise FileExistsError(f'{arguments.out} exists; remove it or give another --out')
    simulator = load_simulator(arguments.model, threads=arguments.threads)
    scene, recipe = load_scene(arguments.scene)
    seed = recipe.seed if arguments.seed is None else arguments.seed
    start = sample_start(scene, replace(recipe, seed=seed))
    begin = time.perf_counter()
    trajectory = simulator.rollout(
        scene,
        start.positions,
        start.velocities,
        start.angular_velocities,
        arguments.steps,
        quaternions=start.quaternions,
    )
    elapsed = time.perf_counter() - begin
    write_record(
        arguments.out,
        Record(
            trajectory=trajectory,
            scene=scene,
            seed=seed,
            teacher={'engine': 'rigid_gns', 'model': simulator.name},
            name=str(arguments.scene),
        ),
    )
    print(
        f'{trajectory.count} spheres, {trajectory.steps} steps of {trajectory.dt:.4g} s, '
        f'{arguments.steps / elapsed:.1f} steps/s; wrote {arguments.out}'
    )
    return 0
