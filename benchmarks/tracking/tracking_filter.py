# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Errors of velocities and of data association from noisy poses, against Bullet's states.

    python benchmarks/tracking/tracking_filter.py --json docs/model/tracking_filter.json

Windows of 2 to 10 frames of three scenes with noise added are given to the estimator of
rigid_gns_core.tracking.velocity and to a plain fit; then whole runs with shuffled order, lost and
false poses and late, lost and repeated frames go through rigid_gns_core.tracking.window. Needs
pybullet. Prints the tables of docs/tracking.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
import os
from pathlib import Path
import time
from typing import Any

from matching import cost_of_a_frame, follow
import numpy as np
from plain import plain_fit
from rigid_gns_core.files.strict_json import read_json, write_json
from rigid_gns_core.files.tables import format_rows, number
from rigid_gns_core.running.machine import cpu_name
from rigid_gns_core.scenes.state import Array
from rigid_gns_core.tracking.environment import Environment
from rigid_gns_core.tracking.velocity import estimate_motion
from truth import box, table, Truth

NOISE = (5e-3, 1.5e-2, 5e-2, 0.15, 0.5)  # radii: 0.1 to 10 mm for 20 mm
FINE = (1e-4, 3e-4, 1e-3, 3e-3)  # radii: 0.1 to 3 mm for 1 m
WINDOWS = tuple(range(2, 11))
CLASSES = ('flight', 'bounce', 'touching', 'at impact')


def classes(truth: Truth, frame: int, window: int, noise: float, gap: Array) -> Array:
    """Class of each sphere at a frame: index into CLASSES, shape (n,)."""
    before = slice(frame - window + 1, frame)
    struck, bounced = truth.struck[before].any(axis=0), truth.bounced[before].any(axis=0)
    beside = truth.bounced[max(frame - 1, 0) : frame + 1].any(axis=0)
    kinds = np.where(bounced, 1, np.where(struck, 2, 0))
    # within the noise, whether a contact has happened cannot be decided
    return np.where(beside & (gap[frame] < 3.0 * noise), 3, kinds)


def gaps(truth: Truth) -> Array:
    """Gap between each sphere and the nearest sphere or surface [m], shape (frames, n)."""
    surfaces = Environment.of(truth.scene).surfaces
    found = []
    for places in truth.trajectory.positions:
        apart = np.linalg.norm(places[:, None] - places, axis=-1) - 2.0 * truth.radius
        np.fill_diagonal(apart, np.inf)
        local = np.einsum('nkc,kdc->nkd', places[:, None] - surfaces.points, surfaces.axes)
        inside = (np.abs(local[..., :2]) <= surfaces.half_lengths).all(axis=-1)
        beside = np.where(inside, np.abs(local[..., 2] - truth.radius), np.inf)
        found.append(np.minimum(np.abs(apart).min(axis=1), beside.min(axis=1)))
    return np.array(found)


def velocity_errors(truths: list[Truth], noise: float, every: int) -> list[dict[str, Any]]:
    """Rms errors of both estimates by class, a row for each window length."""
    rows = []
    near = [gaps(truth) for truth in truths]
    for window in WINDOWS:
        squares: dict[str, list[Array]] = {'filter': [], 'plain': [], 'filter spin': []}
        squares |= {'plain spin': [], 'place': [], 'claimed': []}
        kinds = []
        for seed, (truth, gap) in enumerate(zip(truths, near, strict=True)):
            states, scene = truth.trajectory, truth.scene
            environment, gravity = Environment.of(scene), np.asarray(scene.gravity)
            rng = np.random.default_rng([seed, window])
            seen = states.positions + rng.normal(0.0, noise, states.positions.shape)
            radii = np.full(states.count, truth.radius)
            for frame in range(10, len(states), every):
                part = slice(frame - window + 1, frame + 1)
                given = states.times[part], seen[part], states.quaternions[part]
                motion = estimate_motion(*given, environment=environment, radii=radii, noise=noise)
                velocities, spins = plain_fit(*given, gravity)
                true, turning = states.velocities[frame], states.angular_velocities[frame]
                for name, off in (
                    ('filter', motion.velocities - true),
                    ('plain', velocities - true),
                    ('filter spin', motion.angular_velocities - turning),
                    ('plain spin', spins - turning),
                    ('place', motion.positions - states.positions[frame]),
                ):
                    squares[name].append(np.square(off).sum(axis=-1))
                squares['claimed'].append(3.0 * motion.errors**2)
                kinds.append(classes(truth, frame, window, noise, gap))
        kind = np.concatenate(kinds)
        row: dict[str, Any] = {'window': window}
        row['counts'] = {name: int((kind == i).sum()) for i, name in enumerate(CLASSES)}
        for name, parts in squares.items():
            whole = np.concatenate(parts)
            row[name] = {
                'all': _rms(whole[kind != 3]),
                **{one: _rms(whole[kind == i]) for i, one in enumerate(CLASSES)},
                'bounce, median': _median(whole[kind == 1]),
            }
        row['place'] = {'all': row['place']['all']}
        row['claimed'] = {name: row['claimed'][name] for name in ('flight', 'bounce')}
        rows.append(row)
    return rows


