"""What each thing that a scene may need costs, and what it brings: docs/only_what_is_needed.md.

    python benchmarks/only_what_is_needed.py --model contact --data data/test

Each row compares the model as it is with one change. Both run in turns from the same state, so that
what else the machine does meets both alike; times are medians over the repeats. Without --quick the
page and docs/model/only_what_is_needed.json are written; with it only what is named.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import torch

from rigid_gns_core.dataset import Dataset, Record
from rigid_gns_core.evaluate import write_json
from rigid_gns_core.metrics import horizon_metrics
from rigid_gns_core.models.contact import step, stepper
from rigid_gns_core.models.contact.candidates import Candidates, find_candidates
from rigid_gns_core.models.contact.stepper import ContactStepper
from rigid_gns_core.progress import Progress
from rigid_gns_core.rollout import Rollout, Simulator, load_simulator
from rigid_gns_core.sampling import StartRecipe, load_scene, sample_start
from rigid_gns_core.scene import Plane, Scene
from rigid_gns_core.simulators import ContactOptions, ContactSimulator
from rigid_gns_core.state import State

DOCS = Path(__file__).resolve().parents[1] / 'docs'
HORIZON = 30  # steps at which errors are taken
MATERIALS: dict[str, Any] = {
    'restitution': 0.7746,
    'friction': 0.5,
    'rolling_friction': 0.03,
}  # as box_154
PER_SPHERE = ('radius', 'mass', 'restitution', 'friction', 'rolling_friction')


@dataclass(frozen=True)
class Start:
    """Where a row begins: a scene, a start, and steps that are made before anything is measured."""

    scene: Scene
    state: State
    skip: int = 0


@dataclass(frozen=True)
class Change:
    """What differs from the model as it is: options, the scene, or what `patch` replaces."""

    options: dict[str, Any] = field(default_factory=dict)
    scene: Callable[[Scene, int], Scene] = lambda scene, _: scene
    patch: Callable[[], Any] | None = None

    @contextmanager
    def applied(self) -> Iterator[None]:
        """While the patch holds."""
        if self.patch is None:
            yield
            return
        with self.patch():
            yield


@dataclass(frozen=True)
class Row:
    """One comparison.

    usual, other: what the model does as it is, and with the change; text: the paragraph of the
    page; goes_on: blocks follow each other instead of beginning anew, for what builds up in time.
    """

    name: str
    start: str
    usual: str
    other: str
    change: Change
    text: str
    goes_on: bool = False


# -- changes -------------------------------------------------------------------------------------


def _no_search() -> Any:
    none = np.zeros(0, dtype=np.int64)
    nothing = Candidates(none, none, none, none, np.zeros(0))
    return mock.patch.object(ContactStepper, '_candidates', return_value=nothing)


def _all_shared() -> Any:
    return mock.patch.object(
        step, '_shared', lambda _, contacts: torch.ones(len(contacts), dtype=torch.bool)
    )


def _always_substeps() -> Any:
    one = np.zeros(1, dtype=np.int64)

    def find(*arguments: Any) -> Candidates:
        found = find_candidates(*arguments)
        # a sphere and a plane that are far apart: the frame is cut, and finds no contact
        return found if len(found) else Candidates(one[:0], one[:0], one, one, np.ones(len(one)))

    return mock.patch.object(stepper, 'find_candidates', find)


def _ground_only(scene: Scene, _: int) -> Scene:
    return replace(scene, surfaces=(scene.surfaces[scene.ground or 0],))


def _no_rolling(scene: Scene, _: int) -> Scene:
    return replace(scene, rolling_friction=0.0)


def _tuples(scene: Scene, count: int) -> Scene:
    return replace(scene, **{n: tuple(scene.per_sphere(n, count).tolist()) for n in PER_SPHERE})


NETWORK = Change(options={'network': False})
ROUNDS = Change(patch=_all_shared)
SLEEP = Change(options={'sleep': False})
GUARD = Change(options={'guard': False})
ROWS = (
    Row(
        'search, nothing near',
        'air',
        'search for contacts',
        'no search',
        Change(patch=_no_search),
        'Spheres in the air are moved along exact parabolas. All that contacts cost there is the '
        'look around whether any may happen in the frame.',
    ),
    Row(
        'substeps, nothing near',
        'air',
        'none',
        'K in every frame',
        Change(patch=_always_substeps),
        'A frame is cut into substeps only where the look around found something that may touch. '
        'Here they are forced on a scene where nothing does.',
    ),
    Row(
        'network, isolated contacts',
        'bounce',
        'with network',
        'law alone',
        NETWORK,
        'A contact that shares no body with another has an exact solution, so the network is not '
        'asked where spheres bounce without meeting each other.',
    ),
    Row(
        'network, box',
        'box',
        'with network',
        'law alone',
        NETWORK,
        'Early in the box a few contacts share a sphere. The network is asked for these alone.',
    ),
    Row(
        'network, pile',
        'pile',
        'with network',
        'law alone',
        NETWORK,
        'In a pile nearly all contacts share spheres, so this is what the network costs at most.',
    ),
    Row(
        'rounds, isolated contacts',
        'bounce',
        'one for an isolated contact',
        'M for all, with network',
        ROUNDS,
        'An isolated contact takes one round of the law; only contacts that share spheres take '
        'all M rounds, each with the network. Here every contact is treated as if it did.',
    ),
    Row(
        'rounds, box',
        'box',
        'one for an isolated contact',
        'M for all, with network',
        ROUNDS,
        'The same early in the box, where a few contacts do share a sphere.',
    ),
    Row(
        'sleep, box that came to rest',
        'settled',
        'islands at rest sleep',
        'all stay awake',
        SLEEP,
        'Spheres that have come to rest sleep until something comes near: no contact of theirs is '
        'solved.',
        goes_on=True,
    ),
    Row(
        'sleep, pile',
        'settled pile',
        'islands at rest sleep',
        'all stay awake',
        SLEEP,
        'A pile sleeps as a whole once all of it is quiet. What is saved is all its contacts.',
        goes_on=True,
    ),
    Row(
        'guard, box',
        'box',
        'guard on',
        'guard off',
        GUARD,
        'The guard adds up the energy of each island after each frame. It acts where that rose.',
    ),
    Row(
        'guard, pile',
        'pile',
        'guard on',
        'guard off',
        GUARD,
        'The same for a pile that falls together, where there is most to guard.',
    ),
    Row(
        'walls',
        'bounce',
        'ground and four walls',
        'ground alone',
        Change(scene=_ground_only),
        'Walls far from all spheres cost the look whether one is near. The error says what happens '
        'where they are left out although spheres reach them.',
    ),
    Row(
        'rolling friction',
        'roll',
        'with rolling friction',
        'without',
        Change(scene=_no_rolling),
        'Where no contact has rolling friction, its part of the law is not computed. The error '
        'says what it costs to leave it out of a scene that has it.',
    ),
    Row(
        'properties per sphere',
        'box',
        'one number for all',
        'the same, one per sphere',
        Change(scene=_tuples),
        'Radius, mass and materials are arrays inside in any case, so one number for all spheres '
        'and one for each take the same way.',
    ),
)


# -- scenes --------------------------------------------------------------------------------------


def _lattice(spheres: int, pitch: float, height: tuple[float, float], seed: int) -> np.ndarray:
    """Centres on a square lattice around the origin [m], shape (spheres, 3)."""
    side = int(np.ceil(np.sqrt(spheres)))
    across = np.stack(np.divmod(np.arange(spheres), side), axis=1) - (side - 1) / 2
    return np.c_[pitch * across, np.random.default_rng(seed).uniform(*height, spheres)]


def make_starts(quick: bool) -> dict[str, Start]:
    """Starts by name; quick ones are smaller."""
    spheres = 40 if quick else 154
    box = Plane.box(400.0, 400.0)
    wide = Scene(surfaces=box, **MATERIALS)
    draw = np.random.default_rng(1)
    rolling = _lattice(spheres, 12.0, (1.0, 1.0), 0)
    speed = np.c_[draw.uniform(-1.0, 1.0, (spheres, 2)), np.zeros(spheres)]
    scene, recipe = load_scene('box_154')
    state = sample_start(scene, replace(recipe, spheres=spheres) if quick else recipe)
    heap = Scene(surfaces=Plane.box(8.0, 8.0), **MATERIALS)
    pile = sample_start(heap, StartRecipe(spheres=12 if quick else 64, height=(0.0, 60.0)))
    return {
        'air': Start(wide, State(positions=_lattice(spheres, 20.0, (150.0, 250.0), 0))),
        'bounce': Start(wide, State(positions=_lattice(spheres, 5.0, (2.0, 4.0), 0)), 3),
        'roll': Start(
            wide,
            State(
                positions=rolling,
                velocities=speed,
                angular_velocities=np.cross([0.0, 0.0, 1.0], speed),
            ),
        ),
        'box': Start(scene, state, 15),
        'pile': Start(heap, pile, 30 if quick else 60),
        'settled': Start(scene, state, 30 if quick else 300),
        'settled pile': Start(heap, pile, 100 if quick else 400),
    }


def describe(starts: dict[str, Start]) -> dict[str, str]:
    """Starts in words, for the page."""
    box, pile = len(starts['box'].state), len(starts['pile'].state)
    many = len(starts['air'].state)
    return {
        'air': f'{many} spheres fall, 20 m from each other and over 100 m above the ground',
        'bounce': f'{many} spheres, 5 m from each other, bounce in the middle of a box of 400 m',
        'roll': f'{many} spheres roll on the ground without meeting',
        'box': f'the box of 60 m with {box} spheres, from step {starts["box"].skip}',
        'pile': f'{pile} spheres fall into a shaft of 8 m, from step {starts["pile"].skip}',
        'settled': f'the box of 60 m with {box} spheres, from step {starts["settled"].skip}',
        'settled pile': f'the shaft of 8 m, from step {starts["settled pile"].skip}',
    }


# -- measuring -----------------------------------------------------------------------------------


class Bench:
    """Measures rows of one model.

    Args:
        model: Name or path.
        starts: See `make_starts`.
        records: Bullet's, for errors; none: no such errors.
        repeats: Turns of each of the two.
        block: Steps of a turn.
    """

    def __init__(
        self, model: str, starts: dict[str, Start], records: list[Record], repeats: int, block: int
    ) -> None:
        self.model, self.starts, self.records = model, starts, records
        self.repeats, self.block = repeats, block
        self._errors: dict[str, list[float]] = {}
        self.load = cache(self._load)
        self.before = cache(self._before)

    def _load(self, options: tuple[tuple[str, Any], ...]) -> Simulator:
        simulator = load_simulator(self.model)
        if not isinstance(simulator, ContactSimulator):
            raise SystemExit(f'{self.model} is a {simulator.kind}, expected a contact model')
        # not through load_simulator, to whose class an option `network` is a second network
        simulator.options = ContactOptions(**dict(options))
        return simulator

    def _begin(self, change: Change, scene: Scene, state: State) -> Rollout:
        simulator: Simulator = self.load(tuple(change.options.items()))
        return simulator.start(
            change.scene(scene, len(state)),
            state.positions,
            state.velocities,
            state.angular_velocities,
            quaternions=state.quaternions,
        )

    def _before(self, name: str) -> State:
        """The state of a start after its first steps, as the model makes them."""
        start = self.starts[name]
        rollout = self._begin(Change(), start.scene, start.state)
        for _ in range(start.skip):
            rollout.step()
        return rollout.state

    def _ready(self, row: Row, change: Change) -> Rollout:
        """A rollout to be timed; what its first step does once is behind it."""
        start = self.starts[row.start]
        if row.goes_on:
            rollout = self._begin(change, start.scene, start.state)
            steps = start.skip
        else:
            rollout = self._begin(change, start.scene, self.before(row.start))
            steps = 1
        with change.applied():
            for _ in range(steps):
                rollout.step()
        return rollout

    def measure(self, row: Row) -> dict[str, Any]:
        """Times, difference and errors of one row."""
        changes = {'usual': Change(), 'other': row.change}
        kept = {key: self._ready(row, change) for key, change in changes.items() if row.goes_on}
        times: dict[str, list[float]] = {key: [] for key in changes}
        asleep: dict[str, float] = {}
        for turn in range(-1, self.repeats):  # the first warms up
            # each is first in every other turn
            for key in list(changes)[:: 1 if turn % 2 else -1]:
                rollout = kept[key] if row.goes_on else self._ready(row, changes[key])
                with changes[key].applied():
                    begin = time.perf_counter()
                    for _ in range(self.block):
                        rollout.step()
                    spent = 1e3 * (time.perf_counter() - begin) / self.block
                if turn >= 0:
                    times[key].append(spent)
                sleepers = getattr(rollout.stepper, 'sleepers', None)
                asleep[key] = 0.0 if sleepers is None else float(sleepers.asleep.mean())
        both = np.array([times['usual'], times['other']])
        low, high = np.quantile(both, [0.1, 0.9], axis=1)
        result: dict[str, Any] = {
            'start': row.start,
            'spheres': len(self.starts[row.start].state),
            'usual': row.usual,
            'other': row.other,
            'ratio': float(np.median(both[1] / both[0])),
            'difference': self._difference(row),
        }
        for index, key in enumerate(changes):
            result[f'{key}_ms'] = float(np.median(both[index]))
            result[f'{key}_p10_ms'], result[f'{key}_p90_ms'] = float(low[index]), float(high[index])
            result[f'{key}_asleep'] = asleep[key]
            if self.records:
                errors = self._bullet_errors(
                    changes[key], '' if key == 'usual' else row.name.split(',')[0]
                )
                result[f'{key}_error'] = float(np.mean(errors))
        return result

    def _difference(self, row: Row) -> float:
        """Mean distance between the two after 30 steps from the row's start [m]."""
        scene, state = self.starts[row.start].scene, self.before(row.start)
        ends = []
        for change in (Change(), row.change):
            with change.applied():
                rollout = self._begin(change, scene, state)
                for _ in range(HORIZON):
                    rollout.step()
            ends.append(rollout.state.positions)
        return float(np.linalg.norm(ends[0] - ends[1], axis=1).mean())

    def _bullet_errors(self, change: Change, key: str) -> list[float]:
        """Mean distance to Bullet after 30 steps, of each record [m]; kept by `key`.

        Rows whose names begin alike make the same change.
        """
        if key not in self._errors:
            self._errors[key] = []
            for record in self.records:
                truth, start = record.trajectory.window(0, HORIZON + 1), record.trajectory[0]
                scene = change.scene(record.scene, len(start))
                simulator: Simulator = self.load(tuple(change.options.items()))
                with change.applied():
                    predicted = simulator.rollout(
                        scene,
                        start.positions,
                        start.velocities,
                        start.angular_velocities,
                        HORIZON,
                        quaternions=start.quaternions,
                    )
                horizons = horizon_metrics(predicted, truth, record.scene, [HORIZON])
                self._errors[key].append(horizons[HORIZON]['position_error'])
        return self._errors[key]


