# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The thesis' GNS, trained on the tracks of a world as the residual network is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..thesis.budget import merged
from ...data.records import Record
from ...files.config import find_config, from_mapping, load_yaml
from ...prediction.load import load_simulator
from ...rollout.simulator import Simulator
from ...scenes.state import Trajectory
from ...training.gns.learner import GNSTrainConfig
from ...training.train import Trainer


def gns_recipe(changes: Mapping[str, Any], seed: int) -> GNSTrainConfig:
    """Recipe config/train/gns.yaml with changes.

    Raises:
        ConfigError: An unknown key, or a value out of range.
    """
    path = find_config('train', 'gns')
    mapping = merged(load_yaml(path), {**changes, 'seed': seed})
    del mapping['kind']
    return from_mapping(GNSTrainConfig, mapping, f'{path} with {dict(changes)}')


def train_gns(
    train: Sequence[Record],
    validation: Sequence[Record],
    samples: int,
    recipe: GNSTrainConfig,
    folder: Path,
    origin: str,
) -> tuple[Simulator, float]:
    """GNS trained on what was tracked, one pose a frame as it steps; and its validation score.

    Its velocities are differences of poses, which is the thesis' way; each track gives
    `samples` sequences, one for each sample of a frame that they may begin at.
    """
    learned = [_frames(one, first, samples) for one in train for first in range(samples)]
    held_out = [_frames(one, 0, samples) for one in validation]
    best = Trainer(recipe, learned, held_out, folder, origin).run()
    return load_simulator(folder / 'best'), best


def _frames(one: Record, first: int, samples: int) -> Record:
    """Record of every frame of a track, from one of its first samples on."""
    tracked = one.trajectory
    poses = tracked.positions[first::samples], tracked.quaternions[first::samples]
    made = Trajectory.from_poses(*poses, samples * tracked.dt)
    return Record(trajectory=made, scene=one.scene, seed=0)
