# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Train a simulator from a YAML recipe; validation by rollout, resume to the same bytes."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
import json
import math
from pathlib import Path
import sys
import time
from typing import Any, TypeAlias
import warnings

import numpy as np
import torch
import yaml

from .fine_tune import StartingPoint
from .gns.learner import GNSLearner, GNSTrainConfig
from .recipes import load_recipe
from .residual.gate import Comparison, held_out, keep_what_wins
from .residual.learner import ResidualLearner, ResidualTrainConfig
from .residual.shortcomings import shortcomings
from .residual.validation import rollout_error
from ..data.common_scene import fingerprint
from ..data.records import Dataset, Record
from ..errors import UserError
from ..files.atomic_file import make_folder, whole_file
from ..files.checkpoint import finish_saving, load_tensors, save_model, save_tensors, tensors_of
from ..files.config import ConfigError, load_yaml, to_mapping
from ..prediction.gns import GNSSimulator
from ..rollout.simulator import Simulator
from ..running.interrupt import stop_on_signal
from ..running.progress import Progress
from ..scenes.scene_file import load_scene
from ..scoring import chamfer

TrainConfig: TypeAlias = GNSTrainConfig | ResidualTrainConfig

STATE, RECIPE, LOG = 'state.safetensors', 'recipe.yaml', 'log.jsonl'
SAVE_EVERY = 60.0
"""Time between saved states, the most that a killed run loses [s]."""


