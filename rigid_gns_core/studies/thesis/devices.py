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

"""Who trains on which CUDA device: one process of this machine on each."""

from __future__ import annotations

from dataclasses import dataclass, replace
import fcntl
from pathlib import Path
import time
from typing import IO

from ...running.workers import Workers

# what this process holds: the lock is open, hence its own, until the process ends
_held: dict[Devices, tuple[int, IO[str]]] = {}


@dataclass(frozen=True)
class Devices:
    """CUDA devices that processes of this machine share out among themselves.

    Args:
        count: How many there are.
        folder: Holds a lock for each; the same for all processes.
    """

    count: int
    folder: Path

    def mine(self) -> int:
        """Index of the device of this process, for as long as it lives; waits until one is free.

        A process keeps its device, since what it has allocated there stays.
        """
        while self not in _held:
            for index in range(self.count):
                lock = open(self.folder / f'cuda{index}.lock', 'w', encoding='utf-8')  # noqa: SIM115
                try:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    lock.close()
                    continue
                _held[self] = index, lock
                break
            else:
                time.sleep(0.5)
        return _held[self][0]


def shared_out(name: str, workers: Workers, folder: Path) -> tuple[Workers, Devices | None]:
    """Workers, no more than there are CUDA devices, and these; None: nothing is shared out.

    Nothing is where `name` means the CPU, and on a cluster, which gives its workers their devices.

    Args:
        name: cpu, cuda or auto.
        workers: Who does the work.
        folder: For the locks.
    """
    if name == 'cpu' or not workers.here:
        return workers, None
    import torch

    count = torch.cuda.device_count() if torch.cuda.is_available() else 0
    if not count:  # auto: the CPU; cuda: each cell says that there is none
        return workers, None
    return replace(workers, count=min(workers.count or count, count)), Devices(count, folder)
