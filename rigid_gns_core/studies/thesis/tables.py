# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of experiments as Markdown, for the terminal and docs/thesis.md: columns and layout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import os
from pathlib import Path
import re
from typing import Any

import numpy as np

from .experiments import shipped_experiments
from ...files.config import ConfigError
from ...files.strict_json import read_json
from ...files.tables import format_rows, mean_std, number
from ...scoring.table import LAWS

SET_NAMES = {'test': 'test set', 'ood': 'unseen scenes'}
# metric: head of its column, with the unit in brackets
LONG = {
    'energy_gain': 'energy gain',
    'energy_gain_median': 'median gain',
    'mse': 'MSE [m²]',
    'mse_median': 'median MSE [m²]',
    'mse_ratio': 'MSE / floor',
    'mse_ratio_median': 'median MSE / floor',
    'chamfer': 'Chamfer [m²]',
    'chamfer_median': 'median Chamfer [m²]',
    'chamfer_ratio': 'Chamfer / floor',
    'chamfer_ratio_median': 'median Chamfer / floor',
}
OVERLAPS = {
    'depth_sphere': 'depth sphere [diameters]',
    'depth_ground': 'depth ground [diameters]',
    'depth_static': 'depth static [diameters]',
    'intersections_sphere': 'spheres overlap [%]',
    'escaped': 'escaped [%]',
}
SHORT = {
    'predictability_time': 'predictable for [s]',
    'predictability_time_median': 'median predictable for [s]',
    'position_error_10': 'error 10 steps [m]',
    'position_error_30': '30 steps',
    'position_error_50': '50 steps',
    'position_error_100': '100 steps',
    'position_error_30_ratio': '30 steps / floor',
}
LATE = {
    'energy_left': 'energy left',
    'final_speed': 'speed at the end [m/s]',
    'final_speed_max': 'of the fastest [m/s]',
    'resting_drift': 'drift of spheres at rest [m]',
}
THESIS_STEPS = 2000
"""Length of the thesis' trajectories, assumed for the rollouts of its table 2."""
PRINTED = {'energy_gain': 'energy gain', 'mse': 'MSE', 'chamfer': 'Chamfer'}
_BLOCK = re.compile(r'(<!-- experiment: (\w+) -->\n)(.*?)(<!-- end -->)', re.DOTALL)
_TRUTH = [key for key in LAWS if key != 'time_to_rest']


def format_table(table: Mapping[str, Any]) -> str:
    """All tables of an experiment, with lines on missing cells."""
    if table['kind'] == 'teacher':
        blocks = [_teacher_block(table)]
    elif table['kind'] == 'speed':
        blocks = [_speed_block(table)]
    else:
        blocks = list(_train_blocks(table))
    if minutes := [m for row in table['rows'] for m in row.get('minutes', ())]:
        few, middle, many = (number(float(f(minutes)), 2) for f in (np.min, np.median, np.max))
        span = f'{few} to {many} minutes, the median {middle}' if len(minutes) > 1 else few
        span += f' ({len(minutes)} cells)' if len(minutes) > 1 else ' minutes (1 cell)'
        blocks.append(f'Wall time of a cell: {span}.')
    missing = [row for row in table['rows'] if row['missing']]
    for words, some in (('Not run yet', False), ('Not with all seeds yet', True)):
        labels = [row['label'] for row in missing if bool(row.get('seeds')) == some]
        if labels:
            blocks.append(f'{words}: {", ".join(labels)}.')
    return '\n\n'.join(block for block in blocks if block) + '\n'


def spread(mean: float | None, std: float | None) -> str:
    """`mean ± std`, or the mean alone; 'diverged' without a mean."""
    if mean is None:
        return 'diverged'
    return mean_std(mean, std)


def printed(value: Any) -> str:
    """Text of a value of the thesis: a number, [mean, std], a word, or None."""
    if value is None:
        return ''
    if isinstance(value, str):
        return value
    parts = value if isinstance(value, list) else [value]
    return spread(parts[0], parts[1] if len(parts) > 1 else None)


def _train_blocks(table: Mapping[str, Any]) -> list[str]:
    blocks = []
    for which, name in SET_NAMES.items():
        steps = str(table['steps'][which])
        rows = [row for row in table['rows'] if steps in row['sets'].get(which, {})]
        floor = table['floor'].get(which, {}).get(steps, {})
        title = f'**{name.capitalize()}, {steps} steps.**\n\n'
        for columns in (LONG, OVERLAPS, SHORT, LATE) if rows else ():
            blocks.append(title + _block(rows, which, steps, columns, floor))
            title = ''
    for row in table['rows']:
        if row['untrainable'] and not row['sets']:
            blocks.append(f'{row["label"]}: the loss did not stay finite with any seed.')
    return blocks


