# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Learning from tracked poses: errors on further bags before and after.

    python benchmarks/learning/learn_from_tracks.py --work runs/tracks \
        --json docs/model/learn_from_tracks.json

Bullet throws spheres of a material that the GNS has not seen into boxes; bags of their poses, with
a tracker's noise and lost frames, are imported; materials for the laws are fitted, the GNS
is fine-tuned, and both predict further bags from tracked starts, as the node does. Errors are to
Bullet's own poses, without noise. Needs pybullet and torch; docs/learn_from_tracks.md has the
table.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict, replace
from pathlib import Path
import shutil
import time
from typing import Any, NamedTuple
import warnings

from bags import BELIEVED, FINE, Lab, STEP, TRACKED, tracked, TRUE, write_bag
import numpy as np
from rigid_gns_core.data.records import Dataset, Record
from rigid_gns_core.files.strict_json import read_json, write_json
from rigid_gns_core.files.tables import format_rows, mean_std, number
from rigid_gns_core.identification.calibrate import calibrate
from rigid_gns_core.prediction.load import load_simulator
from rigid_gns_core.recordings.importing.import_bags import import_bags
from rigid_gns_core.rollout.simulator import Simulator
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.scenes.state import Array, State, Trajectory
from rigid_gns_core.tracking.environment import Environment
from rigid_gns_core.tracking.velocity import estimate_motion
from rigid_gns_core.training.fine_tune import StartingPoint
from rigid_gns_core.training.train import load_recipe, Trainer

HORIZONS = (0.1, 0.3, 1.0, 3.0)  # s
STARTS = (0.6, 1.6, 2.6)  # s, in each of the further bags
WINDOW = 5  # tracked frames from which a start's velocities are estimated
FITTED = 50  # windows to fit materials to


class Further(NamedTuple):
    """A tracked start, and the true centres at the model's steps after it [m]."""

    scene: Scene
    start: State
    truth: Array


def further(truth: list[tuple[Scene, Trajectory]], noise: float, seed: int) -> list[Further]:
    """Tracked starts with noise [m], from each trajectory."""
    found = []
    steps = round(HORIZONS[-1] / (FINE * STEP))
    for index, (scene, trajectory) in enumerate(truth):
        poses = tracked(trajectory, noise, np.random.default_rng([seed, index]))
        for begin in STARTS:
            last = round(begin / FINE)
            frames = np.arange(last - TRACKED * (WINDOW - 1), last + 1, TRACKED)
            seen = poses[frames]
            # the scene is not known, nor the noise: no frame is left out
            motion = estimate_motion(
                FINE * frames,
                seen[..., :3],
                seen[..., 3:],
                environment=Environment.unknown(scene.gravity, 1.0),
                radii=np.ones(seen.shape[1]),
                noise=1e6,
            )
            start = State(
                positions=seen[-1, :, :3],
                quaternions=seen[-1, :, 3:],
                velocities=motion.velocities,
                angular_velocities=motion.angular_velocities,
            )
            after = slice(last, last + steps * STEP + 1, STEP)
            found.append(Further(scene, start, trajectory.positions[after]))
    return found


def errors(simulator: Simulator, starts: list[Further], values: dict[str, float]) -> list[float]:
    """Mean over starts and spheres of the distance to the truth at each horizon [m]."""
    steps = [round(time / (FINE * STEP)) for time in HORIZONS]
    means = []
    for scene, start, truth in starts:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')  # the GNS says that it does not know the material
            predicted = simulator.rollout(replace(scene, **values), steps=steps[-1], **vars(start))
        off = np.linalg.norm(predicted.positions - truth, axis=-1).mean(axis=1)
        means.append(off[steps])
    return np.mean(means, axis=0).tolist()


def fine_tuned(records: list[Record], folder: Path, seed: int, steps: int | None) -> Simulator:
    """The shipped GNS, fine-tuned on records."""
    shutil.rmtree(folder, ignore_errors=True)
    config = replace(load_recipe('gns_finetune'), seed=seed)
    config = config if steps is None else replace(config, steps=steps)
    point = StartingPoint.of('gns')
    origin = f'tracks from {point.name}'
    Trainer(config, point.records(records), [], folder, origin, start=point).run()
    return load_simulator(folder / 'best')


