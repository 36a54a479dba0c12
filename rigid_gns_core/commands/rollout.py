# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns rollout`: predicts a trajectory from the start of a scene file, as a record.

With `--samples` also from starts near it, whose spread is the uncertainty of the prediction.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
import threading
import time
import warnings

import numpy as np

from .arguments import completes, configs, positive, seed_number, shipped_models
from ..data.records import Record, write_record
from ..errors import UserError
from ..files.tables import format_rows, number
from ..prediction.load import load_simulator
from ..running.progress import Progress
from ..scenes.sampling import sample_start
from ..scenes.scene_file import load_start
from ..scenes.state import Array, State, Trajectory


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `rigid-gns rollout`."""
    model = parser.add_argument('--model', default='', help='name of a shipped model, or a path')
    scene = parser.add_argument(
        '--scene', default='box_154', help='scene file, or a name in config/scenes'
    )
    completes(model, shipped_models)
    completes(scene, configs('scenes'))
    parser.add_argument('--steps', type=int, default=300, help='steps of the model (default 300)')
    parser.add_argument(
        '--seed', type=seed_number, help="seed of the start instead of the scene's"
    )
    parser.add_argument('--threads', type=positive, default=1, help='CPU threads (default 1)')
    parser.add_argument(
        '--samples',
        type=positive,
        default=1,
        metavar='N',
        help='number of starts: that of the scene, and others near it (default 1)',
    )
    parser.add_argument(
        '--spread',
        type=float,
        default=0.01,
        metavar='M',
        help='standard deviation of the coordinates of the other starts [m] (default 0.01)',
    )
    parser.add_argument(
        '--out', required=True, type=Path, help='HDF5 file to write; for several samples, a folder'
    )
    parser.epilog = (
        'examples:\n'
        '  rigid-gns rollout --scene box_154 --steps 200 --out rollout.h5\n'
        '  rigid-gns rollout --samples 64 --spread 0.001 --threads 2 --steps 50 --out what_if'
    )


def run(arguments: argparse.Namespace) -> int:
    """Run `rigid-gns rollout`; the exit code."""
    out, samples = arguments.out, arguments.samples
    if out.exists():
        raise FileExistsError(f'{out} exists; remove it or give another --out')
    if not (np.isfinite(arguments.spread) and arguments.spread >= 0):
        raise UserError(f'--spread is {arguments.spread:g} m, expected a number, at least 0')
    # several starts run in parallel instead
    simulator = load_simulator(arguments.model, threads=1 if samples > 1 else arguments.threads)
    scene, recipe = load_start(arguments.scene)
    seed = recipe.seed if arguments.seed is None else arguments.seed
    start = sample_start(scene, replace(recipe, seed=seed))
    starts = [start, *starts_near(start, samples - 1, arguments.spread, seed)]
    lock = threading.Lock()
    simulator.warm_up()
    with Progress(samples * arguments.steps, 'rollout') as progress:
        # the first step loads machine code, which takes longer than many steps; the rollouts
        # repeat its warnings
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            simulator.rollout_batch(scene, starts[:1], min(arguments.steps, 1), workers=1)
        begin = time.perf_counter()

        def count(steps: int) -> None:
            with lock:  # the starts run in threads
                progress.update(steps)

        trajectories = simulator.rollout_batch(
            scene, starts, arguments.steps, workers=arguments.threads, done=count
        )
        elapsed = time.perf_counter() - begin
    for index, trajectory in enumerate(trajectories):
        write_record(
            out / f'{index:04d}.h5' if samples > 1 else out,
            Record(
                trajectory=trajectory,
                scene=scene,
                seed=seed,
                teacher={'engine': 'rigid_gns', 'model': simulator.name},
                name=str(arguments.scene),
                index=index,
            ),
        )
    if samples > 1:
        print_spread(trajectories)
    trajectory = trajectories[0]
    print(
        f'{trajectory.count} spheres, {trajectory.steps} steps of {trajectory.dt:.4g} s, '
        + (f'{samples} samples, ' if samples > 1 else '')
        + f'{samples * trajectory.steps / elapsed:.1f} steps/s; wrote {out}'
    )
    return 0


def starts_near(start: State, count: int, spread: float, seed: int) -> list[State]:
    """`count` starts with positions moved by Gaussian noise of standard deviation `spread` [m].

    Sample k does not depend on `count`.
    """
    return [
        replace(
            start,
            positions=start.positions
            + np.random.default_rng([seed, k]).normal(0.0, spread, start.positions.shape),
        )
        for k in range(1, count + 1)
    ]


def position_spread(trajectories: Sequence[Trajectory]) -> Array:
    """Rms distance of each sphere of the samples from its mean position [m], (steps + 1, n)."""
    mean = sum(trajectory.positions for trajectory in trajectories) / len(trajectories)
    squares = sum(np.square(t.positions - mean).sum(axis=-1) for t in trajectories)
    deviation: Array = np.sqrt(squares / len(trajectories))
    return deviation


def print_spread(trajectories: Sequence[Trajectory]) -> None:
    """Print a table of the spread at about ten times."""
    spread = position_spread(trajectories)
    print(f'spread of {len(trajectories)} samples [m], over spheres')
    rows = []
    for step in np.unique(np.linspace(0, trajectories[0].steps, 11).round().astype(int)):
        levels = np.quantile(spread[step], (0.5, 0.9, 1.0))
        rows.append([number(step * trajectories[0].dt, 4), *map(number, levels)])
    print(format_rows(['time [s]', 'median', '90 %', 'largest'], rows, left=()))
