# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Kinds of training: recipe and learner."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch

from .gns.learner import GNSLearner, GNSTrainConfig
from .learner import Learner, Schedule
from ..data.records import Record
from ..files.config import ConfigError, find_config, from_mapping, load_yaml

RECIPES: dict[str, type[Schedule]] = {'gns': GNSTrainConfig}


def load_recipe(name: str | Path) -> Schedule:
    """Training recipe of a YAML file, or of a shipped name in config/train; `kind` is the model's.

    Raises:
        ConfigError: No such recipe, an unknown key, or a value out of range.
    """
    path = find_config('train', name)
    mapping = load_yaml(path)
    kind = mapping.pop('kind', None)
    if kind not in RECIPES:
        raise ConfigError(f'{path}: kind is {kind!r}, allowed: {", ".join(RECIPES)}')
    return from_mapping(RECIPES[kind], mapping, str(path))


def make_learner(
    config: Schedule, records: Sequence[Record], device: torch.device | None = None
) -> Learner[Any]:
    """Learner of the recipe's kind of model.

    Raises:
        UserError: The kind of model cannot learn from these records.
    """
    assert isinstance(config, GNSTrainConfig)
    return GNSLearner.of(config, records, device)
