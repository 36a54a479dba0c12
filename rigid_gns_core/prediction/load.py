# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Load a model by name or path: the laws, or a trained network."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

from .gns import GNSSimulator
from .laws import LawsSimulator
from ..files.checkpoint import (
    CheckpointError,
    DEFAULT_MODEL,
    find_model,
    LAWS,
    load_card,
    load_weights,
)
from ..files.config import from_mapping
from ..gns.config import GNSConfig
from ..rollout.simulator import Simulator


class Kind(NamedTuple):
    """Configuration and simulator of a kind of trained model."""

    config: type[GNSConfig]
    simulator: type[GNSSimulator]


KINDS = {'gns': Kind(GNSConfig, GNSSimulator)}


def load_simulator(
    name_or_path: str | Path | None = None, *, threads: int = 1, **options: Any
) -> Simulator:
    """Load the laws, which are the default, a shipped network by name, or any by path.

    Args:
        name_or_path: 'laws', 'gns', or a path; None: the laws.
        threads: CPU threads of a network; the laws take one.
        options: Of the kind of model. The laws: `guard`, `sleep`, `substeps`, `rounds`; see
            `LawsOptions`. A GNS, which needs torch: `device`, such as 'cuda'; see `GNSSimulator`.

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
    if card['kind'] not in KINDS:
        raise CheckpointError(
            f'{path}: its card is of kind {card["kind"]!r}, known: {", ".join(KINDS)}'
        )
    kind = KINDS[card['kind']]
    known = {field.name for field in fields(kind.config)}
    if missing := sorted(known - set(card['config'])):
        # a default that changes later must not change what old weights mean
        raise CheckpointError(f'{path}: the config in its card lacks {", ".join(missing)}')
    config = from_mapping(kind.config, card['config'], f'{path}: config')
    tensors = load_weights(path, card['weights_sha256'], config.shapes)
    return kind.simulator(tensors, card, path.stem, threads=threads, **options)
