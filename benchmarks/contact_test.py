"""A model on the thesis' test set and its four new scenes, beside what Bullet differs from itself.

    python benchmarks/contact_test.py --model contact runs/contact_1/model runs/contact_2/model \
        --data data/test --floor data/test_half data/test_twice --ood data/ood \
        --json docs/model/contact_test.json

Several models are seeds of one recipe: the last table is their mean and standard deviation. The
folders of `--floor` are of the same recipe and seed as `--data`, at half and at twice the substeps;
`--ood` holds ood_a.h5, ood_a_half.h5, ood_a_twice.h5 and so on to ood_d. The floor of an error is
the larger of the two that Bullet has to itself. A ratio to it takes no less than a quarter of a
squared radius, for distances half a radius. The columns named Bullet have the floor of each error,
and of each law what the reference has.

The JSON is written after every rollout, so the same command goes on where it was killed.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch

from rigid_gns_core.dataset import Dataset, Record, present_records, read_record
from rigid_gns_core.evaluate import evaluate, read_json, write_json
from rigid_gns_core.hard_cases.case import Case
from rigid_gns_core.hard_cases.checks import measure_laws
from rigid_gns_core.metrics import sphere_penetration, surface_penetration
from rigid_gns_core.models.contact.stepper import ContactStepper
from rigid_gns_core.progress import Progress
from rigid_gns_core.rollout import Rollout, Simulator, load_simulator
from rigid_gns_core.similarity import Similarity
from rigid_gns_core.state import State, Trajectory

REST = 0.01  # m/s: below it a sphere has come to rest
LEAST_FLOOR = 0.25  # r^2: squared errors below half a radius are not told apart
QUICK = (2, 60)  # records and steps
OOD = ('ood_a', 'ood_b', 'ood_c', 'ood_d')
SQUARED = ('mse', 'chamfer')
# key: name in the table; those of `errors` also have a floor and a ratio to it
ERRORS = {
    'mse': 'MSE [m²]',
    'chamfer': 'Chamfer [m²]',
    'predictability_time': 'predictability time [s]',
    'resting_drift': 'drift of spheres at rest [m]',
    'rest_speed_max': 'of spheres that Bullet stops, the fastest at the end [m/s]',
    'rest_share': 'of those, slower than 1 cm/s at the end [%]',
}
LAWS = {
    'energy_gain_with_rotation': 'energy gain',
    'depth_sphere': 'mean depth in spheres [diameters]',
    'depth_ground': 'mean depth in the ground [diameters]',
    'depth_static': 'mean depth in other surfaces [diameters]',
    'deepest_sphere': 'deepest in a sphere [diameters]',
    'deepest_surface': 'deepest in a surface [diameters]',
    'passed_through': 'went through a surface [%]',
    'escaped': 'spheres out of the box',
    'final_speed': 'speed at the end [m/s]',
    'diverged': 'diverged [share of rollouts]',
    'guard_acted': 'islands that the guard slowed, per step',
    'guard_removed': 'energy that the guard took, of that at the start',
}


@dataclass(frozen=True)
class Item:
    """A reference and the two that tell its floor; read when they are needed."""

    group: str
    name: str
    read: Callable[[], tuple[Record, list[Record]]]


def items(data: Path | None, floor: Sequence[Path], ood: Path | None) -> list[Item]:
    """All references, in the order of the tables."""
    found = []

    def of_set(paths: Sequence[Path]) -> Callable[[], tuple[Record, list[Record]]]:
        return lambda: (read_record(paths[0]), [read_record(path) for path in paths[1:]])

    if data is not None:
        folders = [present_records(Dataset(folder).folder) for folder in (data, *floor)]
        for index in sorted(folders[0]):
            if not all(index in folder for folder in folders):
                raise SystemExit(f'a folder of --floor lacks trajectory {index}')
            paths = [folder[index] for folder in folders]
            found.append(Item('test', f'test/{index:04d}', of_set(paths)))
    for name in OOD if ood is not None else ():
        paths = [cast(Path, ood) / f'{name}{ending}.h5' for ending in ('', '_half', '_twice')]
        if missing := [str(path) for path in paths if not path.is_file()]:
            raise SystemExit(f'{missing[0]}: no such file; make it with rigid-gns generate --scene')
        found.append(Item(name, name, of_set(paths)))
    return found


def roll(simulator: Simulator, record: Record, steps: int) -> tuple[Trajectory, Rollout]:
    """A rollout from the record's start; NaN from where it diverges."""
    start = record.trajectory[0]
    rollout = simulator.start(
        record.scene,
        start.positions,
        start.velocities,
        start.angular_velocities,
        quaternions=start.quaternions,
    )
    states: list[State] = [rollout.state]
    try:
        while len(states) <= steps:
            states.append(rollout.step())
    except FloatingPointError as error:
        print(f'{record.name} {record.index}: {error}', file=sys.stderr)
    made = Trajectory.from_states(states, rollout.dt)
    lost = steps + 1 - len(made)
    arrays = {
        name: np.pad(values, ((0, lost), (0, 0), (0, 0)), constant_values=np.nan)
        for name, values in vars(made).items()
        if name != 'dt'
    }
    return Trajectory(dt=made.dt, **arrays), rollout


