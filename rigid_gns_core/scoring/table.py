# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Reports of `evaluate` as plain text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

# key: (name, unit); the first seven are named and ordered as in Table 1 of the thesis
LAWS: dict[str, tuple[str, str]] = {
    'energy_gain': ('Normalized Cumulative Energy Gain', ''),
    'depth_static': ('Normalized Mean Depth (Static)', 'diameters'),
    'depth_ground': ('Normalized Mean Depth (Ground)', 'diameters'),
    'depth_sphere': ('Normalized Mean Depth (Sphere)', 'diameters'),
    'intersections_sphere': ('Percentage of Intersections (Sphere-Sphere)', '%'),
    'intersections_ground': ('Percentage of Intersections (Sphere-Ground)', '%'),
    'intersections_static': ('Percentage of Intersections (Sphere-Static)', '%'),
    'passed_through': ('Spheres that passed through a surface', '%'),
    'energy_gain_with_rotation': ('Energy gain with rotation', ''),
    'energy_left': ('Energy left at the end', ''),
    'rotational_energy': ('Rotational energy, mean', 'J'),
    'horizontal_momentum_drift': ('Horizontal momentum drift', ''),
    'vertical_spin_drift': ('Vertical angular momentum drift', ''),
    'final_speed': ('Speed at the end, mean', 'm/s'),
    'final_speed_max': ('Speed at the end, fastest', 'm/s'),
    'time_to_rest': ('Time to rest', 's'),
}
ERRORS: dict[str, tuple[str, str]] = {
    'mse': ('MSE', 'm²'),
    'chamfer': ('Chamfer', 'm²'),
    'position_error': ('Position error', 'm'),
    'velocity_error': ('Velocity error', 'm/s'),
    'spin_error': ('Spin error', 'rad/s'),
    'rotation_error': ('Rotation error', 'rad'),
    'predictability_time': ('Predictability time', 's'),
    'resting_spheres': ('Spheres at rest in the reference', '%'),
    'resting_drift': ('Drift of resting spheres', 'm'),
}
HORIZON_COLUMNS = {
    'position_error': 'position [m]',
    'mse': 'MSE [m²]',
    'velocity_error': 'velocity [m/s]',
    'spin_error': 'spin [rad/s]',
    'rotation_error': 'rotation [rad]',
}
# endings of keys that are units
UNITS = {'_ms': 'ms', '_s': 's', '_hz': 'Hz'}


def format_table(report: Mapping[str, Any]) -> str:
    """Text of a report of `evaluate`, or of a summary of several.

    Sections of the report that other code added (mappings of numbers, such as publishing times)
    follow below under their own names.
    """
    rows: list[tuple[str, ...]]
    rows = [('Laws of physics', '', 'predicted', 'reference')]
    laws = report['laws']
    for key, (name, unit) in LAWS.items():
        if key in laws['predicted']:
            sides = (_cell(laws[side].get(key)) for side in ('predicted', 'reference'))
            rows.append((name, unit, *sides))
    blocks = [_align(rows)]

    errors = report['errors']
    rows = [('Errors against the reference', '', 'predicted')]
    for key, (name, unit) in ERRORS.items():
        if key in errors:
            cell = _cell(errors[key])
            if key == 'predictability_time' and errors.get('predictable_to_end') == 1.0:
                cell = f'> {cell}'
            rows.append((name, unit, cell))
    blocks.append(_align(rows))

    horizons = report.get('horizons', {})
    if horizons:
        rows = [('Errors after', '', *HORIZON_COLUMNS.values())]
        for step, values in horizons.items():
            time = _number(values['time'])
            cells = (_cell(values[key]) for key in HORIZON_COLUMNS)
            rows.append((f'{step} steps, {time} s', '', *cells))
        blocks.append(_align(rows, least=16))

    known = ('laws', 'errors', 'horizons', 'diverged_at')
    for name, section in report.items():
        if name in known or not isinstance(section, Mapping):
            continue
        cells = [(*_words(key), _cell(v)) for key, v in section.items() if _is_cell(v)]
        if cells:
            blocks.append(_align([(*_words(name), ''), *cells]))
    return '\n\n'.join([*blocks, *_remarks(report)]) + '\n'


def _remarks(report: Mapping[str, Any]) -> list[str]:
    remarks = []
    for side, step in report.get('diverged_at', {}).items():
        if isinstance(step, Mapping):
            if step['diverged']:
                remarks.append(f'{side}: {step["diverged"]} of {step["count"]} rollouts diverged')
        elif step is not None:
            remarks.append(f'{side}: diverged at step {step}, so its scores are infinite')
    return remarks


def _is_cell(value: Any) -> bool:
    if isinstance(value, Mapping):
        return 'mean' in value and 'std' in value
    return value is None or isinstance(value, (int, float, str))


def _cell(value: Any) -> str:
    if value is None:
        return '-'
    if isinstance(value, Mapping):
        if not value['infinite']:
            return f'{_number(value["mean"])} ± {_number(value["std"])}'
        finite = value['count'] - value['infinite']
        if not finite:
            return 'inf'
        mean, std = _number(value['finite_mean']), _number(value['finite_std'])
        return f'{mean} ± {std}, inf in {value["infinite"]} of {value["count"]}'
    return value if isinstance(value, str) else _number(value)


def _number(value: float) -> str:
    if value == 0 or not np.isfinite(value):
        return f'{value:g}'
    if 1e-2 <= abs(value) < 1e5:
        digits = max(0, 3 - int(np.floor(np.log10(abs(value)))))
        text = f'{value:.{digits}f}'
        return text.rstrip('0').rstrip('.') if '.' in text else text
    return f'{value:.2e}'


def _words(key: str) -> tuple[str, str]:
    """Name and unit of a key such as `lateness_p50_ms`."""
    ending = next((ending for ending in UNITS if key.endswith(ending)), '')
    text = key.removesuffix(ending).replace('_', ' ')
    return text[:1].upper() + text[1:], UNITS.get(ending, '')


def _align(rows: Sequence[tuple[str, ...]], least: int = 52) -> str:
    """First row is the head; first two columns (name, unit) become one; numbers align right."""
    joined = [(f'{name} [{unit}]' if unit else name, *cells) for name, unit, *cells in rows]
    widths = [max(len(row[i]) for row in joined) for i in range(len(joined[0]))]
    widths[0] = max(widths[0], least)
    lines = []
    for name, *cells in joined:
        right = (cell.rjust(width) for cell, width in zip(cells, widths[1:], strict=True))
        lines.append('  '.join([name.ljust(widths[0]), *right]))
    lines.insert(1, '-' * max(len(line) for line in lines))
    return '\n'.join(line.rstrip() for line in lines)
