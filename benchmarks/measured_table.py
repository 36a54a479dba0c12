"""The table of errors in README.md, made from the JSON files under docs/model.

rigid-gns evaluate --data data/gns_test --steps 300 --json docs/model/contact_30s.json
rigid-gns evaluate --model gns --data data/gns_test --steps 300 --json docs/model/gns_test.json
python benchmarks/chaos_floor.py --data data/gns_test --steps 300 --json docs/model/floor.json
python benchmarks/measured_table.py
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rigid_gns_core.evaluate import read_json

FOLDER = Path(__file__).resolve().parents[1] / 'docs' / 'model'
HORIZONS = (10, 30, 50, 100)
LAWS = {
    'energy_gain': 'normalized cumulative energy gain',
    'depth_sphere': 'mean depth of sphere penetration [diameters]',
    'depth_ground': 'mean depth of ground penetration [diameters]',
    'intersections_sphere': 'spheres that intersect a sphere [%]',
    'final_speed': 'speed at the end, 30 s [m/s]',
}


def number(value: float) -> str:
    """Two significant digits, without an exponent where that stays short."""
    if value == 0 or not 1e-3 <= abs(value) < 1e4:
        return '0' if value == 0 else f'{value:.0e}'.replace('e-0', 'e-')
    return f'{float(f"{value:.2g}"):g}'


def cell(entry: dict[str, Any]) -> str:
    """Mean and standard deviation of a summarised number."""
    if entry['infinite']:
        return f'diverged in {entry["infinite"]} of {entry["count"]}'
    return f'{number(entry["mean"])} ± {number(entry["std"])}'


def rows(models: Sequence[dict[str, Any]], floor: dict[str, Any]) -> list[tuple[str, ...]]:
    """Name, the models' numbers, and the teacher's: the larger of half and twice the substeps."""
    ours = [model['summary'] for model in models]
    theirs = [floor[name]['summary'] for name in ('half', 'twice')]

    def cells(*path: str) -> tuple[str, ...]:
        entries, floors = ours, theirs
        for key in path:
            entries = [entry[key] for entry in entries]
        for key in path:
            floors = [entry[key] for entry in floors]
        return (*map(cell, entries), cell(max(floors, key=lambda entry: entry['mean'])))

    found = []
    for step in HORIZONS:
        seconds = ours[0]['horizons'][str(step)]['time']
        values = cells('horizons', str(step), 'position_error')
        found.append((f'position error after {seconds:g} s [m]', *values))
    for key, name in (('mse', 'MSE over 30 s [m²]'), ('chamfer', 'Chamfer over 30 s [m²]')):
        found.append((name, *cells('errors', key)))
    for key, name in LAWS.items():
        found.append((name, *cells('laws', 'predicted', key)))
    return found


def table() -> str:
    """The Markdown table."""
    models = [read_json(FOLDER / name) for name in ('contact_30s.json', 'gns_test.json')]
    found = rows(models, read_json(FOLDER / 'floor.json'))
    head = ('', 'contact model', "thesis' network", 'Bullet against itself')
    lines = [f'| {" | ".join(row)} |' for row in [head, ('---',) * len(head), *found]]
    return '\n'.join(lines) + '\n'


if __name__ == '__main__':
    sys.stdout.write(table())
