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

"""A cell: one variant with one seed. What determines it is its key, so it never runs twice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields, is_dataclass, MISSING
from functools import cache, cached_property
import hashlib
import json
from typing import Any

from .budget import Budget
from .study import Experiment, Kind, Variant
from ...data.generate import resolve
from ...data.recipe import load_recipe, recipe_hash
from ...scenes.sampling import load_scene

VERSION = 1
"""Raised where the same configuration gives other numbers than before, so that cells run again."""


@dataclass(frozen=True)
class Cell:
    """Work for one process, and the name under which its result is kept.

    Args:
        kind: 'train', 'teacher' or 'speed'.
        name: Of the variant, or of the set that is measured.
        seed: Of training; 0 where nothing is drawn.
        budget: Data, steps and rollouts.
        changes: Of the variant.
    """

    kind: Kind
    name: str
    seed: int
    budget: Budget
    changes: dict[str, Any] = field(default_factory=dict)

    def steps(self, which: str) -> tuple[int, ...]:
        """Lengths at which rollouts of a set are scored, ascending.

        Those of unseen scenes are as long as the thesis', since its claims are about them.
        """
        budget = self.budget
        whole = which == 'ood' or self.kind == 'teacher' or not self.changes
        return tuple(sorted({budget.steps, budget.long_steps} if whole else {budget.steps}))

    @cached_property
    def key(self) -> str:
        """Hash of all that determines the result: recipes, scenes, steps; not of names."""
        return _hash(self._determinants())

    @cached_property
    def training_key(self) -> str:
        """Hash of what determines the weights, so that other rollouts do not train them again."""
        return _hash({'version': VERSION, **self._training()})

    @property
    def file_name(self) -> str:
        """Of the result."""
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
    """Cells of an experiment; the teacher's first, whose floor the tables need."""
    if experiment.kind == 'speed':
        return [Cell('speed', v.name, 0, budget, v.changes) for v in variants]
    cells = teacher_cells(budget)
    if experiment.kind == 'train':
        # seed by seed, so that all variants can be compared before the last seed has run
        cells += [Cell('train', v.name, s, budget, v.changes) for s in seeds for v in variants]
    return cells


def teacher_cells(budget: Budget) -> list[Cell]:
    """Return the reference itself, on the test set and on the scenes unlike the training set."""
    names = ['test', *(['ood'] if budget.data.ood else [])]
    return [Cell('teacher', name, 0, budget) for name in names]


def differing(config: Any) -> dict[str, Any]:
    """Return what of a configuration differs from its defaults.

    A switch that is added later then leaves the keys of old cells as they are.
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


def _hash(what: dict[str, Any]) -> str:
    text = json.dumps(what, sort_keys=True, default=list)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


@cache
def _set_hash(name: str) -> str:
    return recipe_hash(resolve(load_recipe(name)))


@cache
def _scene_hash(name: str) -> str:
    scene, start = load_scene(name)
    text = json.dumps([scene.to_mapping(), asdict(start)], sort_keys=True, default=list)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
