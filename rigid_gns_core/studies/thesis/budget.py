# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Budget of an experiment: data, training steps, network width, rollouts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, TYPE_CHECKING

from ...files.config import ConfigError, find_config, from_mapping, load_yaml

if TYPE_CHECKING:
    from ...training.gns.learner import GNSTrainConfig

OOD_SCENES = ('ood_a', 'ood_b', 'ood_c', 'ood_d')


@dataclass(frozen=True)
class Data:
    """Data sets by name in config/data, scenes by name in config/scenes, or YAML files.

    Args:
        train: Training set.
        test: Test set: starts and references of the rollouts.
        half: Test set at half the teacher's substeps, for the floor of chaos.
        twice: Test set at twice the teacher's substeps.
        ood: Scenes unlike the training set.
        ood_steps: Steps of their references.
        ood_substeps: The teacher's substeps for them, even.
    """

    train: str
    test: str
    half: str
    twice: str
    ood: tuple[str, ...] = OOD_SCENES
    ood_steps: int = 2000
    ood_substeps: int = 24

    def __post_init__(self) -> None:
        _check_distinct((self.train, self.test, self.half, self.twice))
        _check_distinct(self.ood)

    @property
    def named(self) -> Data:
        """The data sets with names instead of paths, which are of one machine."""
        return replace(
            self,
            train=short(self.train),
            test=short(self.test),
            half=short(self.half),
            twice=short(self.twice),
            ood=tuple(short(name) for name in self.ood),
        )


@dataclass(frozen=True)
class Budget:
    """A budget; the shipped ones are in config/budgets.

    Args:
        words: Description, printed with every table.
        seeds: Seeds of each variant.
        data: Data sets.
        recipe: Training recipe, a name in config/train.
        changes: Changes to that recipe.
        trajectories: Number of test trajectories that are rolled out.
        steps: Steps of each rollout.
        long_steps: Steps of rollouts of unseen scenes, and of the base variant on the test set;
            these are scored after `steps` as well.
        speed_width: Width of the networks whose speed is measured.
        speed_frames: Number of frames of each trajectory that are timed.
        device: Device of training and rollouts: cpu, cuda, or auto (cuda where available).
        name: Name of its file.
    """

    words: str
    seeds: tuple[int, ...]
    data: Data
    recipe: str = 'gns'
    changes: dict[str, Any] = field(default_factory=dict)
    trajectories: int = 10
    steps: int = 500
    long_steps: int = 2000
    speed_width: int = 128
    speed_frames: int = 100
    device: Literal['cpu', 'cuda', 'auto'] = 'cpu'
    name: str = ''

    def __post_init__(self) -> None:
        for name in ('trajectories', 'steps', 'speed_width', 'speed_frames'):
            if getattr(self, name) < 1:
                raise ConfigError(f'{name} is {getattr(self, name)}, expected at least 1')
        if self.long_steps < self.steps:
            raise ConfigError(f'long_steps is {self.long_steps}, expected at least {self.steps}')
        if self.data.ood and self.data.ood_steps < self.long_steps:
            raise ConfigError(
                f'data.ood_steps is {self.data.ood_steps}, expected at least {self.long_steps} '
                '(long_steps): references must be as long as the rollouts'
            )
        if not self.seeds or min(self.seeds) < 0:
            raise ConfigError(f'seeds is {list(self.seeds)}, expected at least one, none negative')

    def training(self, changes: Mapping[str, Any], seed: int) -> GNSTrainConfig:
        """Training recipe of a variant.

        A window of K steps (closed loop) costs as much as K windows of one step, so the batch is
        divided by K, and variants compare at equal cost.

        Raises:
            ConfigError: `changes` have an unknown key; the message lists the allowed ones.
        """
        from ...training.gns.learner import GNSTrainConfig

        path = find_config('train', self.recipe)
        mapping = load_yaml(path)
        if (kind := mapping.pop('kind', None)) != 'gns':
            raise ConfigError(f'{path}: kind is {kind!r}, but the experiments train a gns')
        mapping = merged(merged(mapping, self.changes), {**changes, 'seed': seed})
        config = from_mapping(GNSTrainConfig, mapping, f'{path} with {dict(changes)}')
        return replace(config, batch=max(1, config.batch // config.closed_loop_steps))


def short(name: str) -> str:
    """Name of a data set or scene that is given by name or as a YAML file."""
    return Path(name).stem


def _check_distinct(names: Sequence[str]) -> None:
    known: dict[str, str] = {}
    for name in names:
        other = known.setdefault(short(name), name)
        if other != name:
            raise ConfigError(
                f'data names {other} and {name}, whose files would both be called {short(name)}; '
                'rename one'
            )


def load_budget(name: str | Path) -> Budget:
    """Load a budget from a YAML file, or by a shipped name in config/budgets.

    Raises:
        ConfigError: No such budget (the shipped ones are listed), or a wrong key or value.
    """
    path = find_config('budgets', name)
    return from_mapping(Budget, {'name': path.stem, **load_yaml(path)}, str(path))


def merged(mapping: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """`mapping` with the values of `changes`, recursively."""
    result = dict(mapping)
    for key, value in changes.items():
        old = result.get(key)
        both = isinstance(value, Mapping) and isinstance(old, Mapping)
        result[key] = merged(old, value) if both else value  # type: ignore[arg-type]
    return result
