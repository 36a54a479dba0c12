# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""One table of parameters, in code, in docs/node.md and in config/simulator.yaml."""

from __future__ import annotations

from pathlib import Path

import pytest
from rigid_gns_core.forecasts.node_parameters import ParameterSpec, SIMULATOR, TRACKER
import yaml

ROOT = Path(__file__).resolve().parents[2]


def row(spec: ParameterSpec) -> str:
    """Return the line of a parameter in docs/node.md."""
    number = isinstance(spec.default, (int, float)) and not isinstance(spec.default, bool)
    span = f'{spec.low:.10g} to {spec.high:.10g}' if number else ', '.join(spec.choices)
    bounds = ', '.join(part for part in (spec.unit, span) if part)
    dynamic = 'yes' if spec.dynamic else 'no'
    cells = [f'`{spec.name}`', f'`{spec.default!r}`', bounds, dynamic, spec.description]
    return '|' + '|'.join(f' {cell} ' if cell else ' ' for cell in cells) + '|'


@pytest.mark.parametrize('table', [SIMULATOR, TRACKER], ids=['simulator', 'tracker'])
def test_the_document_has_the_same_table(table: tuple[ParameterSpec, ...]) -> None:
    text = (ROOT / 'docs' / 'node.md').read_text(encoding='utf-8')
    assert '\n'.join(row(spec) for spec in table) + '\n\n' in text


def test_the_parameter_file_holds_the_defaults() -> None:
    content = yaml.safe_load((ROOT / 'config' / 'simulator.yaml').read_text(encoding='utf-8'))
    given = content['/**']['ros__parameters']
    assert given == {spec.name: spec.default for spec in SIMULATOR}
    assert [type(value) for value in given.values()] == [type(s.default) for s in SIMULATOR]