def errors_of(predicted: Trajectory, reference: Trajectory, report: Mapping[str, Any]) -> dict:
    """The errors that have a floor: those of a report, and of spheres that the reference stops."""
    values = {key: report['errors'].get(key) for key in ERRORS}
    stopped = np.linalg.norm(reference.velocities[-1], axis=1) < REST
    if stopped.any():
        speed = np.linalg.norm(predicted.velocities[-1, stopped], axis=1)
        speed = np.where(np.isfinite(speed), speed, np.inf)
        values['rest_speed_max'] = float(speed.max())
        values['rest_share'] = 100.0 * float(np.mean(speed < REST))
    for step, horizon in report['horizons'].items():
        for key in ('position_error', 'mse'):
            values[f'{key}_{step}'] = horizon[key]
    return values


def floor_of(reference: Record, others: Sequence[Record]) -> dict[str, float | None]:
    """What Bullet at other substeps has of each error, the worse of them; and its own laws."""
    reports: list[dict] = []
    worst: dict[str, float | None] = {}
    start = reference.trajectory.positions[0]
    for other in others:
        again = other.trajectory.window(0, len(reference.trajectory))
        there = again.positions[0]
        if there.shape != start.shape or np.abs(there - start).max() > 1e-6:
            raise SystemExit(f'{reference.name} {reference.index}: its floor has another start')
        report = evaluate(again, reference.trajectory, reference.scene)
        reports.append(errors_of(again, reference.trajectory, report))
        laws = report['laws']['reference']
        worst |= {key: laws[key] for key in LAWS if key in laws}
    for key in reports[0] if reports else ():
        known = [report[key] for report in reports if report[key] is not None]
        pick = min if key in ('predictability_time', 'rest_share') else max
        worst[key] = pick(known) if known else None
    return worst


def least(key: str, radius: np.ndarray) -> float | None:
    """The smallest floor of a squared error, or of a distance; None: it has no ratio."""
    if key.startswith(SQUARED):
        return LEAST_FLOOR * float(np.mean(radius**2))
    return float(np.sqrt(LEAST_FLOOR) * radius.mean()) if key.startswith('position') else None


def measure(
    simulator: Simulator, record: Record, floor: Mapping[str, float | None]
) -> dict[str, float | None]:
    """All measures of a model on a record, by name."""
    reference, scene = record.trajectory, record.scene
    predicted, rollout = roll(simulator, record, reference.steps)
    report = evaluate(predicted, reference, scene, velocities=simulator.velocities)
    values: dict[str, float | None] = errors_of(predicted, reference, report)
    radius = scene.per_sphere('radius', reference.count)
    for key in list(values):
        bound, error, known = least(key, radius), values[key], floor.get(key)
        if bound is not None and error is not None and known is not None:
            values[f'{key}_ratio'] = error / max(known, bound)
    values |= {key: value for key, value in report['laws']['predicted'].items() if key in LAWS}
    lost = report['diverged_at']['predicted']
    whole = predicted.positions[:lost]
    values['deepest_sphere'] = sphere_penetration(whole, radius).deepest
    deepest = [
        # a ground has no other side
        surface_penetration(whole, radius, (plane,), limit=np.inf if i == scene.ground else 1.0)
        for i, plane in enumerate(scene.surfaces)
    ]
    values['deepest_surface'] = max((one.deepest for one in deepest), default=0.0)
    case = Case(record.name, '', scene, record.trajectory[0], reference.steps)
    values['escaped'] = measure_laws(case, predicted, velocities=simulator.velocities)['escaped']
    values['diverged'] = float(lost is not None)
    guard = rollout.stepper.guard if isinstance(rollout.stepper, ContactStepper) else None
    if guard is not None:
        model = cast(ContactStepper, rollout.stepper)
        kinetic, height = guard.energy(first_in_model(simulator, record))
        ground = model.scene.ground
        point = model.scene.surfaces[ground].point if ground is not None else (0.0, 0.0, 0.0)
        height = height + guard.mass * float(np.asarray(point) @ guard.gravity)
        start = float((kinetic + height).sum())
        values['guard_acted'] = guard.acted / max(1, guard.frames)
        values['guard_removed'] = guard.removed / start if start > 0 else None
    return values


