# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page docs/only_what_is_needed.md and its table."""

from __future__ import annotations

from typing import Any

from ablation_measures import HORIZON
from rigid_gns_core.files.tables import format_rows, number

# text of each row, before its numbers
TEXTS = {
    'sleep, box that came to rest': (
        'Spheres at rest sleep until something comes near: none of their contacts is solved.'
    ),
    'sleep, pile': (
        'A pile sleeps as a whole once all of it is quiet, which saves all its contacts.'
    ),
    'guard, box': (
        'The guard adds up the energy of each island after each frame, and acts where it rose.'
    ),
    'guard, pile': (
        'Here there is most to guard. The times also depend on when the pile falls asleep.'
    ),
    'air': (
        'Without air a path between contacts is a parabola, in closed form. What air is worth on '
        'recorded balls is in [real_balls.md](real_balls.md).'
    ),
    'lift': 'Drag and lift are integrated together.',
    'contact law': (
        "A law of the table's own, with tangential restitution, takes the place of the product "
        'of materials.'
    ),
    'surface that moves': (
        'Contacts are with a body of the speed of the surface; at rest a surface costs nothing of '
        'that.'
    ),
    'walls': (
        'Walls far from all spheres cost the search for candidates. The error is that of leaving '
        'them out although spheres reach them.'
    ),
    'rolling friction': (
        'Contacts without rolling friction skip its part of the law. The error is that of '
        'leaving it out of a scene that has it.'
    ),
    'properties per sphere': (
        'Radius, mass and materials are arrays in any case, so one number for each sphere costs '
        'no more than one for all.'
    ),
}


def format_table(report: dict[str, Any]) -> str:
    """Markdown table with a line for each row."""
    has_errors = report['records'] > 0
    head = ['what', 'spheres', 'as it is', 'ms', 'changed', 'ms', 'times as long', 'differs [m]']
    head += ['error [m]', 'error, changed [m]'] if has_errors else []
    lines = []
    for name, row in report['rows'].items():
        line = [name, str(row['spheres']), row['usual'], number(row['usual_ms'], 2), row['other']]
        line += [number(row['other_ms'], 2), f'{row["ratio"]:.2f}', number(row['difference'], 2)]
        if has_errors:
            line += [
                number(row[f'{side}_error'], 2) if f'{side}_error' in row else ''
                for side in ('usual', 'other')
            ]
        lines.append(line)
    return format_rows(head, lines, left=(0, 2, 4), markdown=True) + '\n'


def paragraph(name: str, row: dict[str, Any], scene: str) -> str:
    """Return the scene of a row, and what its numbers mean."""
    asleep = (
        f' {100 * row["usual_asleep"]:.0f} % of the spheres sleep.' if row['usual_asleep'] else ''
    )
    return f'- **{name[0].upper()}{name[1:]}**: {scene}. {TEXTS[name]}{asleep}'


def page(report: dict[str, Any]) -> str:
    """Text of docs/only_what_is_needed.md."""
    about = report['machine']
    body = '\n'.join(
        paragraph(name, row, report['starts'][row['start']])
        for name, row in report['rows'].items()
    )
    bullet = (
        f'\n"Error" is the mean distance to Bullet at step {HORIZON} over {report["records"]} '
        f'records of {report["data"]}, to whose scenes the same change was made.'
        if report['records']
        else ''
    )
    return f"""# Only what is needed

A scene costs what it has: air, contacts, walls, rolling friction, piles. The table says what each
costs a step, and how far off the result is where it is left out.

{format_table(report)}
{body}

## How it was measured

{about['cpu']}, {about['cores']} cores, load {about['load']},
Numba {about['numba']}, one thread. Each row: {report['repeats']} turns of
{report['block']} steps of either side, in alternating order from the same state; those of sleep
go on from where they were. "ms" is the median of a step's time, "times as long" the median of the
ratios of neighbouring turns, changed over as it is. "Differs" is the mean distance between both
after {HORIZON} steps.{bullet}

```sh
{report['command']}
```

All numbers: [model/only_what_is_needed.json](model/only_what_is_needed.json).
"""
