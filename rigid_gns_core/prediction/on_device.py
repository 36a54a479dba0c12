# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Rollouts on a GPU: scenes side by side in one batch of tensors. torch is imported when asked."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import cast, TYPE_CHECKING

import numpy as np

from ..rollout.outcome import Outcome, Recording
from ..rollout.rollout import Rollout
from ..scenes.state import Array

if TYPE_CHECKING:
    import torch

    from ..gns.device_stepper import DeviceStepper

# pairs of spheres in one batch, to bound its memory on the device
_PAIRS = 2**22


def known_device(name: str, backend: str) -> torch.device:
    """Return the device of this name.

    Raises:
        ValueError: It is not there, or the backend cannot use it.
    """
    if backend != 'torch':
        raise ValueError(
            f'device is {name!r}, but backend {backend!r} runs on the CPU; '
            "give backend='torch' too"
        )
    import torch

    try:
        device = torch.device(name)
    except RuntimeError as error:
        raise ValueError(f"device is {name!r}, allowed: 'cpu', 'cuda', 'cuda:0', ...") from error
    if device.type not in ('cpu', 'cuda'):
        # graphs are made in float64, which mps for instance does not have
        raise ValueError(f"device is {name!r}, allowed: 'cpu', 'cuda', 'cuda:0', ...")
    present = torch.cuda.device_count() if torch.cuda.is_available() else 0
    if device.type == 'cuda' and (device.index or 0) >= present:
        raise ValueError(
            f'device is {name!r}, but torch {torch.__version__} finds {present} CUDA devices '
            'here; leave device out to run on the CPU'
        )
    return device


def run_on_device(rollouts: Sequence[Rollout], steps: int) -> list[Outcome]:
    """Outcomes of rollouts that have just begun, whose steppers are `DeviceStepper`."""
    from ..gns.device_stepper import blocks, side_by_side

    outcomes: list[Outcome] = []
    for some in _batches(rollouts):
        together = side_by_side([cast('DeviceStepper', rollout.stepper) for rollout in some])
        rows = [np.empty((0, *together.scenes.present.shape, 13)), *blocks(together, steps)]
        whole = np.concatenate(rows)
        outcomes += [
            _outcome(rollout, whole[:, k, : len(rollout.state)], steps)
            for k, rollout in enumerate(some)
        ]
    return outcomes


def _batches(rollouts: Sequence[Rollout]) -> Iterator[list[Rollout]]:
    """Rollouts in their order, as many at a time as memory allows."""
    batch: list[Rollout] = []
    most = 0
    for rollout in rollouts:
        most = max(most, len(rollout.state))
        if batch and (len(batch) + 1) * most**2 > _PAIRS:
            yield batch
            batch, most = [], len(rollout.state)
        batch.append(rollout)
    if batch:
        yield batch


def _outcome(rollout: Rollout, rows: Array, steps: int) -> Outcome:
    """Of [p, q, v, omega] in the model's units, shape (up to steps, n, 13)."""
    from ..gns.device_stepper import DIVERGED, diverged, state_of

    bad = diverged(rows)
    sound = int(np.argmax(bad)) if bad.any() else len(rows)
    recording = Recording(rollout.state, rollout.dt, steps)
    states = rollout.similarity.to_world(state_of(rows[:sound]))
    recording.add(states, DIVERGED if bad.any() else '')
    return recording.outcome