def _block(
    rows: Sequence[Mapping[str, Any]],
    which: str,
    steps: str,
    columns: Mapping[str, str],
    floor: Mapping[str, Any],
) -> str:
    """Table with a line for each variant, and one for the floor where a column has one."""
    scores = [row['sets'][which][steps] for row in rows]
    keys = [key for key in columns if any(key in s['metrics'] for s in scores)]
    words = [
        key for key in PRINTED if key in columns and any(_thesis(r, which, key) for r in rows)
    ]
    head = ['variant', 'diverged', *(columns[key] for key in keys)]
    head += [f'thesis, {THESIS_STEPS} steps: {PRINTED[key]}' for key in words]
    lines = []
    for row, score in zip(rows, scores, strict=True):
        lost = f'{score["diverged"]} of {score["rollouts"]}'
        if row['untrainable']:
            lost += f', {row["untrainable"]} seeds untrainable'
        cells = [_cell(score['metrics'].get(key)) for key in keys]
        lines.append([row['label'], lost, *cells, *(_thesis(row, which, key) for key in words)])
    if any(key in floor for key in keys):
        known = [number(floor.get(key)) for key in keys]
        lines.append(['*Bullet against itself*', '', *known, *[''] * len(words)])
    return format_rows(head, lines, markdown=True)


def _teacher_block(table: Mapping[str, Any]) -> str:
    rows = [row for row in table['rows'] if row['laws']]
    if not rows:
        return ''
    head = ['metric']
    for row in rows:
        head += [f'thesis: {row["label"]}', f'ours, by differences of poses: {row["label"]}']
        head += [f"ours, by Bullet's own velocities: {row['label']}"]
    lines = []
    names = LAWS | {'escaped': ('Escaped', '%')}
    for key in (*_TRUTH, 'escaped'):
        name, unit = names[key]
        line = [f'{name} [{unit}]' if unit else name]
        for row in rows:
            line.append(_thesis(row, row['variant'], key))
            line += [_cell(row['laws'][kind].get(key)) for kind in ('poses', 'given')]
        lines.append(line)
    steps = ', '.join(f'{row["label"]}: {row["steps"]} steps' for row in rows)
    text = format_rows(head, lines, markdown=True)
    return f'{text}\n\nMean ± standard deviation over trajectories; {steps}.'


def _speed_block(table: Mapping[str, Any]) -> str:
    rows = [row for row in table['rows'] if 'values' in row]
    if not rows:
        return ''
    head = ['variant', 'frames per second', 'edges', 'surface edges', 'thesis: frames per second']
    lines = []
    for row in rows:
        cells = [_cell(row['values'][k]) for k in ('frames_per_second', 'edges', 'surface_edges')]
        lines.append([row['label'], *cells, _thesis(row, 'test', 'frames_per_second')])
    first = rows[0]
    note = (
        'Frames of all trajectories together; edges are mean ± standard deviation over them. '
        f'{number(first["spheres"])} spheres on average, width {first["width"]}, one thread of '
        f'{first["cpu"]}.'
    )
    return f'{format_rows(head, lines, markdown=True)}\n\n{note}'


def _thesis(row: Mapping[str, Any], which: str, key: str) -> str:
    return printed(row['thesis'].get(which, {}).get(key))


def _cell(statistic: Mapping[str, Any] | None) -> str:
    return '' if statistic is None else spread(statistic['mean'], statistic['std'])


def write_page(page: Path, results: Path) -> None:
    """Fill a page between `<!-- experiment: NAME -->` and `<!-- end -->` with table and figure.

    Args:
        page: Markdown file; the rest of it stays.
        results: Folder of the aggregated results of a budget.

    Raises:
        ConfigError: A marker names no experiment; the message lists the allowed ones.
    """
    known = shipped_experiments()

    def fill(match: re.Match[str]) -> str:
        name = match[2]
        if name not in known:
            raise ConfigError(f'{page}: no experiment {name!r}, allowed: {", ".join(known)}')
        return f'{match[1]}{_content(name, page, results)}{match[4]}'

    text = _BLOCK.sub(fill, page.read_text(encoding='utf-8'))
    page.write_text(text, encoding='utf-8')


def _content(name: str, page: Path, results: Path) -> str:
    path = results / f'{name}.json'
    if not path.is_file():
        return f'\nNot run yet: `rigid-gns experiment {name} --budget {results.name}`.\n\n'
    table = read_json(path)
    content = f'\nBudget {table["budget"]["words"]}.\n\n{format_table(table)}\n'
    figure = path.with_suffix('.png')
    if figure.is_file():
        link = Path(os.path.relpath(figure, page.parent)).as_posix()
        content += f'![{table["title"]}]({link})\n\n'
    return content
