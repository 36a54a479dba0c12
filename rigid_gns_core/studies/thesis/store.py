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

"""Results of cells as JSON, one file each, with all that says where they came from."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
import platform
import subprocess
from typing import Any

from .cell import Cell, VERSION
from .study import SETS
from ...files.config import ConfigError, to_mapping
from ...files.strict_json import read_json, write_compact_json
from ...installation.versions import PACKAGE, versions_of

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
        """Return the result of a cell; None: it has not run.

        Raises:
            ConfigError: Its file is damaged.
        """
        path = self.find(cell)
        if path is None:
            return None
        try:
            result = read_json(path)
            if result['key'] != cell.key:
                raise ValueError(f'key is {result["key"]!r}')
        except (ValueError, KeyError, TypeError) as error:
            raise ConfigError(
                f'{path}: damaged ({error}); remove it, and the same command runs the cell again'
            ) from error
        return result

    def write(self, cell: Cell, result: Mapping[str, Any]) -> Path:
        """Write a result whole, or leave the old file."""
        path = self.folder / cell.file_name
        write_compact_json(path, {**describe_cell(cell), **result}, DIGITS)
        return path


def describe_cell(cell: Cell) -> dict[str, Any]:
    """Return what a cell is and what made it; no path and no name of a machine."""
    budget = cell.budget
    config: dict[str, Any] = {'changes': cell.changes}
    keys = {'key': cell.key}
    if cell.kind == 'train':
        config = to_mapping(budget.training(cell.changes, cell.seed))
        keys['training_key'] = cell.training_key
    return {
        'version': VERSION,
        'kind': cell.kind,
        'name': cell.name,
        'seed': cell.seed,
        **keys,
        'budget': {
            'name': budget.name,
            'words': budget.words,
            'data': to_mapping(budget.data.named),
        },
        'steps': {which: cell.steps(which) for which in SETS},
        'config': config,
        'commit': commit(),
        'versions': versions(),
    }


def versions() -> dict[str, str]:
    """Of this package, Python, and what computes."""
    found = versions_of((PACKAGE, *_PACKAGES))
    present = {name: version for name, version in found.items() if version is not None}
    return {'python': platform.python_version(), **present}


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