def machine() -> dict[str, Any]:
    name = platform.machine()
    cpuinfo = Path('/proc/cpuinfo')
    if cpuinfo.is_file():
        names = [line for line in cpuinfo.read_text().splitlines() if line.startswith('model name')]
        name = names[0].split(':')[1].strip() if names else name
    return {
        'cpu': name,
        'cores': os.cpu_count(),
        'load': round(os.getloadavg()[0], 1),
        'threads': torch.get_num_threads(),
        'python': platform.python_version(),
        'torch': torch.__version__,
    }


# -- the page ------------------------------------------------------------------------------------


def number(value: float) -> str:
    """Two significant digits."""
    return '0' if value == 0 else f'{float(f"{value:.2g}"):g}'.replace('e-0', 'e-')


def format_table(report: dict[str, Any]) -> str:
    """Markdown: one line per row."""
    has_errors = report['records'] > 0
    head = ['what', 'spheres', 'as it is', 'ms', 'changed', 'ms', 'times as long', 'differs [m]']
    head += ['error [m]', 'error, changed [m]'] if has_errors else []
    lines = [head, ['---'] * len(head)]
    for name, row in report['rows'].items():
        line = [name, str(row['spheres']), row['usual'], number(row['usual_ms']), row['other']]
        line += [number(row['other_ms']), f'{row["ratio"]:.2f}', number(row['difference'])]
        if has_errors:
            line += [number(row['usual_error']), number(row['other_error'])]
        lines.append(line)
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines) + '\n'


