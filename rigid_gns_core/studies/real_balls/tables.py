# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The tables of the recordings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .judged import HORIZONS, rivals_of
from ...files.tables import format_rows, number


def format_set(name: str, report: Mapping[str, Any], *, markdown: bool = False) -> str:
    """Table of a set: mean and median error by horizon, and what regions hold, by protocol."""
    rows = []
    for protocol, text in report['protocols'].items():
        for rival in rivals_of(report):
            found = report['rivals'][rival][protocol]
            cells = [_errors(found.get(f'{horizon:g}')) for horizon in HORIZONS]
            rows.append([text, rival, *cells, _held(found, 50), _held(found, 90)])
            text = ''
    horizons = [f'{horizon:g} s' for horizon in HORIZONS]
    head = ['mean / median error [cm]', 'rival', *horizons, 'in 50 %', 'in 90 %']
    count = report['tracks']
    halves = f'{count["fitted"]} tracks fitted, {count["judged"]} judged'
    if report['cut']:
        halves = 'the first half of each track fitted, the second judged'
    if held := report['held']['every']:
        halves += f'; {held} forecasts into or out of a hand left out'
    lines = [f'{name}: {halves}', '', format_rows(head, rows, left=(0, 1), markdown=markdown)]
    return '\n'.join(lines)


def format_times(name: str, report: Mapping[str, Any]) -> str:
    """Line on the time of an estimate and a forecast of one ball."""
    times = report['rivals']['fitted']['times']
    if not times:
        return f'{name}: no track is long enough to time an estimate'
    parts = [
        f'{what} {number(1e3 * own["median_s"])} ms (99 % {number(1e3 * own["p99_s"])})'
        for what, own in times.items()
    ]
    return f'{name}, one ball, {times["both"]["n"]} starts: {", ".join(parts)}'


def _errors(values: Mapping[str, Any] | None) -> str:
    if values is None:
        return ''
    return f'{number(100 * values["mean_m"], 2)} / {number(100 * values["median_m"], 2)}'


def _held(found: Mapping[str, Mapping[str, Any]], region: int) -> str:
    """What the region holds, horizon by horizon [%]."""
    shares = [values[f'coverage_{region}'] for values in found.values()]
    if any(share is None for share in shares):
        return ''
    return ', '.join(f'{100 * share:.0f}' for share in shares)
