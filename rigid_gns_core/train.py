"""Train a simulator from a YAML recipe, with validation by rollout and resume to the same bytes."""

from __future__ import annotations

import argparse
import json
import math
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
import yaml

from .checkpoint import load_tensors, save_model, save_tensors
from .config import ConfigError, find_config, from_mapping, load_yaml, to_mapping
from .dataset import Dataset, Record
from .learner import Learner, TrainConfig
from .metrics import chamfer
from .progress import Progress
from .rollout import Simulator
from .similarity import ModelUnits
from .windows import Source

STATE, RECIPE, LOG = 'state.safetensors', 'recipe.yaml', 'log.jsonl'


class Trainer:
    """Trains in a folder; `run` goes on from what an earlier run left there.

    Args:
        config: The recipe.
        records: Training trajectories, of one radius, gravity, time step and material.
        validation: Held-out trajectories; rollouts of them choose the best checkpoint.
        folder: Holds `best` (weights and card), the run's state, its recipe and its log.
        origin: Where the data came from, kept in the card.

    Raises:
        ValueError: There are no records, or they differ in radius, gravity, dt or material.
        ConfigError: The folder belongs to another recipe.
    """

    def __init__(
        self,
        config: TrainConfig,
        records: Sequence[Record],
        validation: Sequence[Record],
        folder: str | Path,
        origin: str = '',
    ) -> None:
        self.config, self.folder, self.origin = config, Path(folder), origin
        self.units, self.materials = common_scene(records)
        self.validation = [
            record for record in validation if record.trajectory.steps >= config.validation_steps
        ][: config.validation_rollouts]
        sources = [Source.of(record.trajectory, record.scene) for record in records]
        self.learner = Learner(config, sources, self.units)
        self.best = math.inf
        self._resume()

    def run(self, stop_at: int | None = None) -> float:
        """Train up to step `stop_at` (None: the recipe's end); returns the best validation score.

        Raises:
            FloatingPointError: The loss is not finite; the last checkpoint stays.
        """
        learner, config = self.learner, self.config
        end = config.steps if stop_at is None else min(stop_at, config.steps)
        losses: list[float] = []
        with Progress(end, 'train', initial=learner.step) as progress:
            try:
                while learner.step < end:
                    losses.append(learner.advance())
                    progress.update(loss=float(np.mean(losses[-100:])), best=self.best)
                    if learner.step % config.validate_every == 0 or learner.step == config.steps:
                        self._validate_and_save(losses, progress)
                        losses.clear()
            except KeyboardInterrupt:
                progress.line(f'interrupted; the same command goes on from {self.folder}')
                raise
            finally:
                self._save_state()
        return self.best

    def validate(self) -> float:
        """Mean over held-out rollouts of the root Chamfer distance [radii]; inf: diverged."""
        scores = [math.inf]
        if self.validation:
            with self.learner.averaged_weights() as network, warnings.catch_warnings():
                warnings.simplefilter('ignore')  # a rollout that diverges shows in the score
                simulator = Simulator(network, self.card(None), 'validation')
                scores = [self._rollout_score(simulator, record) for record in self.validation]
        return float(np.mean(scores))

    def card(self, score: float | None) -> dict[str, Any]:
        """What a checkpoint says of itself."""
        return {
            'kind': 'gns',
            'config': to_mapping(self.config.model),
            'units': to_mapping(self.units),
            'materials': self.materials,
            'training': {
                **to_mapping(self.config),
                'step': self.learner.step,
                'data': self.origin,
                'trajectories': len(self.learner.sources),
            },
            'validation': {'root_chamfer_radii': score},
        }

    def _rollout_score(self, simulator: Simulator, record: Record) -> float:
        reference = record.trajectory.window(0, self.config.validation_steps + 1)
        start = reference[0]
        predicted = simulator.rollout(
            record.scene,
            start.positions,
            start.velocities,
            start.angular_velocities,
            self.config.validation_steps,
            quaternions=start.quaternions,
        )
        if predicted.diverged_at is not None:
            return math.inf
        return math.sqrt(chamfer(predicted.positions, reference.positions)) / self.units.radius

    def _validate_and_save(self, losses: list[float], progress: Progress) -> None:
        score = self.validate()
        better = score < self.best
        step = self.learner.step
        entry = {
            'step': step,
            'loss': float(np.mean(losses)),
            'validation': score if math.isfinite(score) else None,
            'learning_rate': self.config.learning_rate_at(step),
        }
        with open(self.folder / LOG, 'a', encoding='utf-8') as log:
            log.write(json.dumps(entry) + '\n')
        progress.line(
            f'step {step}: loss {entry["loss"]:.4g}, validation {score:.4g}'
            + (' (best so far)' if better else '')
        )
        if better or not self.validation or not (self.folder / 'best.safetensors').exists():
            self.best = min(score, self.best)
            with self.learner.averaged_weights() as network:
                finite = score if math.isfinite(score) else None
                save_model(self.folder / 'best', network, self.card(finite))
        self._save_state()

    def _save_state(self) -> None:
        best = {'best': torch.tensor(self.best, dtype=torch.float64)}
        save_tensors(self.folder / STATE, {**self.learner.state(), **best})

    def _resume(self) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        recipe = self.folder / RECIPE
        text = yaml.safe_dump(to_mapping(self.config), sort_keys=False)
        if recipe.is_file() and recipe.read_text(encoding='utf-8') != text:
            raise ConfigError(
                f'{recipe} differs from the recipe asked for; use the same, or another folder'
            )
        recipe.write_text(text, encoding='utf-8')
        if (self.folder / STATE).is_file():
            tensors = load_tensors(self.folder / STATE)
            self.best = float(tensors.pop('best'))
            self.learner.load_state(tensors)


