# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables and bounds of the node's benchmark."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from rigid_gns_core.files.strict_json import read_json
from rigid_gns_core.files.tables import format_rows

BOUNDS = {
    'missed': 0,
    'lost_in_bag': 0,
    'errors': 0,
    'lateness_p99_idle_ms': 2.0,
    'lateness_p99_busy_core_ms': 10.0,
    'horizon_p99_ms': 50.0,
    'crossing_p99_ms': 10.0,
    'memory_growth_percent': 1.0,
}
LATENESS = {'lateness_heard_ms': 'heard', 'lateness_bag_ms': 'bag'}
CROSSING = {'crossing_heard_ms': 'heard', 'crossing_bag_ms': 'bag'}
HORIZON = {'horizon_heard_ms': 'heard', 'horizon_bag_ms': 'bag'}


def broken_bounds(part: str, report: Mapping[str, Any]) -> list[str]:
    """Sentences on bounds that cases of a part violate."""
    if part == 'kills':
        return []
    cases = report['parts'].get(part, {})
    return [f'{name}: {text}' for name, case in cases.items() for text in _broken(part, case)]


def _broken(part: str, case: Mapping[str, Any]) -> Iterator[str]:
    if case['errors']:
        yield f'{case["errors"]} errors in the log, the first: {case["first_errors"][0]}'
    if part == 'horizon':
        for key, where in HORIZON.items():
            yield from _over(f'horizon p99 ({where})', case[key], BOUNDS['horizon_p99_ms'])
        return
    if part == 'crossing':
        for key, where in CROSSING.items():
            yield from _over(f'crossing p99 ({where})', case[key], BOUNDS['crossing_p99_ms'])
        return
    if part == 'learn':
        if case['missed']:
            yield f'{case["missed"]} steps missed while the ball flew'
        if case['lost_in_bag'] or case['bag_warnings']:
            yield f'{case["lost_in_bag"]} predictions not in the bag; {case["bag_warnings"]}'
        for key, where in LATENESS.items():
            bound = BOUNDS['lateness_p99_busy_core_ms']
            yield from _over(f'lateness p99 ({where})', case[key], bound)
        return
    if case['missed'] or case['counts']['skipped']:
        taken = case.get('missed_while_host_took_time', 0)  # not in older results
        yield (
            f'{case["missed"]} steps missed, {taken} of them while the host took time from this '
            f'machine, {case["counts"]["skipped"]} skipped'
        )
    if case['lost_in_bag'] or case['heard_but_not_in_bag'] or case['bag_warnings']:
        yield f'{case["lost_in_bag"]} predictions not in the bag; {case["bag_warnings"]}'
    if part == 'rate':
        bound = BOUNDS[f'lateness_p99_{"busy_core" if case["busy_core"] else "idle"}_ms']
        for key, where in LATENESS.items():
            yield from _over(f'lateness p99 ({where})', case[key], bound)
    elif not case['growth_percent'] < BOUNDS['memory_growth_percent']:
        yield f'memory grew by {case["growth_percent"]:.2f} %'


def _over(name: str, found: Mapping[str, float] | None, bound: float) -> Iterator[str]:
    if found is None:
        yield f'{name}: nothing was measured'
    elif not found['p99'] < bound:
        yield f'{name} is {found["p99"]:.3g} ms, expected less than {bound:g} ms'


def format_part(part: str, report: Mapping[str, Any]) -> str:
    """Table of a part: one line per case."""
    cases = report['parts'].get(part, {})
    columns = {
        'rate': _rate_cells,
        'horizon': _horizon_cells,
        'crossing': _crossing_cells,
        'learn': _learn_cells,
        'soak': _soak_cells,
    }[part]
    rows = [{part: name, **columns(case), **_machine_cells(case)} for name, case in cases.items()]
    return _aligned(rows) if rows else f'{part}: no case'


def format_kills(path: Path) -> str:
    """Table of the results of benchmarks/bags/bag_kills.py."""
    if not path.is_file():
        return f'kills: {path.name} is not there; python benchmarks/bags/bag_kills.py makes it'
    report = read_json(path)
    rows = [
        {
            'kills': kind,
            'number': str(report[kind]['kills']),
            'read': str(report[kind]['read']),
            'worst loss [s]': f'{report[kind]["loss_s"]["worst"]:.2g}',
        }
        for kind in ('recorder', 'node')
        if kind in report
    ]
    return _aligned(rows)


def _rate_cells(case: Mapping[str, Any]) -> dict[str, str]:
    return {
        'missed': str(case['missed']),
        'skipped': str(case['counts']['skipped']),
        'published': str(case['counts']['published']),
        'lost': str(case['lost_in_bag']),
        **{f'{where} p50/p99/worst ms': _quantiles(case[key]) for key, where in LATENESS.items()},
        'step ms': _quantiles(case['step_time_ms']),
    }


def _horizon_cells(case: Mapping[str, Any]) -> dict[str, str]:
    return {
        'frames': str(case['frames']),
        'without': str(case['without_future']),
        **{f'{where} p50/p99/worst ms': _quantiles(case[key]) for key, where in HORIZON.items()},
        'kB': f'{case["message_bytes"] / 1e3:.0f}',
    }


def _crossing_cells(case: Mapping[str, Any]) -> dict[str, str]:
    return {
        'frames': str(case['frames']),
        'without': str(case['without_crossing']),
        **{f'{where} p50/p99/worst ms': _quantiles(case[key]) for key, where in CROSSING.items()},
    }


def _learn_cells(case: Mapping[str, Any]) -> dict[str, str]:
    return {
        'throws': str(case['throws']),
        'scenes taken': str(case['learned_scenes']),
        'missed': str(case['missed']),
        'published': str(case['counts']['published']),
        **{f'{where} p50/p99/worst ms': _quantiles(case[key]) for key, where in LATENESS.items()},
        'future p50/p99/worst ms': _quantiles(case['horizon_heard_ms']),
        'without': str(case['without_future']),
    }


def _soak_cells(case: Mapping[str, Any]) -> dict[str, str]:
    return {
        's': f'{case["seconds"]:g}',
        'MB': f'{case["memory_settled_bytes"] / 1e6:.1f}',
        'growth %': f'{case["growth_percent"]:.3f}',
        'at the end %': f'{case["growth_at_end_percent"]:.3f}',
        'published': f'{case["counts"]["published"]} of {case["expected"]}',
        'lost': str(case['lost_in_bag']),
        'errors': str(case['errors']),
        'bag p50/p99/worst ms': _quantiles(case['lateness_bag_ms']),
    }


def _quantiles(found: Mapping[str, float] | None) -> str:
    return '' if found is None else '/'.join(f'{value:.2f}' for value in found.values())


def _machine_cells(case: Mapping[str, Any]) -> dict[str, str]:
    loads = case['load_average'].values()
    return {
        'core %': f'{100 * case["processor_share"]:.0f}',
        'load': ' to '.join('?' if load is None else f'{load[0]:.1f}' for load in loads),
    }


def _aligned(rows: Sequence[Mapping[str, str]]) -> str:
    return format_rows(list(rows[0]), [list(row.values()) for row in rows])
