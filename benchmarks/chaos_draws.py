# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether a model's errors in a chaotic scene have the same distribution as Bullet's own.

    python benchmarks/chaos_draws.py --model laws \
        --reference data/ood/ood_a.h5 data/ood/ood_b.h5 --json docs/model/chaos_draws.json

One trajectory is one draw: spheres that differ by 1 mm are elsewhere after some bounces. So each
reference is met by Bullet at half and at twice the substeps and from starts moved by 1 mm, and by
each model from the same starts; means and standard deviations of both are compared. Needs
pybullet.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
import sys
from typing import Any

import numpy as np
from rigid_gns_core.data.records import read_record, Record
from rigid_gns_core.files.strict_json import read_json, write_json
from rigid_gns_core.files.tables import format_rows, mean_std
from rigid_gns_core.prediction.load import load_simulator
from rigid_gns_core.rollout.simulator import Simulator
from rigid_gns_core.running.progress import Progress
from rigid_gns_core.scenes.state import State, Trajectory
from rigid_gns_core.scoring import chamfer, position_mse
from rigid_gns_core.studies.chaos_floor import half_and_twice
from rigid_gns_core.teacher.bullet import simulate
from rigid_gns_core.teacher.settings import TeacherSettings

MOVED = 1e-3  # how far each sphere of a draw is from its start [m]
DRAWS = 5


def moved(start: State, draw: int) -> State:
    """Return the start with every sphere moved by `MOVED` in some direction, never down."""
    way = np.random.default_rng(draw).normal(size=start.positions.shape)
    way *= MOVED / np.linalg.norm(way, axis=1, keepdims=True)
    way[:, 2] = np.abs(way[:, 2])
    return replace(start, positions=start.positions + way)


def settings_of(record: Record) -> TeacherSettings:
    """Settings with which the teacher made a record."""
    known = {field.name for field in fields(TeacherSettings)}
    return TeacherSettings(**{k: v for k, v in record.teacher.items() if k in known})


def bullet(record: Record, start: State, settings: TeacherSettings) -> Trajectory:
    """Bullet from a start, as long as the record."""
    reference = record.trajectory
    return simulate(record.scene, start, reference.steps, reference.dt, settings)


def model(simulator: Simulator, record: Record, start: State) -> Trajectory:
    """Rollout of a model from a start, as long as the record."""
    given = (start.positions, start.velocities, start.angular_velocities)
    steps = record.trajectory.steps
    return simulator.rollout(record.scene, *given, steps=steps, quaternions=start.quaternions)


def draws(
    record: Record, simulators: dict[str, Simulator], count: int
) -> dict[str, Callable[[], Trajectory]]:
    """Functions that make the draws, by 'engine: start'."""
    start, settings = record.trajectory[0], settings_of(record)
    found: dict[str, Callable[[], Trajectory]] = {
        f'Bullet: {name}': lambda other=other: bullet(record, start, other)
        for name, other in zip(('half', 'twice'), half_and_twice(settings), strict=True)
    }
    for draw in range(count):
        other = moved(start, draw)
        found[f'Bullet: moved {draw}'] = lambda other=other: bullet(record, other, settings)
    for name, simulator in simulators.items():
        for seed in range(-1, count):
            other = start if seed < 0 else moved(start, seed)
            key = f'{name}: same' if seed < 0 else f'{name}: moved {seed}'
            found[key] = lambda s=simulator, other=other: model(s, record, other)
    return found


def table(report: dict[str, Any]) -> str:
    """Mean ± standard deviation over the draws of each engine."""
    rows = []
    for scene, found in report['scenes'].items():
        for engine in dict.fromkeys(key.split(':')[0] for key in found):
            own = [value for key, value in found.items() if key.split(':')[0] == engine]
            cells = []
            for name in ('mse', 'chamfer'):
                values = np.array([one[name] for one in own])
                cells.append(mean_std(values.mean(), values.std(ddof=1)))
            rows.append([scene, engine, str(len(own)), *cells])
    head = ['scene', 'engine', 'draws', 'MSE [m²]', 'Chamfer [m²]']
    return format_rows(head, rows, left=(0, 1), markdown=True) + '\n'


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--model', nargs='+', default=['laws'], help='shipped names or paths')
    parser.add_argument('--reference', nargs='+', required=True, type=Path, metavar='FILE')
    parser.add_argument(
        '--draws', type=int, default=DRAWS, help=f'of moved starts (default {DRAWS})'
    )
    parser.add_argument('--json', required=True, type=Path, metavar='FILE')
    arguments = parser.parse_args()
    simulators = {
        name if len(arguments.model) == 1 else f'seed {index}': load_simulator(name)
        for index, name in enumerate(arguments.model)
    }
    report: dict[str, Any] = {'moved': MOVED, 'draws': arguments.draws, 'scenes': {}}
    if arguments.json.is_file():
        report['scenes'] = read_json(arguments.json)['scenes']
    for path in arguments.reference:
        record = read_record(path)
        found = report['scenes'].setdefault(path.stem, {})
        left = {
            k: v for k, v in draws(record, simulators, arguments.draws).items() if k not in found
        }
        with Progress(len(left), path.stem, unit='draw') as progress:
            for key, make in left.items():
                positions = make().positions
                reference = record.trajectory.positions
                found[key] = {
                    'mse': float(position_mse(positions, reference)),
                    'chamfer': float(chamfer(positions, reference)),
                }
                write_json(arguments.json, report)
                progress.update(draw=key, mse=found[key]['mse'])
    print(table(report), end='')
    return 0


if __name__ == '__main__':
    sys.exit(main())
