# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns benchmark`: speed against error of all peers, in one run; or recordings."""

from __future__ import annotations

import argparse
from pathlib import Path
import sys
from typing import Any

from . import recordings
from .arguments import completes
from ..errors import UserError
from ..files.strict_json import write_json
from ..prediction.load import load_simulator
from ..running.machine import describe_machine, load_average
from ..running.progress import Progress
from ..studies.benchmark.accuracy import assess, floor_of
from ..studies.benchmark.fresh_process import first_prediction, memory_per_sphere
from ..studies.benchmark.interleaved import BLOCK, run_interleaved, timing
from ..studies.benchmark.peers import all_peers, BULLET_ITERATIONS, NOTES, PeerSet, warm_up
from ..studies.benchmark.scaling import COUNTS, measure_scaling, QUICK_COUNTS
from ..studies.benchmark.scenes import bench_scenes, BenchScene, FRAME, SCENES
from ..studies.benchmark.settling import settle
from ..studies.benchmark.tables import (
    COMPARED,
    format_processes,
    format_scaling,
    format_scene,
    format_settling,
    format_what_ifs,
)
from ..studies.benchmark.what_ifs import measure_what_ifs
from ..studies.chaos_floor import References
from ..teacher.bullet import load_pybullet
from ..teacher.settings import TeacherSettings

