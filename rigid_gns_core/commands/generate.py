# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns generate`: Bullet trajectories of a data recipe, or of one scene, as HDF5 files."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
import sys
import time

from .arguments import add_worker_arguments, chosen_workers, completes, configs
from ..data.generate import generate, generate_scene
from ..data.recipe import load_recipe
from ..data.records import Contents, present_records
from ..errors import UserError
from ..running.interrupt import end_on_sigterm
from ..running.progress import Progress

EXAMPLE = """examples:
  rigid-gns generate --config smoke --out data/smoke
  rigid-gns generate --scene box_154 --steps 600 --out box_154.h5

A run that was stopped resumes when the same command is given again."""
SCENE_STEPS = 600  # default steps with `--scene`


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `rigid-gns generate`."""
    parser.epilog = EXAMPLE
    what = parser.add_mutually_exclusive_group(required=True)
    config = what.add_argument(
        '--config',
        metavar='NAME_OR_FILE',
        help='recipe of a data set: a name in config/data or a YAML file',
    )
    scene = what.add_argument(
        '--scene', metavar='NAME_OR_FILE', help='one scene: a name in config/scenes or a YAML file'
    )
    completes(config, configs('data'))
    completes(scene, configs('scenes'))
    parser.add_argument(
        '--out',
        type=Path,
        required=True,
        metavar='PATH',
        help='folder of the data set; with --scene, the HDF5 file',
    )
    add_worker_arguments(parser)
    parser.add_argument(
        '--trajectories', type=int, metavar='N', help="trajectories instead of the recipe's number"
    )
    parser.add_argument(
        '--steps', type=int, metavar='N', help="time steps (default: the recipe's; a scene: 600)"
    )
    parser.add_argument(
        '--substeps',
        type=int,
        metavar='N',
        help="with --scene: the teacher's substeps per time step (default: 240)",
    )
    parser.add_argument(
        '--poses-only',
        action='store_true',
        help='with --scene: positions and rotations alone, as float32',
    )


def run(arguments: argparse.Namespace) -> int:
    """Run `rigid-gns generate`; the exit code."""
    if arguments.scene is not None:
        if arguments.out.exists():
            raise FileExistsError(f'{arguments.out} exists; remove it first')
        contents: Contents = 'poses' if arguments.poses_only else 'full'
        steps = SCENE_STEPS if arguments.steps is None else arguments.steps
        with Progress(steps, str(arguments.scene)) as progress:
            path = generate_scene(
                arguments.scene,
                arguments.out,
                steps,
                substeps=arguments.substeps,
                contents=contents,
                done=progress.update,
            )
        print(f'{path}: {path.stat().st_size / 1e6:.2f} MB')
        return 0
    if arguments.substeps is not None:
        raise UserError('--substeps goes with --scene: a recipe has its own under teacher')
    if arguments.poses_only:
        raise UserError('--poses-only goes with --scene: training needs all of a trajectory')
    changes = {name: getattr(arguments, name) for name in ('trajectories', 'steps')}
    changes = {name: value for name, value in changes.items() if value is not None}
    recipe = replace(load_recipe(arguments.config), **changes)
    begin = time.monotonic()
    try:
        with end_on_sigterm():
            paths = generate(recipe, arguments.out, workers=chosen_workers(arguments))
    except KeyboardInterrupt:
        whole = len(present_records(arguments.out))
        print(
            f'\nstopped: {whole} of {recipe.trajectories} trajectories are whole in '
            f'{arguments.out}; give the same command again to go on',
            file=sys.stderr,
        )
        raise
    size = sum(path.stat().st_size for path in paths)
    seconds = time.monotonic() - begin
    print(
        f'{arguments.out}: {len(paths)} trajectories of {recipe.steps} steps, '
        f'{size / 1e6:.1f} MB, {seconds:.0f} s'
    )
    return 0
