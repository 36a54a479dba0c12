# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A world and a seed: tracks, fit of the laws, both trainings, and errors on other tracks."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from .fit import fit_laws
from .judged import errors_of, HORIZONS, own_errors, Rival, speeds_of
from .worlds import MATERIALS, observe, SAMPLES
from ...files.config import check_least, find_config, from_mapping, load_yaml
from ...prediction.load import load_simulator


@dataclass(frozen=True)
class WorldsBudget:
    """A budget of the study; config/worlds explains the shipped ones.

    Args:
        train: Trajectories to learn from.
        validation: Trajectories that choose the weights.
        test: Trajectories that judge.
        frames: Length of a trajectory.
        noise: Of the tracker, positions [radii] and rotations [rad].
        windows: Starts of the fit of the laws.
        starts: Starts in each test trajectory.
        seeds: Seeds; each has tracks of its own.
        restarts: Test trajectories in which the world is compared with itself, two starts each.
        changes: Changes to config/train/residual.yaml.
        gns: Changes to config/train/gns.yaml.
    """

    train: int
    validation: int
    test: int
    frames: int = 50
    noise: float = 0.002
    windows: int = 150
    starts: int = 6
    seeds: tuple[int, ...] = (0, 1, 2)
    restarts: int = 8
    changes: dict[str, Any] = field(default_factory=dict)
    gns: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_least(self, 1, 'train', 'validation', 'test', 'windows', 'starts', 'restarts')
        check_least(self, max(HORIZONS), 'frames')
        check_least(self, 0, 'noise')


def load_worlds_budget(name: str | Path) -> WorldsBudget:
    """Budget of a YAML file, or of a shipped name in config/worlds.

    Raises:
        ConfigError: No such budget, an unknown key, or a value out of range.
    """
    path = find_config('worlds', name)
    return from_mapping(WorldsBudget, load_yaml(path), str(path))


def run_world(world: str, seed: int, budget: WorldsBudget, folder: Path) -> dict[str, Any]:
    """Results of one world and seed; trainings in `folder` are resumed.

    Returns:
        `materials` (given and fitted), `errors` by simulator and time ahead [m],
        `frames_per_second` of each, `training` of the residual network: steps, the error on
        validation tracks, and the strength that they chose, with its error over that of the
        laws; `gns`: steps and validation score of the thesis' network.
    """
    from .baseline import gns_recipe, train_gns
    from ...training.recipes import load_recipe
    from ...training.train import Trainer

    first, origin = 10 * seed, f'world {world}'
    baseline = gns_recipe(budget.gns, seed)
    train, validation = (
        [observe(world, first + kind, k, budget.frames, budget.noise) for k in range(count)]
        for kind, count in ((1, budget.train), (2, budget.validation))
    )
    test = [observe(world, first + 3, k, budget.frames, 0.0) for k in range(budget.test)]
    laws, given = load_simulator('laws'), train[0].scene
    fitted = fit_laws(laws, train, budget.windows, seed)
    recipe = replace(load_recipe('residual'), seed=seed, **budget.changes)
    trainer = Trainer(
        recipe,
        [one.record(fitted) for one in train],
        [one.record(fitted) for one in validation],
        folder / 'residual',
        origin,
    )
    best = trainer.run()
    chosen = asdict(trainer.comparison) if trainer.comparison else {}
    plain, others = ([one.record(given) for one in part] for part in (train, validation))
    gns, score = train_gns(plain, others, SAMPLES, baseline, folder / 'gns', origin)
    rivals = {
        'laws given': Rival(laws, given),
        'laws fitted': Rival(laws, fitted),
        'laws fitted + residual': Rival(load_simulator(folder / 'residual' / 'best'), fitted),
        'GNS': Rival(gns, given),
    }
    errors = {name: errors_of(rival, test, budget.starts) for name, rival in rivals.items()}
    speeds = speeds_of(rivals, test)
    itself = 'world moved by 1 mm'
    errors[itself], speeds[itself] = own_errors(world, test[: budget.restarts], 2, seed)
    return {
        'world': world,
        'seed': seed,
        'materials': {
            name: {key: float(np.mean(getattr(scene, key))) for key in MATERIALS}
            for name, scene in (('given', given), ('fitted', fitted))
        },
        'errors': errors,
        'frames_per_second': speeds,
        'training': {'steps': recipe.steps, 'validation_error': best, **chosen},
        'gns': {'steps': baseline.steps, 'validation_score': score},
        'budget': asdict(budget),
    }