def case(
    labs: tuple[list[tuple[Scene, Trajectory]], list[tuple[Scene, Trajectory]]],
    lab: Lab,
    noise: float,
    seed: int,
    work: Path,
    steps: int | None,
) -> dict[str, Any]:
    """Results for one noise and seed: import, fit, fine-tune, predict."""
    folder = work / f'{1e3 * noise:g}mm_{seed}'
    shutil.rmtree(folder, ignore_errors=True)
    taught, others = labs
    bags = [
        write_bag(folder / f'bag_{index}', scene, trajectory, noise, lab.lost, seed + 10 * index)
        for index, (scene, trajectory) in enumerate(taught)
    ]
    reports, records = [], []
    for bag in bags:  # the boxes differ, and a data set has one scene
        data = folder / 'data' / bag.name
        reports += import_bags([bag], data)
        records += Dataset(data)
    laws, gns = load_simulator('laws'), load_simulator('gns')
    begin = time.process_time()
    fit = calibrate(laws, records, seed=seed, most=FITTED)
    fitted_after = time.process_time() - begin
    starts = further(others, noise, seed)
    result: dict[str, Any] = {
        'noise': noise,
        'seed': seed,
        'imported': {
            'records': sum(len(report['records']) for report in reports),
            'noise_m': float(np.mean([report['noise_m'] for report in reports])),
            'noise_rad': float(np.mean([report['noise_rad'] for report in reports])),
        },
        'fit': asdict(fit),
        'fit_cpu_seconds': fitted_after,
        'errors': {
            'laws, believed materials': errors(laws, starts, BELIEVED),
            'laws, fitted materials': errors(laws, starts, fit.values),
            'laws, true materials': errors(laws, starts, TRUE),
            'GNS as shipped': errors(gns, starts, BELIEVED),
        },
    }
    begin = time.process_time()
    tuned = fine_tuned(records, folder / 'run', seed, steps)
    result['fine_tune_cpu_seconds'] = time.process_time() - begin
    result['errors']['GNS fine-tuned'] = errors(tuned, starts, BELIEVED)
    return result


def table(report: dict[str, Any]) -> str:
    """Mean ± standard deviation (n - 1) over seeds, as Markdown."""
    cases = report['cases']
    head = ['noise', 'model', *(f'{time:g} s' for time in report['horizons'])]
    rows = []
    for noise in sorted({one['noise'] for one in cases}):
        own = [one['errors'] for one in cases if one['noise'] == noise]
        for name in own[0]:
            values = np.array([errors[name] for errors in own])
            means, spread = values.mean(axis=0), [None] * values.shape[1]
            if len(own) > 1:
                spread = values.std(axis=0, ddof=1)
            cells = [mean_std(mean, std, 2) for mean, std in zip(means, spread, strict=True)]
            rows.append([f'{1e3 * noise:g} mm', name, *cells])
    errors_table = format_rows(head, rows, left=(0, 1), markdown=True)
    head = ['noise', 'material', 'true', 'fitted, by seed', 'its own standard errors']
    rows = []
    for noise in sorted({one['noise'] for one in cases}):
        fits = [one['fit']['materials'] for one in cases if one['noise'] == noise]
        for name, true in report['true'].items():
            values = ', '.join(f'{fit[name]["value"]:.4f}' for fit in fits)
            deviations = ', '.join(
                number(fit[name]['error'], 2) if fit[name]['told'] else 'not told' for fit in fits
            )
            rows.append([f'{1e3 * noise:g} mm', name, str(true), values, deviations])
    return f'{errors_table}\n\n{format_rows(head, rows, left=(0, 1), markdown=True)}\n'


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--work', required=True, type=Path, help='folder for bags, data and runs')
    parser.add_argument('--json', required=True, type=Path, metavar='FILE')
    parser.add_argument('--noise', nargs='+', type=float, default=[1e-3, 1e-4, 5e-3], help='[m]')
    parser.add_argument('--seeds', nargs='+', type=int, default=[0, 1, 2])
    parser.add_argument('--bags', type=int, default=8, help='to learn from (default 8, of 8 s)')
    parser.add_argument('--further', type=int, default=6, help='to predict (default 6, of 6 s)')
    parser.add_argument('--steps', type=int, help="of fine-tuning instead of the recipe's")
    arguments = parser.parse_args()
    report: dict[str, Any] = {'cases': []}
    if arguments.json.is_file():  # goes on where it was
        report = read_json(arguments.json)
    report |= {'true': TRUE, 'believed': BELIEVED, 'horizons': HORIZONS, 'starts': STARTS}
    report |= {'bags': arguments.bags, 'further': arguments.further, 'radius': 1.0}
    done = {(one['noise'], one['seed']) for one in report['cases']}
    labs: dict[int, Any] = {}
    for noise in arguments.noise:
        for seed in arguments.seeds:
            if (noise, seed) in done:
                continue
            lab = Lab(arguments.bags, 8.0, seed=1000 + seed)
            if seed not in labs:
                labs[seed] = lab.truth(), Lab(arguments.further, 6.0, seed=2000 + seed).truth()
            report['cases'].append(
                case(labs[seed], lab, noise, seed, arguments.work, arguments.steps)
            )
            write_json(arguments.json, report)
            print(table(report), flush=True)
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
