# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Training recipes from YAML."""

from __future__ import annotations

from pathlib import Path

from .gns.learner import GNSTrainConfig
from .residual.learner import ResidualTrainConfig
from ..errors import shown
from ..files.config import ConfigError, find_config, from_mapping, load_yaml

RECIPES: dict[str, type[GNSTrainConfig] | type[ResidualTrainConfig]] = {
    'gns': GNSTrainConfig,
    'residual': ResidualTrainConfig,
}


def load_recipe(name: str | Path) -> GNSTrainConfig | ResidualTrainConfig:
    """Training recipe of a YAML file, or of a shipped name in config/train; `kind` is the model's.

    Raises:
        ConfigError: No such recipe, an unknown key, or a value out of range.
    """
    path = find_config('train', name)
    mapping = load_yaml(path)
    kind = mapping.pop('kind', None)
    if not isinstance(kind, str) or kind not in RECIPES:
        raise ConfigError(f'{path}: kind is {shown(kind)}, allowed: {", ".join(RECIPES)}')
    return from_mapping(RECIPES[kind], mapping, str(path))