def first_in_model(simulator: Simulator, record: Record) -> State:
    """The record's start in the model's units, in which the guard counts."""
    return Similarity.between(record.scene, simulator.units).to_model(record.trajectory[0])


def mean_of(rows: Iterable[Mapping[str, float | None]], spread: int = 0) -> dict[str, Any]:
    """Mean, standard deviation, count and number of infinite values of each measure.

    The mean is of the finite ones. `spread` 1: the deviation of a sample, as of seeds.
    """
    rows = list(rows)
    summary = {}
    for key in {key: None for row in rows for key in row}:
        values = np.array([row[key] for row in rows if row.get(key) is not None], dtype=float)
        finite = values[np.isfinite(values)]
        if not len(values):
            continue
        summary[key] = {
            'mean': float(finite.mean()) if len(finite) else float('inf'),
            'std': float(finite.std(ddof=spread)) if len(finite) > spread else 0.0,
            'count': len(values),
            'infinite': len(values) - len(finite),
        }
    return summary


def summarise(report: dict[str, Any]) -> dict[str, Any]:
    """Means over the records of each group: of each model, of the floor, and over the models."""
    groups: dict[str, list[str]] = {}
    for name in report['floors']:
        groups.setdefault(name.split('/')[0], []).append(name)

    def by_group(rows: Mapping[str, Any]) -> dict[str, Any]:
        return {
            group: mean_of(rows[name] for name in names if name in rows)
            for group, names in groups.items()
        }

    models = {name: by_group(entry['records']) for name, entry in report['models'].items()}
    over_models: dict[str, Any] = {}
    for group in groups:
        means = [
            {key: entry['mean'] for key, entry in model[group].items()} for model in models.values()
        ]
        over_models[group] = mean_of(means, spread=1)
    return {'floor': by_group(report['floors']), 'models': models, 'over_models': over_models}


def number(value: float) -> str:
    """Three significant digits."""
    return '0' if value == 0 else f'{value:.3g}'.replace('e-0', 'e-').replace('e+0', 'e')


def cell(entry: Mapping[str, Any] | None) -> str:
    """Mean ± standard deviation."""
    if entry is None:
        return '-'
    text = number(entry['mean'])
    text += f' ± {number(entry["std"])}' if entry['std'] else ''
    return text + (f' ({entry["infinite"]} of {entry["count"]} inf)' if entry['infinite'] else '')


def format_table(summary: Mapping[str, Any], floor: Mapping[str, Any]) -> str:
    """Markdown: one line per measure, two columns per group: the model, and Bullet."""
    steps = [key.removeprefix('mse_') for key in next(iter(summary.values())) if key[4:].isdigit()]
    names = dict(ERRORS)
    for step in steps:
        names[f'position_error_{step}'] = f'position error at step {step} [m]'
        names[f'mse_{step}'] = f'MSE at step {step} [m²]'
    for key in [key for key in names if key.startswith((*SQUARED, 'position'))]:
        names[f'{key}_ratio'] = f'{names[key].rpartition(" [")[0]} / floor'
    names |= LAWS
    head = ['']
    for group in summary:
        head += [group, 'Bullet']
    lines = [head, ['---'] * len(head)]
    for key, name in names.items():
        cells = [name]
        for group, values in summary.items():
            cells += [cell(values.get(key)), cell(floor[group].get(key))]
        if any(text != '-' for text in cells[1:]):
            lines.append(cells)
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines) + '\n'


