# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns calibrate`: fits a scene to tracks, or materials to tracked poses."""

from __future__ import annotations

import argparse
from dataclasses import asdict
import json
from pathlib import Path

import yaml

from .arguments import completes, configs, figure_file, positive, shipped_models
from .calibrate_tracks import calibrate_tracks, hold_positions_only
from ..data.records import Dataset
from ..errors import UserError
from ..files.atomic_file import make_folder, whole_file
from ..files.tables import format_rows, number
from ..identification.calibrate import calibrate, Calibration, DEFAULT
from ..identification.fit import MATERIALS
from ..identification.windows import with_materials
from ..prediction.load import load_simulator
from ..scenes.scene import Scene


def format_calibration(found: Calibration, scene: Scene) -> str:
    """Table of the fitted materials, and lines on the values of pairs.

    Args:
        found: The fit.
        scene: Scene with these materials.
    """
    rows = []
    for name, one in found.materials.items():
        fitted = number(one.before, 4), number(one.value, 4)
        error = number(one.error if one.told else None, 2)
        rows.append([name, *fitted, error, '' if one.told else 'the data cannot tell it: kept'])
    lines = [format_rows(['material', 'before', 'fitted', 'error', ''], rows, left=(0, -1))]
    values = found.values
    for name in ('restitution', 'friction'):
        if name in values:
            pairs = sorted({f'{values[name] * one:.3g}' for one in scene.surface_values(name)})
            surface = f', of a sphere and a surface {" or ".join(pairs)}' if pairs else ''
            lines.append(f'{name} of two spheres {values[name] ** 2:.3g}{surface}')
    before, after = found.position_error
    lines.append(
        f'mean position error after {found.steps} steps in {found.windows[1] or found.windows[0]} '
        f'windows{" held out" if found.windows[1] else ""}: {before:.4g} m before, {after:.4g} m '
        'after'
    )
    return '\n'.join(lines)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `rigid-gns calibrate`."""
    parser.add_argument(
        '--data', required=True, type=Path, nargs='+', help='folders made by import'
    )
    model = parser.add_argument(
        '--model', default='', help='model that takes materials: a shipped name or a path'
    )
    completes(model, shipped_models)
    parser.add_argument('--out', required=True, type=Path, help='scene file (YAML) to write')
    parser.add_argument('--json', type=Path, metavar='FILE', help='write all numbers to this file')
    parser.add_argument(
        '--figure',
        type=figure_file,
        metavar='PNG',
        help='draw what a fit to tracks leaves: residuals, restitution, drag, errors',
    )
    parser.add_argument(
        '--method',
        choices=('auto', 'tracks', 'rollouts'),
        default='auto',
        help='tracks: air, contact laws, spins and noise from stamped positions; rollouts: '
        "materials from poses at the model's step (default: tracks where rotations were not "
        'tracked)',
    )
    scene = parser.add_argument(
        '--scene', metavar='NAME|FILE', help="where a fit to tracks begins: instead of the data's"
    )
    completes(scene, configs('scenes'))
    parser.add_argument(
        '--fit',
        nargs='+',
        choices=tuple(MATERIALS),
        default=DEFAULT,
        help=f'materials to fit (default {" ".join(DEFAULT)})',
    )
    parser.add_argument('--steps', type=positive, default=6, help='steps of a window (default 6)')
    parser.add_argument(
        '--windows', type=positive, default=300, help='largest number of windows (default 300)'
    )
    parser.epilog = (
        'examples:\n  rigid-gns calibrate --data data/lab --out lab.yaml\n'
        '  rigid-gns import bags/first --scene lab.yaml --out data/lab_fitted'
    )


def run(arguments: argparse.Namespace) -> int:
    """Run `rigid-gns calibrate`; the exit code."""
    outputs = [one for one in (arguments.out, arguments.json, arguments.figure) if one is not None]
    if len({path.resolve() for path in outputs}) < len(outputs):
        raise UserError('--out, --json and --figure name one file; give each its own')
    for path in outputs:
        if path.exists():
            raise FileExistsError(f'{path} exists; remove it or give another name')
        make_folder(path.parent, path)  # before the work, not after it
    if arguments.method == 'rollouts' and arguments.figure is not None:
        raise UserError('--figure is of a fit to tracks; leave it out, or give --method tracks')
    by_tracks = arguments.method == 'tracks' or (
        arguments.method == 'auto' and hold_positions_only(arguments.data)
    )
    if by_tracks:
        return calibrate_tracks(arguments)
    simulator = load_simulator(arguments.model)
    records = [record for folder in arguments.data for record in Dataset(folder)]
    simulator.warm_up()  # else the time that is left would count the compiler
    found = calibrate(
        simulator, records, names=arguments.fit, steps=arguments.steps, most=arguments.windows
    )
    fitted = with_materials(records[0].scene, found.values)
    scene = fitted.to_mapping()
    head = f'# Materials fitted by `rigid-gns calibrate` to {arguments.data[0].name}\n'
    with whole_file(arguments.out) as partial:
        partial.write_text(head + yaml.safe_dump({'scene': scene}, sort_keys=False), 'utf-8')
    if arguments.json is not None:
        with whole_file(arguments.json) as partial:
            partial.write_text(json.dumps(asdict(found), indent=1) + '\n', 'utf-8')
    print(format_calibration(found, fitted))
    print(f'scene: {arguments.out}')
    return 0
