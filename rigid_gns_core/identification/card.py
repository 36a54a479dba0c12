# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A scene file with what was learned, and the card that says how."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import yaml

from .learn import Learned
from ..files.atomic_file import whole_file


def card_of(learned: Learned, origin: dict[str, Any]) -> dict[str, Any]:
    """What a scene file's `card` holds, of types that YAML and JSON know.

    Args:
        learned: The fit.
        origin: Where the tracks come from: names of the data sets, their hash.
    """
    return {
        'data': origin | learned.counts,
        'parameters': {
            name: {'value': _short(one.value), 'error': _short(one.error), 'unit': one.unit}
            for name, one in learned.parameters.items()
        },
        'coverage': {
            horizon: dict(zip(('n', 'in_50', 'in_90'), map(_short, held), strict=True))
            for horizon, held in learned.coverage.items()
        },
        'terms': [
            asdict(line)
            | {
                'change': _short(line.change),
                'deviation': _short(line.deviation),
                'first': _rows(line.first),
                'every': _rows(line.every),
            }
            for line in learned.table
        ],
        'notes': list(learned.notes),
    }


def write_lab(path: Path, learned: Learned, card: dict[str, Any]) -> None:
    """Write scene and card, whole or not at all; `load_scene` reads the scene."""
    head = (
        '# Fitted by `rigid-gns calibrate` to stamped positions. card: values, standard errors,\n'
        '# and errors of left-out tracks [n, mean m, median m] by horizon [s], term by term.\n'
    )
    content = {'scene': learned.scene.to_mapping(), 'card': card}
    with whole_file(path) as partial:
        text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=110)
        partial.write_text(head + text, encoding='utf-8')


def _rows(row: dict[str, list[float]]) -> dict[str, list[float]]:
    return {horizon: [_short(value) for value in values] for horizon, values in row.items()}


def _short(value: float) -> float:
    """Number of four digits: more is not known."""
    return value if isinstance(value, int) else float(f'{value:.4g}')