class Trainer:
    """Trains in a folder; `run` resumes an earlier run of it.

    Args:
        config: The recipe.
        records: Training trajectories that the kind of model can learn from.
        validation: Held-out trajectories; the error of their rollouts chooses the best checkpoint.
        folder: Holds `best` (weights and card), the run's state, its recipe and its log.
        origin: Where the data came from, kept in the card.
        device: Where the network is trained; None: the CPU.
        start: Weights to begin with, whose units the records are in; None: random ones.

    Raises:
        UserError: There are no records, or the kind of model cannot learn from them.
        ConfigError: The folder belongs to another recipe, other data or another start.
        CheckpointError: The network of the recipe is not that of the start.
    """

    def __init__(
        self,
        config: TrainConfig,
        records: Sequence[Record],
        validation: Sequence[Record],
        folder: str | Path,
        origin: str = '',
        device: torch.device | None = None,
        start: StartingPoint | None = None,
    ) -> None:
        self.config, self.folder, self.origin, self.start = config, Path(folder), origin, start
        self.validation = (
            list(validation[: config.validation_rollouts])
            if isinstance(config, ResidualTrainConfig)
            else _long_enough(validation, config)
        )
        self.data = {'data': fingerprint(records), 'validation': fingerprint(self.validation)}
        self.learner: GNSLearner | ResidualLearner
        if isinstance(config, ResidualTrainConfig):
            self.learner = ResidualLearner.of(config, records)
        else:
            self.learner = GNSLearner.of(config, records, device)
        self.best = math.inf
        self.losses: list[float] = []  # since the last validation
        self.comparison: Comparison | None = None
        self._resume()
        if start is not None:
            start.load(self.learner)

    def run(self, stop_at: int | None = None) -> float:
        """Train up to step `stop_at` (None: the recipe's end); returns the best validation score.

        Raises:
            FloatingPointError: Loss or gradient are not finite; the last checkpoint stays.
            KeyboardInterrupt: SIGINT or SIGTERM came; the state is saved.
        """
        learner, config = self.learner, self.config
        end = config.steps if stop_at is None else min(stop_at, config.steps)
        losses = self.losses
        self._saved = time.monotonic()
        with Progress(end, 'train', initial=learner.step) as progress, stop_on_signal() as stop:
            while learner.step < end and not stop:
                losses.append(learner.advance())
                progress.update(loss=float(np.mean(losses[-100:])), best=self.best)
                if learner.step % config.validate_every == 0 or learner.step == config.steps:
                    self._validate_and_save(progress)
                elif time.monotonic() - self._saved > SAVE_EVERY:
                    self._save_state()
            self._save_state()
            if stop:
                progress.line(f'stopped; the same command resumes from {self.folder}')
                raise KeyboardInterrupt
        if isinstance(config, ResidualTrainConfig) and learner.step >= config.steps:
            steps = config.validation_steps
            self.comparison = keep_what_wins(self.folder / 'best', self.validation, steps)
        return self.best

    def validate(self) -> float:
        """Mean over held-out records, infinite where a rollout diverged [radii].

        Of a GNS: the root Chamfer distance of a rollout. Of a residual network, with whose
        rollouts each sphere keeps its name: the mean position error at the end of short ones.
        """
        if not self.validation:
            return math.inf
        if isinstance(self.config, ResidualTrainConfig):
            with self.learner.averaged_weights() as network:
                return rollout_error(tensors_of(network), self.config, self.validation)
        with self.learner.averaged_weights() as network, warnings.catch_warnings():
            warnings.simplefilter('ignore')  # a rollout that diverges shows in the score
            simulator = GNSSimulator(tensors_of(network), self.card(None), 'validation')
            scores = [self._rollout_score(simulator, record) for record in self.validation]
        return float(np.mean(scores))

    def card(self, score: float | None) -> dict[str, Any]:
        """Card of a checkpoint with this validation score [radii]."""
        return {
            'kind': self.learner.kind,
            'config': to_mapping(self.learner.model),
            'units': to_mapping(self.learner.units),
            'materials': self.learner.materials,
            'training': {
                **to_mapping(self.config),
                'step': self.learner.step,
                'data': self.origin,
                'trajectories': self.learner.trajectories,
            },
            'validation': {self.learner.measure: score},
        }

    def _rollout_score(self, simulator: Simulator, record: Record) -> float:
        reference = record.trajectory.window(0, self.config.validation_steps + 1)
        predicted = simulator.rollout(
            record.scene, steps=self.config.validation_steps, **vars(reference[0])
        )
        if predicted.diverged_at is not None:
            return math.inf
        radius = float(np.max(record.scene.radius))
        return math.sqrt(chamfer(predicted.positions, reference.positions)) / radius

    def _validate_and_save(self, progress: Progress) -> None:
        score = self.validate()
        better = score < self.best
        step = self.learner.step
        entry = {
            'step': step,
            'loss': float(np.mean(self.losses)),
            'validation': score if math.isfinite(score) else None,
            'learning_rate': self.config.learning_rate_at(step),
        }
        progress.line(
            f'step {step}: loss {entry["loss"]:.4g}, validation {score:.4g}'
            + (' (best so far)' if better else '')
        )
        if better or not self.validation or not (self.folder / 'best.safetensors').exists():
            self.best = min(score, self.best)
            with self.learner.averaged_weights() as network:
                finite = score if math.isfinite(score) else None
                save_model(self.folder / 'best', network, self.card(finite))
        # a run killed before its state is saved comes here again, and drops this line before
        with open(self.folder / LOG, 'a', encoding='utf-8') as log:
            log.write(json.dumps(entry) + '\n')
        self.losses.clear()
        self._save_state()

    def _save_state(self) -> None:
        state = {name: value.numpy() for name, value in self.learner.state().items()}
        own = {'best': np.array(self.best), 'losses': np.array(self.losses, dtype=np.float64)}
        save_tensors(self.folder / STATE, {**state, **own})
        self._saved = time.monotonic()

    def _resume(self) -> None:
        self._claim_folder()
        if (self.folder / STATE).is_file():
            tensors = load_tensors(self.folder / STATE)
            self.best = float(tensors.pop('best'))
            self.losses = tensors.pop('losses', np.zeros(0)).tolist()  # older runs have none
            self.learner.load_state({k: torch.from_numpy(v) for k, v in tensors.items()})
        self._trim_log()

    def _trim_log(self) -> None:
        """Drop what a killed run logged after its last state, or has written by half."""
        log = self.folder / LOG
        if not log.is_file():
            return
        text = log.read_text(encoding='utf-8')
        whole = text[: text.rfind('\n') + 1].splitlines(keepends=True)
        kept = ''.join(line for line in whole if json.loads(line)['step'] <= self.learner.step)
        if kept != text:
            with whole_file(log) as partial:
                partial.write_text(kept, encoding='utf-8')

    def _claim_folder(self) -> None:
        make_folder(self.folder)
        for left_over in self.folder.glob('.*.tmp'):  # of a run that was killed
            left_over.unlink()
        finish_saving(self.folder / 'best')
        recipe = self.folder / RECIPE
        asked = {**to_mapping(self.config), 'sha256': self.data}
        if self.start is not None:
            asked['from'] = self.start.name
        text = yaml.safe_dump(asked, sort_keys=False)
        if recipe.is_file() and recipe.read_text(encoding='utf-8') != text:
            known = load_yaml(recipe)
            if known.get('from') != asked.get('from'):
                before, now = (x.get('from', 'no model') for x in (known, asked))
                raise ConfigError(
                    f'{recipe}: the run was started from {before}, but this one would be from '
                    f'{now}; give the same --from, or another folder'
                )
            keys = [key for key, value in asked.items() if known.get(key) != value]
            raise ConfigError(
                f'{recipe} differs from the recipe and data asked for in {", ".join(keys)}; '
                'use the same, or another folder'
            )
        if not recipe.is_file():
            with whole_file(recipe) as partial:
                partial.write_text(text, encoding='utf-8')


