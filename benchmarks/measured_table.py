# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Table of errors in README.md, from the JSON files in docs/model.

docs/model/README.md has the commands that make them.
"""

from __future__ import annotations

from pathlib import Path
import sys

from rigid_gns_core.files.strict_json import read_json
from rigid_gns_core.files.tables import format_rows, summary

FOLDER = Path(__file__).resolve().parents[1] / 'docs' / 'model'
ROWS = {
    'position_error_10': 'position error after 1 s [m]',
    'position_error_30': 'position error after 3 s [m]',
    'position_error_50': 'position error after 5 s [m]',
    'position_error_100': 'position error after 10 s [m]',
    'mse': 'MSE over 200 s [m²]',
    'chamfer': 'Chamfer over 200 s [m²]',
    'energy_gain_with_rotation': 'normalized cumulative energy gain',
    'depth_sphere': 'mean depth of sphere penetration [diameters]',
    'depth_ground': 'mean depth of ground penetration [diameters]',
    'rest_share': 'of spheres that Bullet stops, at rest at the end [%]',
}


def table() -> str:
    """Markdown table of the laws, the GNS, and Bullet against itself."""
    found = read_json(FOLDER / 'laws_test.json')['summary']
    models = found['models']
    sides = (models['laws']['test'], models['gns']['test'], found['floor']['test'])
    head = ('', 'laws', 'GNS baseline', 'Bullet against itself')
    rows = [(name, *(summary(side.get(key), 2) for side in sides)) for key, name in ROWS.items()]
    return format_rows(head, rows, markdown=True) + '\n'


if __name__ == '__main__':
    sys.stdout.write(table())
