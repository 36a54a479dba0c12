# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The tables of a benchmark."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .accuracy import HORIZONS
from ...files.tables import format_rows, number

COMPARED = 'laws 8'
"""The shipped model, with whose speed that of each peer is compared."""


def format_scene(scene: Mapping[str, Any], reference: str | None) -> str:
    """Table of a scene of the report, with a line for each peer."""
    head = ['peer', 'frames/s', 'ms/frame (10..90 %)', 'p50/p99/worst ms', f'{COMPARED} is']
    errors = _error_names(scene)
    head += [*(_error_head(name) for name in errors), '']
    rows = [
        [*_speed_cells(peer), *_error_cells(peer, errors), _remark(peer)]
        for peer in scene['peers']
    ]
    if scene['floor'] is not None:
        floor = [number(scene['floor'][name]) for name in errors]
        rows.append(['(reference against itself)', '', '', '', '', *floor, ''])
    lines = [f'{scene["name"]}: {scene["text"]}; {scene["spheres"]} spheres', '']
    lines.append(format_rows(head, rows, left=(0, -1)))
    if reference is not None:
        lines += ['', f'errors against {reference}; [m], Chamfer [m^2]']
    return '\n'.join(lines)


def format_settling(scene: Mapping[str, Any]) -> str:
    """Table of what chaos does not drown in a pile, see `settling`."""
    measured = [(peer['name'], peer['settling']) for peer in scene['peers'] if peer['settling']]
    frames = list(measured[0][1]['energy']) if measured else []
    head = ['peer', 'one frame [m]', *(f'energy {frame} [%]' for frame in frames)]
    head += ['at rest [%]', 'since [s]', 'height [m]', 'neighbours']
    rows = [
        [
            name,
            _known(own['frame_error']),
            *(f'{100.0 * own["energy"][frame]:.2f}' for frame in frames if frame in own['energy']),
            f'{100.0 * own["at_rest"]:.1f}',
            _known(own['rest_time']),
            f'{own["height"]:.3f}',
            f'{own["neighbours"]:.2f}',
        ]
        for name, own in measured
    ]
    return f'{scene["name"]}, how it settles\n\n{format_rows(head, rows)}'


def format_what_ifs(measured: Mapping[str, Any]) -> str:
    """Table of rollouts a second of many starts of one ball."""
    rows = [
        [
            row['peer'],
            str(row['threads']),
            number(1e3 * row['seconds']),
            number(row['rollouts_per_second']),
            number(row['height_error']),
        ]
        for row in measured['rows']
    ]
    head = ['peer', 'threads', 'ms', 'rollouts/s', 'error of the height at the end [m]']
    title = f'what-ifs of one ball: {measured["samples"]} starts, {measured["frames"]} frames'
    return f'{title}\n\n{format_rows(head, rows)}'


def format_scaling(scaling: Mapping[str, Any]) -> str:
    """Table of the time per step against the number of spheres, with the fitted exponent."""
    rows = [
        [
            str(row['spheres']),
            number(1e3 * row['seconds_per_step']['median']),
            _spread(row['seconds_per_step']),
            number(row['steps_per_second']),
        ]
        for row in scaling['rows']
    ]
    lines = ['scaling of the laws: bouncing boxes of one density', '']
    lines.append(format_rows(['spheres', 'ms/step', '(10..90 %)', 'steps/s'], rows))
    if scaling['exponent'] is not None:
        lines += ['', f'time ~ spheres^{scaling["exponent"]:.2f} from {scaling["fitted_from"]} on']
    return '\n'.join(lines)


def format_processes(processes: Mapping[str, Any]) -> str:
    """Lines on fresh processes and memory."""
    first, memory = processes['first_prediction'], processes['memory']
    seconds = first['seconds']
    text = (
        f'first prediction of a fresh process ({first["spheres"]} spheres): '
        f'{seconds["median"]:.2f} s, worst of {first["processes"]} {seconds["worst"]:.2f} s; '
        f'resident {_megabytes(first["most_resident"])}'
    )
    lines = [text]
    each = memory['per_sphere']
    lines.append(
        f'memory of a rollout of {memory["spheres"]} spheres: '
        + ('unknown' if each is None else f'{each / 1e3:.2f} kB per sphere')
        + f', resident {_megabytes(memory["most_resident"])}'
    )
    return '\n'.join(lines)


def _error_names(scene: Mapping[str, Any]) -> list[str]:
    """Names of the errors of the peers, in their order."""
    measured = [peer['errors'] for peer in scene['peers'] if peer['errors'] is not None]
    return list(measured[0]) if measured else []


def _error_head(name: str) -> str:
    known = {f'position_error_{frame}': f'error {frame}' for frame in HORIZONS}
    return known.get(name, name)


def _speed_cells(peer: Mapping[str, Any]) -> list[str]:
    timing = peer['timing']
    if timing is None:
        return [peer['name'], '', '', '', '']
    frame, latency = timing['seconds_per_frame'], timing['latency']
    ratio = peer['compared']
    return [
        peer['name'],
        number(timing['frames_per_second']),
        ' '.join([number(1e3 * frame['median']), _spread(frame)]),
        '/'.join(number(1e3 * latency[name]) for name in ('p50', 'p99', 'worst')),
        '' if ratio is None else f'{number(ratio)} x',
    ]


def _error_cells(peer: Mapping[str, Any], names: Sequence[str]) -> list[str]:
    return ['' if peer['errors'] is None else number(peer['errors'][name]) for name in names]


def _remark(peer: Mapping[str, Any]) -> str:
    text = '; '.join(peer['faults'])
    return text if peer['status'] == 'ok' else f'{peer["status"]}: {text}'


def _spread(seconds: Mapping[str, float]) -> str:
    return f'({number(1e3 * seconds["p10"])}..{number(1e3 * seconds["p90"])})'


def _known(value: float | None) -> str:
    return '' if value is None else number(value)


def _megabytes(value: int | None) -> str:
    return 'unknown' if value is None else f'{value / 1e6:.0f} MB'
