# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Training by several processes under torchrun: who does what, and what they agree on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import datetime
import os
from typing import NamedTuple, TypeVar

import torch
from torch import Tensor
import torch.distributed as dist

from ..errors import UserError

T = TypeVar('T')

# the others wait for the validation of the first: longer than any takes
_PATIENCE = datetime.timedelta(hours=2)


class Mean(NamedTuple):
    """A mean over what one process has, and how much that is.

    value: a number, shape (); weight: 0 where the value counts for nothing.
    """

    value: Tensor
    weight: float


class Processes:
    """The processes of a run; alone unless torch.distributed is initialised.

    Args:
        device: Where numbers that are exchanged have to lie.
    """

    def __init__(self, device: torch.device | None = None) -> None:
        self.device = device or torch.device('cpu')
        self.size = dist.get_world_size() if dist.is_initialized() else 1
        self.rank = dist.get_rank() if dist.is_initialized() else 0

    @property
    def first(self) -> bool:
        """Whether this process validates, logs and writes."""
        return self.rank == 0

    def share(self, items: Sequence[T]) -> Sequence[T]:
        """Return what this process does of the items; the shares of all are the items.

        Raises:
            UserError: There are fewer items than processes.
        """
        if len(items) < self.size:
            raise UserError(
                f'{self.size} processes cannot share a batch of {len(items)}; start fewer, or '
                'raise batch in the recipe'
            )
        return items[self.rank :: self.size] if self.size > 1 else items

    def sum(self, value: float) -> float:
        """Sum over all processes, the same on each."""
        if self.size == 1:
            return value
        total = torch.tensor(value, dtype=torch.float64, device=self.device)
        dist.all_reduce(total)
        return float(total)

    def any(self, flag: bool) -> bool:
        """Whether the flag is set in any process."""
        return self.sum(float(flag)) > 0

    def wait(self) -> None:
        """Until all processes are here."""
        self.sum(0.0)

    def fair(self, mean: Mean) -> Tensor:
        """Return the mean, scaled so that its average over processes is the mean over all.

        DistributedDataParallel averages gradients, so that a process with few spheres would count
        as much as one with many.
        """
        if self.size == 1:
            return mean.value
        total = self.sum(mean.weight)
        return mean.value * (mean.weight * self.size / max(total, 1.0))


@contextmanager
def started_by_torchrun(device: torch.device) -> Iterator[None]:
    """Join the processes that torchrun started; without torchrun, stay alone."""
    if 'RANK' not in os.environ or int(os.environ.get('WORLD_SIZE', '1')) < 2:
        yield
        return
    backend = 'gloo'
    if device.type == 'cuda':
        backend = 'nccl'
        torch.cuda.set_device(device)
    dist.init_process_group(backend, timeout=_PATIENCE)
    try:
        yield
    finally:
        dist.destroy_process_group()


def find_device(name: str) -> torch.device:
    """Device of this process: `cpu`, `cuda`, or `auto` for CUDA where there is one.

    Raises:
        UserError: CUDA is asked for and there is none, or not one for each process.
    """
    if name == 'auto':
        name = 'cuda' if torch.cuda.is_available() else 'cpu'
    if name != 'cuda':
        return torch.device(name)
    local, count = int(os.environ.get('LOCAL_RANK', '0')), torch.cuda.device_count()
    if not torch.cuda.is_available():
        raise UserError('device is cuda, but torch finds no CUDA device here; use --device cpu')
    if local >= count:
        raise UserError(
            f'process {local} of this machine has no CUDA device, there are {count}; start as '
            'many processes as devices, or use --device cpu'
        )
    return torch.device('cuda', local)
