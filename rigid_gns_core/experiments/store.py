"""Results of cells as JSON, one file each, with all that says where they came from."""

from __future__ import annotations

import json
import math
import os
import platform
import subprocess
from collections.abc import Mapping
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from ..config import to_mapping
from ..evaluate import read_json
from .cell import VERSION, Cell

DIGITS = 6
"""Significant digits that are kept."""
_PACKAGES = ('numpy', 'scipy', 'torch', 'pybullet')


class Store:
    """Finished cells in a folder.

    Args:
        folder: Holds one JSON file for each cell; made on the first `write`.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def find(self, cell: Cell) -> Path | None:
        """File of a finished cell, under whatever name an experiment gave it."""
        return next(iter(sorted(self.folder.glob(f'*_{cell.key}.json'))), None)

    def read(self, cell: Cell) -> dict[str, Any] | None:
        """Result of a cell; None: it has not run."""
        path = self.find(cell)
        return None if path is None else read_json(path)

    def write(self, cell: Cell, result: Mapping[str, Any]) -> Path:
        """Write a result whole, or leave the old file."""
        path = self.folder / cell.file_name
        write_compact(path, {**describe_cell(cell), **result})
        return path


def describe_cell(cell: Cell) -> dict[str, Any]:
    """What a cell is and what made it; no path and no name of a machine."""
    budget = cell.budget
    config: dict[str, Any] = {'changes': cell.changes}
    if cell.kind == 'train':
        config = to_mapping(budget.training(cell.changes, cell.seed))
    return {
        'version': VERSION,
        'kind': cell.kind,
        'name': cell.name,
        'seed': cell.seed,
        'key': cell.key,
        'budget': {'name': budget.name, 'words': budget.words, 'data': to_mapping(budget.data)},
        'steps': list(cell.steps),
        'config': config,
        'commit': commit(),
        'versions': versions(),
    }


def versions() -> dict[str, str]:
    """Of this package, Python, and what computes."""
    found = {'python': platform.python_version()}
    for name in ('rigid_gns_ros', *_PACKAGES):
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


@cache
def commit() -> str | None:
    """Git commit of the source tree, with a + where files differ; None: no checkout."""
    root = Path(__file__).resolve().parents[2]
    if not (root / '.git').exists():
        return None

    def git(*words: str) -> str:
        done = subprocess.run(
            ['git', '-C', str(root), *words], capture_output=True, text=True, check=False
        )
        return done.stdout.strip()

    changed = git('status', '--porcelain', '--untracked-files=no')
    return (git('rev-parse', 'HEAD') + ('+' if changed else '')) or None


def write_compact(path: Path, report: Mapping[str, Any]) -> None:
    """Write strict JSON, a line for each list of numbers; "inf" as in `evaluate.write_json`.

    Raises:
        ValueError: A value is NaN.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + '.part')
    partial.write_text(_layout(_plain(report), '') + '\n', encoding='utf-8')
    os.replace(partial, path)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        if math.isinf(value):
            return 'inf' if value > 0 else '-inf'
        return float(f'{value:.{DIGITS}g}')
    return value


def _layout(value: Any, indent: str) -> str:
    """A line for each entry of a mapping, or of a list of mappings; the rest on one line."""
    inner = indent + ' '
    if isinstance(value, dict) and value:
        lines = [f'{inner}{json.dumps(k)}: {_layout(v, inner)}' for k, v in value.items()]
        return '{\n' + ',\n'.join(lines) + f'\n{indent}}}'
    if isinstance(value, list) and value and isinstance(value[0], dict):
        lines = [f'{inner}{_layout(item, inner)}' for item in value]
        return '[\n' + ',\n'.join(lines) + f'\n{indent}]'
    return json.dumps(value, allow_nan=False, ensure_ascii=False)