def common_scene(records: Sequence[Record]) -> tuple[ModelUnits, dict[str, float]]:
    """Units and materials that all records share.

    Raises:
        ValueError: There are no records, or they differ.
    """
    if not records:
        raise ValueError('there are no training trajectories; run `rigid-gns generate` first')
    found: set[tuple[float, ...]] = set()
    for record in records:
        scene = record.scene
        values = [scene.radius, scene.restitution, scene.friction, scene.rolling_friction]
        numbers = [value for value in values if isinstance(value, float)]
        if len(numbers) < len(values):
            raise ValueError(
                f'record {record.name!r} has per-sphere properties, but the GNS knows one of each; '
                'generate data with one radius and one material'
            )
        gravity = float(np.linalg.norm(scene.gravity))
        found.add((record.trajectory.dt, gravity, *numbers))
    if len(found) > 1:
        raise ValueError(
            'the training trajectories differ in (dt, gravity, radius, restitution, friction, '
            f'rolling_friction): {sorted(found)[:3]}; train on data of one kind'
        )
    dt, gravity, radius, restitution, friction, rolling = found.pop()
    materials = {'restitution': restitution, 'friction': friction, 'rolling_friction': rolling}
    return ModelUnits(radius=radius, gravity=gravity, dt=dt), materials


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `rigid-gns train`."""
    parser.add_argument('--config', default='gns', help='recipe: a file or a name in config/train')
    parser.add_argument('--data', required=True, type=Path, help='folder made by generate')
    parser.add_argument('--validation', type=Path, help='held-out folder that chooses the best')
    parser.add_argument('--out', required=True, type=Path, help='folder of the run; resumed if old')
    parser.add_argument('--steps', type=int, help="optimiser steps instead of the recipe's")
    parser.add_argument('--seed', type=int, help="seed instead of the recipe's")
    parser.add_argument('--threads', type=int, default=2, help='CPU threads (default 2)')
    parser.epilog = (
        'example:\n  rigid-gns train --config gns --data data/gns --validation data/gns_test '
        '--out runs/gns\n  rigid-gns evaluate --model runs/gns/best --data data/gns_test'
    )


def run(arguments: argparse.Namespace) -> int:
    """Run `rigid-gns train`."""
    path = find_config('train', arguments.config)
    config = from_mapping(TrainConfig, load_yaml(path), str(path))
    changes = {name: getattr(arguments, name) for name in ('steps', 'seed')}
    config = replace(config, **{k: v for k, v in changes.items() if v is not None})
    torch.set_num_threads(arguments.threads)
    validation = list(Dataset(arguments.validation)) if arguments.validation else []
    trainer = Trainer(
        config, list(Dataset(arguments.data)), validation, arguments.out, arguments.data.name
    )
    best = trainer.run()
    print(f'best validation {best:.4g} radii; weights: {arguments.out / "best.safetensors"}')
    return 0
