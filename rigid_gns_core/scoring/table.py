# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reports of `evaluate` as plain text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..files.tables import format_rows, number, summary

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
DIGITS = 4


def format_table(report: Mapping[str, Any]) -> str:
    """Text of a report of `evaluate`, or of a summary of several.

    Sections of the report that other code added (mappings of numbers, such as publishing times)
    follow below under their own names.
    """
    laws = report['laws']
    rows = [
        (_labelled(*names), *(_cell(laws[side].get(key)) for side in ('predicted', 'reference')))
        for key, names in LAWS.items()
        if key in laws['predicted']
    ]
    blocks = [format_rows(('Laws of physics', 'predicted', 'reference'), rows)]

    errors = report['errors']
    rows = []
    for key, names in ERRORS.items():
        if key in errors:
            more = key == 'predictability_time' and errors.get('predictable_to_end') == 1.0
            rows.append((_labelled(*names), ('> ' if more else '') + _cell(errors[key])))
    blocks.append(format_rows(('Errors against the reference', 'predicted'), rows))

    horizons = report.get('horizons', {})
    if horizons:
        rows = [
            (f'{step} steps, {number(values["time"], DIGITS)} s',)
            + tuple(_cell(values[key]) for key in HORIZON_COLUMNS)
            for step, values in horizons.items()
        ]
        blocks.append(format_rows(('Errors after', *HORIZON_COLUMNS.values()), rows))

    known = ('laws', 'errors', 'horizons', 'diverged_at')
    for name, section in report.items():
        if name in known or not isinstance(section, Mapping):
            continue
        rows = [(_labelled(*words(key)), _cell(v)) for key, v in section.items() if _is_cell(v)]
        if rows:
            blocks.append(format_rows((_labelled(*words(name)), ''), rows))
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
    if isinstance(value, str):
        return value
    return summary(value, DIGITS) if isinstance(value, Mapping) else number(value, DIGITS)


def _labelled(name: str, unit: str) -> str:
    return f'{name} [{unit}]' if unit else name


def words(key: str) -> tuple[str, str]:
    """Name and unit of a key such as `lateness_p50_ms`."""
    ending = next((ending for ending in UNITS if key.endswith(ending)), '')
    text = key.removesuffix(ending).replace('_', ' ')
    return text[:1].upper() + text[1:], UNITS.get(ending, '')