def paragraph(name: str, text: str, row: dict[str, Any], scenes: dict[str, str]) -> str:
    """What a row compares, and what came out."""
    times = f'{number(row["usual_ms"])} ms a step as it is ({row["usual"]})'
    times += f', {number(row["other_ms"])} ms changed ({row["other"]}): {row["ratio"]:.2f} times.'
    end = 'the two are the same' if row['difference'] == 0 else ''
    end = end or f'the two are {number(row["difference"])} m apart'
    found = f'{times} After {HORIZON} steps {end}.'
    if row['usual_asleep']:
        found += f' {100 * row["usual_asleep"]:.0f} % of the spheres sleep.'
    if 'usual_error' in row:
        found += f' From Bullet: {number(row["usual_error"])} m as it is, '
        found += f'{number(row["other_error"])} m changed.'
    return f'**{name[0].upper()}{name[1:]}.** {text} Scene: {scenes[row["start"]]}. {found}\n'


def page(report: dict[str, Any]) -> str:
    """docs/only_what_is_needed.md."""
    about = report['machine']
    texts = {row.name: row.text for row in ROWS}
    body = '\n'.join(
        paragraph(name, texts[name], row, report['starts']) for name, row in report['rows'].items()
    )
    bullet = (
        f'\n"Error" is the mean distance to Bullet at step {HORIZON} over {report["records"]} '
        f'records of {report["data"]}, to whose scenes the same change was made.'
        if report['records']
        else ''
    )
    return f"""# Only what is needed

A scene pays for what it has: contacts, walls, rolling friction, piles. What each of them costs a
step, what the model would cost if it always did everything, and what is lost where it is left out.

{format_table(report)}
{body}
## How it was measured

Model `{report['model']}`, {about['cpu']}, {about['cores']} cores, load {about['load']},
torch {about['torch']} with {about['threads']} thread(s). Each row: {report['repeats']} turns of
{report['block']} steps of either side, in alternating order from the same state; those of sleep
go on from where they were. "ms" is the median of a step's time, "times as long" the median of the
ratios of neighbouring turns, changed over as it is. "Differs" is the mean distance between both
after {HORIZON} steps.{bullet}

```sh
{report['command']}
```

All numbers: [model/only_what_is_needed.json](model/only_what_is_needed.json).
"""


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--model', default='contact', help='shipped name or path')
    parser.add_argument('--data', type=Path, metavar='FOLDER', help="Bullet's, for errors")
    parser.add_argument('--rows', nargs='+', metavar='WORD', help='only rows that begin with these')
    parser.add_argument('--repeats', type=int, help='turns of each side (default: 15)')
    parser.add_argument('--block', type=int, help='steps of a turn (default: 10)')
    parser.add_argument('--threads', type=int, default=1, help='of torch (default: 1)')
    parser.add_argument('--quick', action='store_true', help='few spheres, turns and records')
    parser.add_argument('--json', type=Path, metavar='FILE')
    parser.add_argument('--page', type=Path, metavar='FILE')
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    quick = arguments.quick
    rows = [r for r in ROWS if not arguments.rows or r.name.startswith(tuple(arguments.rows))]
    if not rows:
        raise SystemExit(f'no such rows; there are: {", ".join(row.name for row in ROWS)}')
    repeats = arguments.repeats or (2 if quick else 15)
    block = arguments.block or (3 if quick else 10)
    records = []
    if arguments.data is not None:
        records = list(islice(Dataset(arguments.data), 1 if quick else None))
        records = [
            replace(record, trajectory=record.trajectory.window(0, HORIZON + 1))
            for record in records
        ]
    starts = make_starts(quick)
    bench = Bench(arguments.model, starts, records, repeats, block)
    report: dict[str, Any] = {
        'command': ' '.join(['python', 'benchmarks/only_what_is_needed.py', *sys.argv[1:]]),
        'model': arguments.model,
        'weights_sha256': bench.load(()).card['weights_sha256'],
        'data': None if arguments.data is None else arguments.data.name,
        'records': len(records),
        'quick': quick,
        'repeats': repeats,
        'block': block,
        'machine': machine(),
        'starts': describe(starts),
        'rows': {},
    }
    with Progress(len(rows), 'only what is needed', unit='row') as progress:
        for row in rows:
            with warnings.catch_warnings():
                warnings.simplefilter('ignore', UserWarning)  # leaving things out is meant
                report['rows'][row.name] = bench.measure(row)
            progress.update(ratio=report['rows'][row.name]['ratio'])
    print(format_table(report), end='')
    whole = not quick and not arguments.rows
    json = arguments.json or (DOCS / 'model' / 'only_what_is_needed.json' if whole else None)
    file = arguments.page or (DOCS / 'only_what_is_needed.md' if whole else None)
    if json is not None:
        write_json(json, report)
    if file is not None:
        file.write_text(page(report), encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())