def find_device(name: str) -> torch.device:
    """Device to train on: `cpu`, `cuda`, or `auto` for CUDA where there is one.

    Raises:
        UserError: CUDA is asked for and there is none.
    """
    if name == 'cuda' and not torch.cuda.is_available():
        raise UserError('device is cuda, but torch finds no CUDA device here; use --device cpu')
    if name == 'auto':
        name = 'cuda' if torch.cuda.is_available() else 'cpu'
    return torch.device(name)


def _long_enough(records: Sequence[Record], config: TrainConfig) -> list[Record]:
    enough = [r for r in records if r.trajectory.steps >= config.validation_steps]
    if records and not enough:
        raise UserError(
            f'no validation trajectory has {config.validation_steps} steps (validation_steps), '
            f'the longest has {max(record.trajectory.steps for record in records)}; lower it, or '
            'generate longer ones'
        )
    return enough[: config.validation_rollouts]


@contextmanager
def _memory_told() -> Iterator[None]:
    """Raise a MemoryError where torch, which has another error for it, has too little memory."""
    try:
        yield
    except RuntimeError as error:
        if not (isinstance(error, torch.OutOfMemoryError) or 'allocate memory' in str(error)):
            raise
        raise MemoryError('train with a smaller batch, or a smaller model') from error


def run(arguments: argparse.Namespace) -> int:
    """Run `rigid-gns train`; its options are in commands/train.py."""
    config = load_recipe(arguments.config)
    changes = {name: getattr(arguments, name) for name in ('steps', 'seed')}
    config = replace(config, **{k: v for k, v in changes.items() if v is not None})
    torch.set_num_threads(arguments.threads)
    device = find_device(arguments.device)
    validation = list(Dataset(arguments.validation)) if arguments.validation else []
    records = [record for folder in arguments.data for record in Dataset(folder)]
    if arguments.scene:
        scene = load_scene(arguments.scene)
        records, validation = (
            [replace(record, scene=scene) for record in some] for some in (records, validation)
        )
    if isinstance(config, ResidualTrainConfig) and not validation:
        records, validation = held_out(records, config.validation_rollouts)
        if validation:
            count = len(records) + len(validation)
            print(
                f'note: {len(validation)} of {count} trajectories are held out to choose the '
                'weights and their strength; name others by --validation',
                file=sys.stderr,
            )
    origin = ' '.join(folder.name for folder in arguments.data)
    if start := StartingPoint.of(arguments.start) if arguments.start else None:
        records, validation = start.records(records), start.records(validation)
        origin += f' from {start.name}'
    with _memory_told():
        trainer = Trainer(config, records, validation, arguments.out, origin, device, start)
        if isinstance(trainer.learner, ResidualLearner):
            for text in shortcomings(trainer.learner.tracks, arguments.data):
                print(f'note: {text}', file=sys.stderr)
        best = trainer.run()
    score = f'best validation {best:.4g}' if validation else 'no validation set: last weights'
    print(f'{score}; weights: {arguments.out / "best.safetensors"}')
    if trainer.comparison is not None:
        print(trainer.comparison)
    return 0
