# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many calls of one function on processes of this machine, or on a user's Dask cluster.

joblib does the work; functions and arguments must be picklable, and on a cluster the folders they
name must be the same files for all workers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
import contextlib
from dataclasses import dataclass
import os
import threading
import time
from typing import Any, TypeVar
import warnings

from .threads import usable_cores
from ..errors import UserError

T = TypeVar('T')
BACKENDS = ('loky', 'dask')


class WorkerDied(RuntimeError):
    """A worker process was killed, perhaps by the system for lack of memory."""


@dataclass(frozen=True)
class Workers:
    """Where calls run.

    Args:
        count: Processes; None: one per usable core. With 1 on this machine, this process.
        backend: 'loky': processes of this machine; 'dask': a cluster.
        scheduler: Address of the cluster, such as tcp://host:8786; None: the one that is running
            or configured for this process.
    """

    count: int | None = None
    backend: str = 'loky'
    scheduler: str | None = None

    def __post_init__(self) -> None:
        if self.count is not None and self.count < 1:
            raise UserError(f'workers is {self.count}, expected at least 1')
        if self.backend not in BACKENDS:
            raise UserError(f'backend is {self.backend!r}, allowed: {", ".join(BACKENDS)}')
        if self.scheduler is not None and self.backend == 'loky':
            raise UserError('a scheduler needs the backend dask; give --backend')

    @property
    def here(self) -> bool:
        """Whether calls run on this machine."""
        return self.backend == 'loky'

    def processes(self, calls: int) -> int:
        """Number of processes for so many calls; -1: all that a cluster has."""
        if not self.here:
            return self.count or -1
        return max(1, min(self.count or usable_cores(), calls))

    def run(
        self, function: Callable[..., T], calls: Iterable[Sequence[Any]], count: int
    ) -> Iterator[T]:
        """Results of `function(*call)`, in the order of completion.

        On this machine a call is taken from `calls` when a process is free for it.

        Args:
            function: Importable by name.
            calls: Arguments of each call.
            count: How many calls there are.

        Raises:
            WorkerDied: A process was killed.
            ModuleNotFoundError: The backend is not installed.
        """
        processes = self.processes(count)
        if self.here and processes == 1:
            for call in calls:
                yield function(*call)
            return
        from joblib import delayed, Parallel, parallel_config
        from joblib.externals.loky.process_executor import TerminatedWorkerError

        own = {'initializer': leave_with_parent} if self.here else {}
        with self._connected():
            with parallel_config(self.backend, n_jobs=processes, **own):
                parallel = Parallel(
                    return_as='generator_unordered',
                    batch_size=1,
                    pre_dispatch='n_jobs' if self.here else 'all',
                )
            results = parallel(delayed(function)(*call) for call in calls)
            try:
                for result in results:  # noqa: UP028, which would close it with a warning
                    yield result
            except TerminatedWorkerError as error:
                raise WorkerDied(str(error)) from error
            finally:
                with warnings.catch_warnings():
                    warnings.simplefilter('ignore')  # joblib's warning that the run was stopped
                    results.close()

    def _connected(self) -> contextlib.AbstractContextManager[Any]:
        """Connection to the cluster; without an address the process has one already."""
        if self.here:
            return contextlib.nullcontext()
        from distributed import Client

        client: contextlib.AbstractContextManager[Any] = (
            Client(self.scheduler)  # type: ignore[no-untyped-call,unused-ignore]
            if self.scheduler
            else contextlib.nullcontext()
        )
        return client


def leave_with_parent() -> None:
    """End this process as soon as its parent is gone, not only after its work."""
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
