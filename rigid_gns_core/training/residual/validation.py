# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Error of short rollouts with a residual network, from observed states of held-out tracks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np

from .frames import Track
from ...data.records import Record
from ...engine.learned_network import network_of
from ...engine.learned_stepper import LearnedStepper
from ...engine.options import LawsOptions
from ...files.checkpoint import Tensors
from ...prediction.laws import UNITS

if TYPE_CHECKING:
    from .learner import ResidualTrainConfig

# rollouts of a record
_STARTS = 6


def rollout_error(
    tensors: Tensors, config: ResidualTrainConfig, records: Sequence[Record]
) -> float:
    """Mean position error after `validation_steps` frames [radii]; infinite: one diverged."""
    network, errors = network_of(tensors, config.model), []
    for record in records:
        track, steps = Track.of(record), config.validation_steps
        last = track.last_start(steps)
        if last < 0:
            continue
        for sample in np.linspace(0, last, _STARTS).astype(int):
            stepper = LearnedStepper(
                network, track.scene, track.at(int(sample)), UNITS.dt, **asdict(LawsOptions())
            )
            states, error = stepper.advance(steps)
            if error:
                return float('inf')
            seen = track.at(int(sample) + steps * track.samples)
            errors.append(np.linalg.norm(states.positions[-1] - seen.positions, axis=1))
    return float(np.mean(np.concatenate(errors))) if errors else float('inf')
