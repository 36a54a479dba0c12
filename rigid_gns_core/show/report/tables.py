# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers of an evaluation as HTML: the most important ones as tiles, all in tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import html
from typing import Any

from ...scoring.table import ERRORS, LAWS, words

SECTIONS = {
    'laws': 'Laws of physics',
    'errors': 'Errors against the reference',
    'horizons': 'Errors after so many steps',
    'horizon_errors': 'Errors by time since the start',
    'timing': 'Times',
    'frames': 'Messages and frames',
    'recording': 'Recording',
    'diverged_at': 'Diverged at step',
}
SINGLE = {'dt': ('Time step', 's'), 'tolerance': ('Tolerance', 'diameters')}
# sections that are collapsed
FOLDED = ('recording',)


def leaves(value: Any, path: str = '') -> Iterator[tuple[str, Any]]:
    """Path, such as `laws.predicted.mse`, and value of every leaf of a nested report."""
    if isinstance(value, Mapping):
        items: Any = value.items()
    elif isinstance(value, (list, tuple)):
        items = enumerate(value)
    else:
        yield path, value
        return
    for key, item in items:
        yield from leaves(item, f'{path}.{key}' if path else str(key))


def tables(report: Mapping[str, Any]) -> str:
    """A report without its notes as HTML tables; each cell has its path as `data-key`."""
    single = {
        key: value
        for key, value in report.items()
        if not isinstance(value, (Mapping, list, tuple))
    }
    blocks = []
    order = sorted(
        (key for key in report if key not in single),
        key=lambda key: list(SECTIONS).index(key) if key in SECTIONS else len(SECTIONS),
    )
    for key in order:
        section = report[key]
        if key == 'notes' or not section:
            continue
        title = SECTIONS.get(key, _label(key)[0])
        body = _matrix(key, section) if _is_matrix(section) else _rows(section, key)
        blocks.append(_card(title, body, folded=key in FOLDED))
    if single:
        blocks.append(_card('What was compared', _rows(single, '')))
    return '\n'.join(blocks)


def notes(report: Mapping[str, Any]) -> str:
    """Notes of a report as an HTML list."""
    items = ''.join(f'<li>{html.escape(str(note))}</li>' for note in report.get('notes', ()))
    return f'<ul class="notes">{items}</ul>' if items else ''


def tiles(report: Mapping[str, Any], names: tuple[str, str]) -> str:
    """The most important numbers of a report as HTML; `names` are of prediction and reference."""
    found: list[tuple[str, Any, str, Any]] = []
    errors, laws = report.get('errors', {}), report.get('laws', {})
    ours, theirs = laws.get('predicted', {}), laws.get('reference', {})
    horizons = list(report.get('horizons', {}).values())
    for values in horizons[:2]:
        found.append(
            (f'position error after {values["time"]:.3g} s', values['position_error'], 'm', None)
        )
    if 'predictability_time' in errors:
        at_least = 'at least, ' if errors.get('predictable_to_end') == 1.0 else ''
        label = f'{at_least}until half of the spheres are half a radius off'
        found.append((label, errors['predictability_time'], 's', None))
    for key, label, unit in (
        ('energy_gain_with_rotation', 'energy gained, as a part of that at the start', ''),
        ('depth_sphere', 'diameters: mean depth of sphere penetration', ''),
        ('passed_through', 'of the spheres passed through a surface', '%'),
    ):
        if key in ours:
            found.append((label, ours[key], unit, theirs.get(key)))
    timing = report.get('timing', {})
    for key, label, unit in (
        ('publishing_rate_hz', 'predictions a second', 'Hz'),
        ('lateness_p99_ms', 'lateness of 99 % at most', 'ms'),
        ('step_p99_ms', 'model step of 99 % at most', 'ms'),
    ):
        if key in timing:
            found.append((label, timing[key], unit, None))
    return ''.join(_tile(*one, names[1]) for one in found)


def _tile(label: str, value: Any, unit: str, other: Any, name: str) -> str:
    beside = '' if other is None else f' <span>{html.escape(name)}: {_text(other)}</span>'
    return (
        f'<div class="tile"><b>{_text(value)} <small>{unit}</small></b>'
        f'<span>{html.escape(label)}</span>{beside}</div>'
    )


def _is_matrix(section: Any) -> bool:
    """Whether a section is two-dimensional: a mapping of mappings of plain values."""
    return (
        isinstance(section, Mapping)
        and all(isinstance(row, Mapping) and row for row in section.values())
        and not any(
            isinstance(cell, (Mapping, list, tuple))
            for row in section.values()
            for cell in row.values()
        )
    )


def _matrix(key: str, section: Mapping[str, Mapping[str, Any]]) -> str:
    """Two-dimensional table; laws have prediction and reference as columns, others quantities."""
    columns = list(section)
    quantities = list(dict.fromkeys(name for row in section.values() for name in row))
    if key == 'laws':
        head = ['', *columns]
        rows = [
            (name, [(f'{key}.{side}.{name}', section[side].get(name)) for side in columns])
            for name in quantities
        ]
    else:
        head = ['', *(_labelled(name) for name in quantities)]
        rows = [
            (row, [(f'{key}.{row}.{name}', section[row].get(name)) for name in quantities])
            for row in columns
        ]
    header = ''.join(f'<th>{cell}</th>' for cell in head)
    body = ''.join(
        f'<tr><th>{_labelled(name)}</th>{"".join(_cell(*cell) for cell in cells)}</tr>'
        for name, cells in rows
    )
    return f'<table><thead><tr>{header}</tr></thead><tbody>{body}</tbody></table>'


def _rows(section: Any, path: str) -> str:
    body = ''.join(
        f'<tr><th>{_labelled(key.removeprefix(f"{path}."))}</th>{_cell(key, value)}</tr>'
        for key, value in leaves(section, path)
    )
    return f'<table><tbody>{body}</tbody></table>'


def _card(title: str, body: str, *, folded: bool = False) -> str:
    title = html.escape(title)
    if folded:
        return f'<details class="table"><summary>{title}</summary>{body}</details>'
    return f'<div class="table"><h3>{title}</h3>{body}</div>'


def _cell(path: str, value: Any) -> str:
    exact = html.escape(repr(value) if isinstance(value, float) else str(value))
    return f'<td data-key="{html.escape(path)}" title="{exact}">{_text(value)}</td>'


def _text(value: Any) -> str:
    if value is None:
        return '–'
    if isinstance(value, bool) or not isinstance(value, float):
        return html.escape(str(value))
    if value in (float('inf'), float('-inf')):
        return '∞' if value > 0 else '-∞'
    return f'{value:.4g}'


def _label(key: str) -> tuple[str, str]:
    """Name and unit of a key, from `scoring.table` or by its ending."""
    for known in (LAWS, ERRORS, SINGLE):
        if key in known:
            return known[key]
    return words(key)


def _labelled(key: str) -> str:
    name, unit = _label(key)
    return html.escape(name) + (f' <small>{html.escape(unit)}</small>' if unit else '')