def _rms(squares: Array) -> float | None:
    finite = squares[np.isfinite(squares)]
    return float(f'{np.sqrt(finite.mean()):.4g}') if len(finite) else None


def _median(squares: Array) -> float | None:
    return float(f'{np.sqrt(np.median(squares)):.4g}') if len(squares) else None


def velocity_table(report: dict[str, Any]) -> str:
    """Errors by scene and noise for a few windows, as Markdown."""
    shown = (2, 3, 4, 5, 6, 8, 10)
    head = ['noise', 'spheres', *(f'{w} frames' for w in shown)]
    lines = []
    for scene in report['velocity']:
        lines += [
            f'\n**{scene["scene"]}**, velocity error in m/s, rms: filter / plain fit\n',
            format_rows(head, _velocity_rows(scene['cases'], shown), left=(0, 1), markdown=True),
        ]
    return '\n'.join(lines) + '\n'


def _velocity_rows(cases: list[dict[str, Any]], shown: Sequence[int]) -> Iterator[list[str]]:
    for case in cases:
        rows = {row['window']: row for row in case['rows']}
        for kind in ('all', 'flight', 'bounce', 'bounce, median', 'touching'):
            if rows[shown[-1]]['filter'][kind] is None:
                continue
            cells = [
                ' / '.join(number(rows[w][name][kind], 2) for name in ('filter', 'plain'))
                for w in shown
            ]
            yield [f'{1e3 * case["noise"]:g} mm' if kind == 'all' else '', kind, *cells]


def matching_table(report: dict[str, Any]) -> str:
    """Errors of data association, as Markdown."""
    counts = ('sphere_frames', 'switches', 'untracked', 'false')
    head = ['scene', 'noise', 'tracker', 'sphere-frames', *counts[1:], 'noise told']
    rows = [
        [row['scene'], f'{1e3 * row["noise"]:g} mm', row['tracker']]
        + [str(row[name]) for name in counts]
        + [f'{number(1e3 * row["noise_told"])} mm']
        for row in report['matching']
    ]
    return format_rows(head, rows, left=(0, 2), markdown=True) + '\n'


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--json', required=True, type=Path, metavar='FILE')
    parser.add_argument(
        '--tables', action='store_true', help='print those of FILE, measure nothing'
    )
    arguments = parser.parse_args()
    if not arguments.tables:
        begin = time.perf_counter()
        scenes = [
            ([box()], (*FINE, *NOISE), 4),
            ([table(71, seed=seed) for seed in range(4)], NOISE, 2),
            ([table(240, seed=seed) for seed in range(4)], NOISE, 7),
        ]
        report: dict[str, Any] = {'machine': cpu_name(), 'velocity': [], 'matching': []}
        for truths, levels, every in scenes:
            first = truths[0]
            cases = []
            for level in levels:
                noise = level * first.radius
                cases.append({'noise': noise, 'rows': velocity_errors(truths, noise, every)})
                print(
                    first.name, f'{noise:g} m', f'{time.perf_counter() - begin:.0f} s', flush=True
                )
            report['velocity'].append({'scene': first.name, 'cases': cases})
            for noise in (0.01 * first.radius, 0.05 * first.radius):
                report['matching'] += follow(first, noise)
        report['cost_ms'] = cost_of_a_frame(scenes[0][0][0])
        report['load'] = os.getloadavg()[0]
        write_json(arguments.json, report)
    report = read_json(arguments.json)
    print(velocity_table(report))
    print(matching_table(report))
    print(report['cost_ms'], 'load', report['load'])
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
