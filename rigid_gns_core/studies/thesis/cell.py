# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cells: one variant with one seed each, with a key of all that determines its result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, is_dataclass, MISSING
from functools import cache, cached_property
import hashlib
import json
from pathlib import Path
import platform
import subprocess
from typing import Any

from .budget import Budget
from .experiments import Experiment, Kind, SETS, Variant
from ...data.generate import resolve
from ...data.recipe import load_recipe, recipe_hash
from ...errors import UserError
from ...files.config import ConfigError, to_mapping
from ...files.strict_json import read_json, write_compact_json
from ...installation.versions import PACKAGE, versions_of
from ...scenes.scene_file import load_start

VERSION = 1
"""Incremented when a configuration gives other numbers than before, so that cells run again."""
DIGITS = 6
"""Significant digits of stored numbers."""
_PACKAGES = (PACKAGE, 'numpy', 'scipy', 'torch', 'pybullet')


@dataclass(frozen=True)
class Cell:
    """Work for one process.

    Args:
        kind: 'train', 'teacher' or 'speed'.
        name: Name of the variant, or of the measured set.
        seed: Seed of the training; 0 where nothing is random.
        budget: Data, steps and rollouts.
        changes: Changes of the variant.
    """

    kind: Kind
    name: str
    seed: int
    budget: Budget
    changes: dict[str, Any] = field(default_factory=dict)

    def steps(self, which: str) -> tuple[int, ...]:
        """Numbers of steps after which rollouts of a set are scored, ascending.

        Rollouts of unseen scenes are as long as the thesis', whose claims are about them.
        """
        budget = self.budget
        whole = which == 'ood' or self.kind == 'teacher' or not self.changes
        return tuple(sorted({budget.steps, budget.long_steps} if whole else {budget.steps}))

    @cached_property
    def key(self) -> str:
        """Hash of all that determines the result (recipes, scenes, steps), without names."""
        return _hash(self._determinants())

    @cached_property
    def training_key(self) -> str:
        """Hash of what determines the weights, so that a change of the rollouts trains nothing."""
        return _hash({'version': VERSION, **self._training()})

    @property
    def file_name(self) -> str:
        """Name of the file of the result."""
        return f'{self.kind}_{self.name}_{self.seed}_{self.key}.json'

    def _determinants(self) -> dict[str, Any]:
        budget, data = self.budget, self.budget.data
        what: dict[str, Any] = {'version': VERSION, 'kind': self.kind}
        test = [_set_hash(data.test), budget.trajectories]
        if self.kind == 'speed':
            model = budget.training(self.changes, self.seed).model
            what |= {'model': differing(model), 'width': budget.speed_width}
            return what | {'frames': budget.speed_frames, 'test': test}
        scenes = [_scene_hash(scene) for scene in data.ood]
        ood: list[Any] = [scenes, data.ood_steps, data.ood_substeps]
        what |= {'steps': self.steps('test')}
        if self.kind == 'teacher':
            others = [_set_hash(data.half), _set_hash(data.twice)]
            return what | {'data': [test, others] if self.name == 'test' else ood}
        if self.steps('ood') != self.steps('test'):
            ood.append(self.steps('ood'))
        return what | {**self._training(), 'test': test, 'ood': ood}

    def _training(self) -> dict[str, Any]:
        train = load_recipe(self.budget.data.train)
        return {
            'recipe': differing(self.budget.training(self.changes, self.seed)),
            'train': [recipe_hash(resolve(train)), train.trajectories],
        }


def cells_of(
    experiment: Experiment, budget: Budget, variants: Sequence[Variant], seeds: Sequence[int]
) -> list[Cell]:
    """Cells of an experiment, first those of the teacher, whose floor the tables need."""
    if experiment.kind == 'speed':
        return [Cell('speed', v.name, 0, budget, v.changes) for v in variants]
    cells = teacher_cells(budget)
    if experiment.kind == 'train':
        # ordered by seed, so that all variants can be compared before the last seed has run
        cells += [Cell('train', v.name, s, budget, v.changes) for s in seeds for v in variants]
    return cells


def teacher_cells(budget: Budget) -> list[Cell]:
    """Cells of the teacher, on the test set and on the unseen scenes."""
    names = ['test', *(['ood'] if budget.data.ood else [])]
    return [Cell('teacher', name, 0, budget) for name in names]


def differing(config: Any) -> dict[str, Any]:
    """Fields of a configuration that differ from their defaults.

    So an option that is added later leaves the keys of existing cells unchanged.
    """
    result = {}
    for entry in fields(config):
        value = getattr(config, entry.name)
        default = entry.default
        if entry.default_factory is not MISSING:
            default = entry.default_factory()
        if is_dataclass(value):
            value = differing(value)
            if value:
                result[entry.name] = value
        elif value != default:
            result[entry.name] = value
    return result


class Store:
    """Results of finished cells in a folder.

    Args:
        folder: Folder of one JSON file for each cell; created by the first `write`.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def find(self, cell: Cell) -> Path | None:
        """File of a finished cell, by its key; None: it has not run."""
        return next(iter(sorted(self.folder.glob(f'*_{cell.key}.json'))), None)

    def read(self, cell: Cell) -> dict[str, Any] | None:
        """Result of a cell; None: it has not run.

        Raises:
            ConfigError: Its file is damaged.
        """
        path = self.find(cell)
        if path is None:
            return None
        try:
            result = read_json(path)
            if result['key'] != cell.key:
                raise UserError(f'key is {result["key"]!r}')
        except (ValueError, KeyError, TypeError) as error:
            raise ConfigError(
                f'{path}: damaged ({error}); remove it, and the same command runs the cell again'
            ) from error
        return result

    def write(self, cell: Cell, result: Mapping[str, Any]) -> Path:
        """Write a result atomically; the path of its file."""
        path = self.folder / cell.file_name
        write_compact_json(path, {**describe_cell(cell), **result}, DIGITS)
        return path


def describe_cell(cell: Cell) -> dict[str, Any]:
    """Description of a cell for its file, without paths or names of machines."""
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
    """Versions of this package, Python and the numerical packages."""
    found = versions_of(_PACKAGES)
    present = {name: version for name, version in found.items() if version is not None}
    return {'python': platform.python_version(), **present}


@cache
def commit() -> str | None:
    """Git commit of the source tree, with + where files are modified; None: not a checkout."""
    root = Path(__file__).resolve().parents[3]
    if not (root / '.git').exists():
        return None

    def git(*words: str) -> str:
        done = subprocess.run(
            ['git', '-C', str(root), *words], capture_output=True, text=True, check=False
        )
        return done.stdout.strip()

    changed = git('status', '--porcelain', '--untracked-files=no')
    return (git('rev-parse', 'HEAD') + ('+' if changed else '')) or None


def _hash(what: dict[str, Any]) -> str:
    text = json.dumps(what, sort_keys=True, default=list)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


@cache
def _set_hash(name: str) -> str:
    return recipe_hash(resolve(load_recipe(name)))


@cache
def _scene_hash(name: str) -> str:
    scene, start = load_start(name)
    recipe = asdict(start)
    for later in (
        'velocities',
        'angular_velocities',
        'quaternions',
    ):  # without them, the hash of older cells
        if not recipe[later]:
            del recipe[later]
    text = json.dumps([scene.to_mapping(), recipe], sort_keys=True, default=list)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