def save(path: Path | None, report: dict[str, Any]) -> None:
    """Write the report whole, or leave the old one."""
    if path is not None:
        part = path.with_suffix('.part')
        write_json(part, report)
        os.replace(part, path)


def resume(path: Path | None, settings: dict[str, Any]) -> dict[str, Any]:
    """What an earlier run has done."""
    report: dict[str, Any] = {'settings': settings, 'floors': {}, 'models': {}}
    if path is None or not path.is_file():
        return report
    known = read_json(path)
    if known.get('settings') != settings:
        raise SystemExit(f'{path} is of other settings {known.get("settings")}; name another file')
    return known


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--model', nargs='+', default=['contact'], help='shipped names or paths')
    parser.add_argument('--data', type=Path, metavar='FOLDER', help="Bullet's trajectories")
    parser.add_argument('--floor', type=Path, nargs=2, default=(), metavar=('HALF', 'TWICE'))
    parser.add_argument('--ood', type=Path, metavar='FOLDER', help='ood_a.h5 to ood_d_twice.h5')
    parser.add_argument('--steps', type=int, help='default: as long as the data')
    parser.add_argument('--guard', action=argparse.BooleanOptionalAction, default=True)
    parser.add_argument('--threads', type=int, default=1, help='of torch (default: 1)')
    parser.add_argument('--quick', action='store_true', help='few records and steps')
    parser.add_argument('--json', type=Path, metavar='FILE', help='numbers, and where to go on')
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    wanted = items(arguments.data, arguments.floor, arguments.ood)
    limit = arguments.steps
    if arguments.quick:
        wanted, limit = wanted[: QUICK[0]], limit or QUICK[1]
    if not wanted:
        raise SystemExit('nothing to do: give --data, --ood or both')
    options: dict[str, Any] = {} if arguments.guard else {'guard': False}
    simulators = {name: load_simulator(name, **options) for name in arguments.model}
    sources = {'data': arguments.data, 'half': None, 'twice': None, 'ood': arguments.ood}
    sources |= dict(zip(('half', 'twice'), arguments.floor, strict=False))
    settings = {
        'steps': limit,
        'guard': arguments.guard,
        'quick': arguments.quick,
        **{key: None if path is None else str(path) for key, path in sources.items()},
    }
    report = resume(arguments.json, settings)
    for name, simulator in simulators.items():
        weights = simulator.card['weights_sha256']
        entry = report['models'].setdefault(name, {'weights_sha256': weights, 'records': {}})
        if entry['weights_sha256'] != weights:
            raise SystemExit(f'{arguments.json}: holds other weights of {name}; name another file')

    done = sum(
        item.name in report['models'][name]['records'] for item in wanted for name in simulators
    )
    with Progress(
        len(wanted) * len(simulators), 'contact test', unit='rollout', initial=done
    ) as progress:
        for item in wanted:
            left = [n for n in simulators if item.name not in report['models'][n]['records']]
            if not left:
                continue
            record, others = item.read()
            steps = min(
                limit or record.trajectory.steps,
                *(one.trajectory.steps for one in (record, *others)),
            )
            record = cut(record, steps)
            floor = report['floors'].get(item.name)
            if floor is None:
                floor = report['floors'][item.name] = floor_of(record, others)
            for name in left:
                values = measure(simulators[name], record, floor)
                report['models'][name]['records'][item.name] = values
                report['summary'] = summarise(report)
                save(arguments.json, report)
                progress.update(record=item.name, mse=cast(float, values['mse']))
    report['summary'] = summarise(report)
    save(arguments.json, report)
    summary = report['summary']
    for name in simulators:
        print(f'\n{name}: mean ± standard deviation over records\n')
        print(format_table(summary['models'][name], summary['floor']), end='')
    if len(report['models']) > 1:
        count = len(report['models'])
        print(f'\nMean ± standard deviation over {count} models (n - 1)\n')
        print(format_table(summary['over_models'], summary['floor']), end='')
    return 0


def cut(record: Record, steps: int) -> Record:
    """The first steps of a record."""
    return replace(record, trajectory=record.trajectory.window(0, steps + 1))


if __name__ == '__main__':
    sys.exit(main())
