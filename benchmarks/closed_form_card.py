# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""How far a model is from closed-form mechanics, for spheres of 1 m and of 20 mm.

    python benchmarks/closed_form_card.py --json docs/model/closed_form_card.json

The checks are those of `rigid-gns teacher-card`. For 20 mm the scene of each check is built anew
with r = 0.02 m under the same gravity, given to the simulator as a user would, and what it says is
scaled back (lengths by 50, times by the root of 50). The checks of bounces have both radii by
themselves. Exit code 1 where a check is out of bounds.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
import sys
from typing import Any

import numpy as np
from rigid_gns_core.closed_form import Check, GROUPS, run_checks
from rigid_gns_core.closed_form.bounces import Simulate
from rigid_gns_core.files.strict_json import write_json
from rigid_gns_core.rollout.rollout import load_simulator, Simulator
from rigid_gns_core.running.progress import Progress
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.state import State, Trajectory

BOUND = 0.02
MOMENTUM_BOUND = 1e-5
SMALL = 0.02  # m
OWN_RADII = ('bounce',)  # groups that have both radii by themselves


def engine(simulator: Simulator) -> Simulate:
    """Return the simulator as the checks call it."""

    def simulate(scene: Scene, start: State, steps: int, dt: float) -> Trajectory:
        native = simulator.native_dt(scene)
        if abs(native - dt) > 1e-9 * dt:
            raise ValueError(f'a check asks for steps of {dt:g} s, the model makes {native:g} s')
        return simulator.rollout(
            scene,
            start.positions,
            start.velocities,
            start.angular_velocities,
            steps,
            quaternions=start.quaternions,
        )

    return simulate


def scaled(simulate: Simulate, length: float) -> Simulate:
    """Return an engine that simulates the check `length` times as large, under the same gravity.

    By hand, not by `Similarity`, which is part of what is checked. Masses scale as volumes do.
    """
    time = float(np.sqrt(length))

    def times(value: float | tuple[float, ...], by: float) -> float | tuple[float, ...]:
        return tuple(v * by for v in value) if isinstance(value, tuple) else value * by

    def surface(plane: Plane) -> Plane:
        x, y, z = plane.point
        return replace(
            plane,
            point=(length * x, length * y, length * z),
            length_x=length * plane.length_x,
            length_y=length * plane.length_y,
        )

    def simulate_scaled(scene: Scene, start: State, steps: int, dt: float) -> Trajectory:
        small = replace(
            scene,
            surfaces=tuple(map(surface, scene.surfaces)),
            radius=times(scene.radius, length),
            mass=times(scene.mass, length**3),
        )
        run = simulate(
            small,
            State(
                positions=length * start.positions,
                quaternions=start.quaternions,
                velocities=length / time * start.velocities,
                angular_velocities=start.angular_velocities / time,
            ),
            steps,
            time * dt,
        )
        return Trajectory(
            positions=run.positions / length,
            quaternions=run.quaternions,
            velocities=run.velocities * (time / length),
            angular_velocities=run.angular_velocities * time,
            dt=run.dt / time,
        )

    return simulate_scaled


def bound_of(check: Check) -> float:
    """Return what the model has to keep; the check's own bound is the teacher's."""
    return MOMENTUM_BOUND if 'momentum' in check.name else BOUND


def radius_of(group: str, check: Check, radius: float) -> float:
    """Radius of the spheres of a check [m]."""
    if group in OWN_RADII and radius == 1.0:
        return SMALL if f'r {SMALL:g} m' in check.case else 1.0
    return radius


def card(simulator: Simulator, quick: bool, progress: Progress) -> list[dict[str, Any]]:
    """All checks of a model."""
    simulate = engine(simulator)
    engines = {1.0: simulate, SMALL: scaled(simulate, SMALL)}
    rows = []
    for radius, group in work(quick):
        for check in run_checks(engines[radius], quick, (group,)):
            bound = bound_of(check)
            row = asdict(check) | {
                'group': group,
                'radius': radius_of(group, check, radius),
                'bound': bound,
                'teacher_bound': check.bound,
                'passed': bool(abs(check.error) <= bound),
            }
            # a value that is not a number is none: the rollout diverged
            for name in ('measured', 'error'):
                row[name] = row[name] if np.isfinite(row[name]) else float('inf')
            rows.append(row)
        progress.update(group=group, radius=f'{radius:g} m')
    return rows


def work(quick: bool) -> list[tuple[float, str]]:
    """Radii and groups to run; quick checks of bounces have 1 m alone."""
    small = [group for group in GROUPS if quick or group not in OWN_RADII]
    return [(1.0, group) for group in GROUPS] + [(SMALL, group) for group in small]


def worst(rows: list[dict[str, Any]]) -> dict[tuple[str, float], dict[str, Any]]:
    """Return the worst check of each name and radius."""
    found: dict[tuple[str, float], dict[str, Any]] = {}
    for row in rows:
        key = (row['name'], row['radius'])
        if key not in found or abs(row['error']) > abs(found[key]['error']):
            found[key] = row
    return found


def format_table(models: Mapping[str, list[dict[str, Any]]]) -> str:
    """Markdown: per check the worst error of each model and radius."""
    tables = {name: worst(rows) for name, rows in models.items()}
    columns = [(name, radius) for name in models for radius in (1.0, SMALL)]
    head = ['check (worst case)', 'bound', *(f'{name}, {radius:g} m' for name, radius in columns)]
    lines = [head, ['---'] * len(head)]
    for check in dict.fromkeys(name for table in tables.values() for name, _ in table):
        cells, bound = [], ''
        for name, radius in columns:
            row = tables[name].get((check, radius))
            if row is None:
                cells.append('-')
                continue
            bound = f'{row["bound"]:g}'
            verdict = '' if row['passed'] else f' FAIL ({row["case"]})'
            cells.append(f'{row["error"]:+.1e}{verdict}')
        lines.append([check, bound, *cells])
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines) + '\n'


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--model', nargs='+', default=['laws'], help='shipped names or paths')
    parser.add_argument('--quick', action='store_true', help='fewer cases')
    parser.add_argument('--json', type=Path, metavar='FILE', help='write all checks to this file')
    arguments = parser.parse_args()
    simulators = {name: load_simulator(name) for name in arguments.model}
    models = {}
    total = len(simulators) * len(work(arguments.quick))
    with Progress(total, 'closed forms', unit='group') as progress:
        for name, simulator in simulators.items():
            models[name] = card(simulator, arguments.quick, progress)
    print(format_table(models), end='')
    for name, rows in models.items():
        passed = sum(row['passed'] for row in rows)
        print(f'\n{name}: {passed} of {len(rows)} checks passed')
    if arguments.json is not None:
        report = {
            'quick': arguments.quick,
            'bound': BOUND,
            'momentum_bound': MOMENTUM_BOUND,
            'models': {
                name: {'card': simulators[name].card, 'checks': rows}
                for name, rows in models.items()
            },
        }
        write_json(arguments.json, report)
    return int(any(not row['passed'] for rows in models.values() for row in rows))


if __name__ == '__main__':
    sys.exit(main())
