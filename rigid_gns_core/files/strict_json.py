# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reports as strict JSON: infinities, which JSON lacks, are the strings "inf" and "-inf"."""

from __future__ import annotations

from collections.abc import Mapping
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from .atomic_file import whole_file
from ..errors import UserError


def write_json(path: str | Path, report: Mapping[str, Any]) -> None:
    """Write a report, each number on a line of its own.

    Raises:
        ValueError: A value is NaN.
        UserError: A value is of a type that JSON does not know.
    """
    path = Path(path)
    try:
        text = json.dumps(encode(report), indent=2, allow_nan=False, ensure_ascii=False)
    except TypeError as error:
        raise UserError(f'{path}: the report cannot be written as JSON: {error}') from error
    with whole_file(path) as partial:
        partial.write_text(text + '\n', encoding='utf-8')


def write_compact_json(path: Path, report: Mapping[str, Any], digits: int) -> None:
    """Write a report with a line for each list of numbers.

    Args:
        path: File to write; one that exists is replaced.
        report: What to write.
        digits: Significant digits that are kept.

    Raises:
        ValueError: A value is NaN.
    """
    text = _laid_out(encode(report, digits), '')
    with whole_file(path) as partial:
        partial.write_text(text + '\n', encoding='utf-8')


def read_json(path: str | Path) -> dict[str, Any]:
    """Read a report that this module wrote; infinities are numbers again."""
    report: dict[str, Any] = _decode(json.loads(Path(path).read_text(encoding='utf-8')))
    return report


def parse_json(text: str | bytes) -> Any:
    """Value of a JSON text from elsewhere.

    Raises:
        UserError: It is no JSON, or nested too deeply.
    """
    try:
        return json.loads(text)
    except (ValueError, TypeError) as error:  # digits without end, bytes that are no text
        raise UserError(f'not valid JSON: {error}') from error
    except RecursionError:
        raise UserError('not valid JSON: it is nested too deeply') from None


def encode(value: Any, digits: int | None = None) -> Any:
    """Value of JSON's types: from mappings, sequences and NumPy's values; NaN stays as it is."""
    if isinstance(value, Mapping):
        return {str(key): encode(item, digits) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [encode(item, digits) for item in value]
    if isinstance(value, np.ndarray):
        return encode(value.tolist(), digits)
    if isinstance(value, np.generic):
        return encode(value.item(), digits)
    if isinstance(value, float):
        if math.isinf(value):
            return 'inf' if value > 0 else '-inf'
        return value if digits is None else float(f'{value:.{digits}g}')
    return value


def _decode(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _decode(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_decode(item) for item in value]
    return float(value) if value in ('inf', '-inf') else value


def _laid_out(value: Any, indent: str) -> str:
    """JSON with a line for each entry of a mapping or a list of mappings; the rest on one line."""
    inner = indent + ' '
    if isinstance(value, dict) and value:
        lines = [f'{inner}{json.dumps(k)}: {_laid_out(v, inner)}' for k, v in value.items()]
        return '{\n' + ',\n'.join(lines) + f'\n{indent}}}'
    if isinstance(value, list) and value and isinstance(value[0], dict):
        lines = [f'{inner}{_laid_out(item, inner)}' for item in value]
        return '[\n' + ',\n'.join(lines) + f'\n{indent}]'
    return json.dumps(value, allow_nan=False, ensure_ascii=False)
