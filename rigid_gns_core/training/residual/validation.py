# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Errors of short rollouts with a residual network, from observed states of held-out tracks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np

from .frames import Track
from ...data.records import Record
from ...engine.learned_network import LearnedNetwork, network_of
from ...engine.learned_stepper import LearnedStepper
from ...engine.options import LawsOptions
from ...files.checkpoint import Tensors
from ...prediction.laws import UNITS
from ...scenes.state import Array

if TYPE_CHECKING:
    from .learner import ResidualTrainConfig

# rollouts of a record
_STARTS = 6


def rollout_error(
    tensors: Tensors, config: ResidualTrainConfig, records: Sequence[Record]
) -> float:
    """Mean position error after `validation_steps` frames [radii]; infinite: one diverged."""
    network = network_of(tensors, config.model)
    errors = rollout_errors(
        network, [Track.of(record) for record in records], [config.validation_steps]
    )
    return float(np.nanmean(errors)) if np.isfinite(errors).any() else float('inf')


def rollout_errors(
    network: LearnedNetwork, tracks: Sequence[Track], horizons: Sequence[int]
) -> Array:
    """Mean position errors of each track after so many frames, shape (t, h) [radii].

    NaN where a track is too short, infinite where a rollout diverged.
    """
    found = np.full((len(tracks), len(horizons)), np.nan)
    for t, track in enumerate(tracks):
        last = track.last_start(max(horizons))
        if last < 0:
            continue
        errors = []
        for sample in np.linspace(0, last, _STARTS).astype(int):
            stepper = LearnedStepper(
                network, track.scene, track.at(int(sample)), UNITS.dt, **asdict(LawsOptions())
            )
            states, error = stepper.advance(max(horizons))
            if error:
                errors.append(np.full((1, len(horizons)), np.inf))
                continue
            seen = [track.at(int(sample) + k * track.samples).positions for k in horizons]
            made = states.positions[np.array(horizons) - 1]
            errors.append(np.linalg.norm(made - seen, axis=-1).T)
        found[t] = np.concatenate(errors).mean(axis=0)
    return found
