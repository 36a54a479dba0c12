# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""One world and one seed: observe, fit the laws, train a residual on them, judge on new tracks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
import time
from typing import Any
import warnings

import numpy as np

from .fit import fit_laws
from .worlds import FRAME, MATERIALS, observe, Observed, SAMPLES, WORLDS
from ...files.config import check_least, find_config, from_mapping, load_yaml
from ...prediction.load import load_simulator
from ...rollout.simulator import Simulator
from ...scenes.scene import Scene
from ...scenes.state import State, Trajectory

HORIZONS = (1, 3, 10, 30)
"""Frames after which errors are judged."""
# the world against itself: its start moved by so much [m] in each direction
_MOVED = 1e-3


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
        changes: Changes to config/train/residual.yaml.
    """

    train: int
    validation: int
    test: int
    frames: int = 50
    noise: float = 0.002
    windows: int = 150
    starts: int = 6
    seeds: tuple[int, ...] = (0, 1, 2)
    changes: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_least(self, 1, 'train', 'validation', 'test', 'windows', 'starts')
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
    """Results of one world and seed; the training in `folder` is resumed.

    Returns:
        `materials` (given and fitted), `errors` by simulator and horizon [m], `frames_per_second`
        of the laws and of the residual, `training`: steps, the error on validation tracks, and
        the strength that they chose, with its error over that of the laws.
    """
    from ...training.recipes import load_recipe
    from ...training.train import Trainer

    first = 10 * seed
    tracks = [
        observe(world, first + kind, index, budget.frames, budget.noise)
        for kind, count in ((1, budget.train), (2, budget.validation))
        for index in range(count)
    ]
    test = [observe(world, first + 3, k, budget.frames, 0.0) for k in range(budget.test)]
    laws = load_simulator('laws')
    fitted = fit_laws(laws, tracks[: budget.train], budget.windows, seed)
    records = [one.record(fitted) for one in tracks]
    recipe = replace(load_recipe('residual'), seed=seed, **budget.changes)
    trainer = Trainer(
        recipe, records[: budget.train], records[budget.train :], folder, f'world {world}'
    )
    best = trainer.run()
    chosen = asdict(trainer.comparison) if trainer.comparison else {}
    learned = load_simulator(folder / 'best')
    given = tracks[0].scene
    errors = {
        'laws given': _errors(laws, given, test, budget.starts),
        'laws fitted': _errors(laws, fitted, test, budget.starts),
        'residual': _errors(learned, fitted, test, budget.starts),
        'world moved by 1 mm': _own_errors(world, test, budget.starts, seed),
    }
    return {
        'world': world,
        'seed': seed,
        'materials': {
            name: {key: float(np.mean(getattr(scene, key))) for key in MATERIALS}
            for name, scene in (('given', given), ('fitted', fitted))
        },
        'errors': errors,
        'frames_per_second': _speeds({'laws': laws, 'residual': learned}, fitted, test),
        'training': {'steps': recipe.steps, 'validation_error': best, **chosen},
        'budget': asdict(budget),
    }


def _starts(one: Observed, count: int) -> list[int]:
    last = len(one.truth) - 1 - max(HORIZONS) * SAMPLES
    return [int(sample) for sample in np.linspace(0, last, count)]


def _errors(
    simulator: Simulator, scene: Scene, test: Sequence[Observed], starts: int
) -> dict[str, float]:
    """Mean position error over spheres after each horizon [m], from true states."""
    materials = {name: getattr(scene, name) for name in MATERIALS}
    found: dict[int, list[Any]] = {frames: [] for frames in HORIZONS}
    for one in test:
        own = replace(one.scene, **materials)
        for sample in _starts(one, starts):
            state = one.truth[sample]
            with warnings.catch_warnings():
                warnings.simplefilter('error')  # a rollout that diverged has no mean
                made = simulator.rollout(own, steps=max(HORIZONS), **vars(state))
            _compare(made, 1, one, sample, found)
    return _means(found)


def _own_errors(world: str, test: Sequence[Observed], starts: int, seed: int) -> dict[str, float]:
    """As `_errors`, of the world itself from a start that is moved a little."""
    rng = np.random.default_rng([seed, 5])
    found: dict[int, list[Any]] = {frames: [] for frames in HORIZONS}
    for one in test:
        for sample in _starts(one, starts):
            state = one.truth[sample]
            moved = replace(
                state, positions=state.positions + _MOVED * rng.standard_normal((len(state), 3))
            )
            made = WORLDS[world](one.scene, moved, max(HORIZONS))
            _compare(made, SAMPLES, one, sample, found)
    return _means(found)


def _compare(
    made: Trajectory, samples: int, one: Observed, sample: int, found: dict[int, list[Any]]
) -> None:
    for frames, errors in found.items():
        truth = one.truth.positions[sample + frames * SAMPLES]
        errors.append(np.linalg.norm(made.positions[frames * samples] - truth, axis=1))


def _means(found: dict[int, list[Any]]) -> dict[str, float]:
    return {
        f'{frames * FRAME:g}': float(np.mean(np.concatenate(errors)))
        for frames, errors in found.items()
    }


def _speeds(
    simulators: dict[str, Simulator], scene: Scene, test: Sequence[Observed]
) -> dict[str, float]:
    """Frames a second, one after the other in each scene."""
    spent = dict.fromkeys(simulators, 0.0)
    materials = {name: getattr(scene, name) for name in MATERIALS}
    for one in test[:10]:
        state: State = one.truth[0]
        for name, simulator in simulators.items():
            begun = time.perf_counter()
            simulator.rollout(replace(one.scene, **materials), steps=50, **vars(state))
            spent[name] += time.perf_counter() - begun
    return {name: 50.0 * len(test[:10]) / seconds for name, seconds in spent.items()}