REFERENCE_SUBSTEPS = 384
QUICK_REFERENCE_SUBSTEPS = 24


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `rigid-gns benchmark`."""
    parser.add_argument('--quick', action='store_true', help='few spheres and settings: seconds')
    scenes = parser.add_argument(
        '--scenes', nargs='*', metavar='NAME', help='only these scenes, or none (default: all)'
    )
    peers = parser.add_argument(
        '--peers', nargs='+', metavar='FAMILY', help=f'only these families: {", ".join(NOTES)}'
    )
    completes(scenes, SCENES)
    completes(peers, NOTES)
    parser.add_argument('--repeats', type=int, metavar='N', help='repeats (default: 5; quick: 2)')
    parser.add_argument(
        '--reference-substeps',
        type=int,
        metavar='N',
        help='substeps of the teacher that is the reference, even (default: '
        f'{REFERENCE_SUBSTEPS}; quick: {QUICK_REFERENCE_SUBSTEPS})',
    )
    parser.add_argument(
        '--bullet-iterations',
        type=int,
        default=BULLET_ITERATIONS,
        metavar='N',
        help=f"iterations of Bullet's solver (default: {BULLET_ITERATIONS})",
    )
    parser.add_argument(
        '--cache', type=Path, metavar='DIR', help='cache references in this folder'
    )
    parser.add_argument(
        '--no-what-ifs', action='store_true', help='no rollouts of many starts of one ball'
    )
    parser.add_argument('--no-scaling', action='store_true', help='no scaling to 100 000 spheres')
    parser.add_argument(
        '--no-processes', action='store_true', help='no fresh processes, no memory'
    )
    parser.add_argument('--json', type=Path, metavar='FILE', help='write all numbers to this file')
    parser.add_argument(
        '--figures', type=Path, metavar='DIR', help='write a chart per scene (PNG, SVG) here'
    )
    others = parser.add_subparsers(metavar='recordings', help='another benchmark:')
    text = 'laws fitted to half of recorded tracks of real balls, judged on the other half'
    other = others.add_parser(
        'recordings', help=text, description=f'{text}.'.capitalize(), allow_abbrev=False,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    recordings.add_arguments(other)
    other.set_defaults(run=recordings.run)
    parser.epilog = '\n'.join(
        [
            'examples:',
            '  rigid-gns benchmark --cache runs/benchmark --figures runs/benchmark',
            '  rigid-gns benchmark recordings balls',
            'scenes:',
            *(f'  {name:10} {text}' for name, (text, _) in SCENES.items()),
            'peers:',
            *(f'  {name:10} {text}' for name, text in NOTES.items()),
            'What is measured and how: docs/benchmark.md.',
        ]
    )


def run(arguments: argparse.Namespace) -> int:
    """Run `rigid-gns benchmark`, which prints tables; the exit code."""
    from threadpoolctl import threadpool_limits

    quick = arguments.quick
    repeats = (2 if quick else 5) if arguments.repeats is None else arguments.repeats
    if repeats < 1:
        raise UserError(f'--repeats is {repeats}, expected at least 1')
    scenes = bench_scenes(arguments.scenes, quick=quick)
    with threadpool_limits(limits=1):
        peer_set = all_peers(
            arguments.peers, quick=quick, bullet_iterations=arguments.bullet_iterations
        )
        for family, why in peer_set.absent.items():
            print(f'{family} is absent: {why}\n')
        report = _head(arguments, peer_set, repeats)
        references = _references(arguments, report)
        warm_up(peer_set.peers)
        for scene in scenes:
            entry = _run_scene(scene, peer_set, references, repeats)
            report['scenes'].append(entry)
            print(f'{format_scene(entry, report["reference"])}\n', flush=True)
            if scene.settles:
                print(f'{format_settling(entry)}\n', flush=True)
            if arguments.figures is not None:
                _draw(arguments.figures, entry, report['reference'])
        if not arguments.no_what_ifs:
            report['what_ifs'] = measure_what_ifs(repeats, quick=quick)
            print(f'{format_what_ifs(report["what_ifs"])}\n', flush=True)
        if not arguments.no_scaling:
            report['scaling'] = _run_scaling(repeats, quick)
            print(f'{format_scaling(report["scaling"])}\n', flush=True)
        if not arguments.no_processes:
            report['processes'] = _run_processes(repeats, quick)
            print(f'{format_processes(report["processes"])}\n')
    report['load_average']['end'] = load_average()
    if arguments.json is not None:
        write_json(arguments.json, report)
    for name, text in peer_set.notes.items():
        print(f'{name}: {text}')
    if arguments.json is not None:
        print(f'numbers: {arguments.json}')
    return 0


def _head(arguments: argparse.Namespace, peer_set: PeerSet, repeats: int) -> dict[str, Any]:
    load = load_average()
    if load is not None and load[0] > 0.5:
        print(
            f'the machine is busy (load average {load[0]:g}): times will be longer',
            file=sys.stderr,
        )
    return {
        'quick': arguments.quick,
        'repeats': repeats,
        'frames_in_turn': BLOCK,
        'frame': FRAME,
        'threads_of_each_peer': 1,
        'machine': describe_machine(),
        'load_average': {'start': load},
        'reference': None,
        'absent': peer_set.absent,
        'notes': peer_set.notes,
        'peers': {peer.name: peer.settings for peer in peer_set.peers},
        'scenes': [],
        'what_ifs': None,
        'scaling': None,
        'processes': None,
    }


def _references(arguments: argparse.Namespace, report: dict[str, Any]) -> References | None:
    """References at the chosen substeps; None without pybullet."""
    substeps = arguments.reference_substeps
    if substeps is None:
        substeps = QUICK_REFERENCE_SUBSTEPS if arguments.quick else REFERENCE_SUBSTEPS
    if substeps < 2 or substeps % 2:
        raise UserError(f'--reference-substeps is {substeps}, expected an even number')
    try:
        load_pybullet()
    except ModuleNotFoundError:
        print('pybullet is not installed: no errors, no charts\n')
        return None
    report['reference'] = f'Bullet at {substeps} substeps (the teacher)'
    return References(TeacherSettings(substeps=substeps), arguments.cache)


def _run_scene(
    scene: BenchScene, peer_set: PeerSet, references: References | None, repeats: int
) -> dict[str, Any]:
    with Progress(repeats + 1, scene.name, unit='run') as progress:
        runs = None if references is None else scene.references(references)
        progress.update()
        records = run_interleaved(scene, peer_set.peers, repeats, progress.update)
    first = None if runs is None else runs[0]
    reference = None if first is None else first.positions
    timings = {record.peer.name: timing(record) for record in records}
    own = timings.get(COMPARED)
    peers = []
    for record in records:
        times = timings[record.peer.name]
        ratio = None
        if own is not None and times is not None:
            ratio = own['frames_per_second'] / times['frames_per_second']
        peers.append(
            {
                'name': record.peer.name,
                'family': record.peer.family,
                'label': record.peer.label,
                **assess(scene, record, reference),
                'settling': settle(scene, record, first) if scene.settles and times else None,
                'timing': times,
                # speed of the shipped model relative to this peer's
                'compared': ratio,
            }
        )
    return {
        'name': scene.name,
        'text': scene.text,
        'spheres': len(scene.start),
        'frames': scene.frames,
        'floor': floor_of(runs),
        'peers': peers,
    }


def _run_scaling(repeats: int, quick: bool) -> dict[str, Any]:
    counts = QUICK_COUNTS if quick else COUNTS
    with Progress(repeats * len(counts), 'scaling', unit='run') as progress:
        return measure_scaling(
            load_simulator('laws'), counts, repeats, lambda n: progress.update(spheres=str(n))
        )


def _run_processes(repeats: int, quick: bool) -> dict[str, Any]:
    with Progress(2, 'processes', unit='measurement') as progress:
        first = first_prediction(1 if quick else max(3, repeats))
        progress.update()
        memory = memory_per_sphere(100 if quick else 100_000)
        progress.update()
    return {'first_prediction': first, 'memory': memory}


def _draw(folder: Path, entry: dict[str, Any], reference: str | None) -> None:
    from ..studies.benchmark.chart import write_charts

    if reference is None:
        return
    for path in write_charts(folder, entry, reference):
        print(f'chart: {path}')
    print()
