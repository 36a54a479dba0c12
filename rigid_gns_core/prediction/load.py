# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Load a model by name or path: the laws, or a trained network."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

from .gns import GNSSimulator
from .laws import LawsSimulator
from .residual import ResidualSimulator
from ..engine.options import ResidualConfig
from ..files.checkpoint import (
    CheckpointError,
    DEFAULT_MODEL,
    find_model,
    LAWS,
    load_card,
    load_weights,
)
from ..gns.config import GNSConfig
from ..rollout.simulator import Simulator


def load_simulator(
    name_or_path: str | Path | None = None, *, threads: int = 1, **options: Any
) -> Simulator:
    """Load the laws, which are the default, a shipped network by name, or any by path.

    Args:
        name_or_path: 'laws', 'gns', or a path; None: the laws.
        threads: CPU threads of a network; the laws take one.
        options: Of the kind of model. The laws, with or without a residual network: `guard`,
            `sleep`, `substeps`, `rounds`; see `LawsOptions`. A GNS, which needs torch: `device`,
            such as 'cuda'; see `GNSSimulator`.

    Raises:
        CheckpointError: There is no such model, or its files are damaged or of another version.
        ModuleNotFoundError: The model needs torch, which is not installed.
        UserError: The model has no such option.
    """
    name = DEFAULT_MODEL if name_or_path in (None, '') else str(name_or_path)
    if name == LAWS:
        return LawsSimulator(**options)
    path = find_model(name)
    card = load_card(path)
    configs = {GNSSimulator.kind: GNSConfig, ResidualSimulator.kind: ResidualConfig}
    if card['kind'] not in configs:
        raise CheckpointError(
            f'{path}: its card is of kind {card["kind"]!r}, known: {", ".join(configs)}'
        )
    known = {field.name for field in fields(configs[card['kind']])}
    if missing := sorted(known - set(card['config'])):
        # a default that changes later must not change what old weights mean
        raise CheckpointError(f'{path}: the config in its card lacks {", ".join(missing)}')
    tensors = load_weights(path, card['weights_sha256'])
    if card['kind'] == ResidualSimulator.kind:
        return ResidualSimulator(tensors, card, path.stem, **options)
    return GNSSimulator(tensors, card, path.stem, threads=threads, **options)
