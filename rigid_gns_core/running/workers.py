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

"""Many calls of one function on processes of this machine, or on a user's Dask or Ray cluster.

joblib does the work; functions and arguments must be picklable, and on a cluster the folders they
name must be the same files for all workers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
import contextlib
from dataclasses import dataclass
from itertools import islice
import os
import threading
import time
from typing import Any, TypeVar
import warnings

from .threads import usable_cores

T = TypeVar('T')
BACKENDS = ('loky', 'dask', 'ray')


class WorkerDied(RuntimeError):
    """A process was killed, by the system for want of memory perhaps."""


@dataclass(frozen=True)
class Workers:
    """Who does the work.

    Args:
        count: Processes; None: one per usable core. With 1 on this machine, this process.
        backend: 'loky': processes of this machine; 'dask' or 'ray': a cluster.
        scheduler: Address of the cluster, such as tcp://host:8786; None: the one that is running
            or configured for this process.
    """

    count: int | None = None
    backend: str = 'loky'
    scheduler: str | None = None

    def __post_init__(self) -> None:
        if self.count is not None and self.count < 1:
            raise ValueError(f'workers is {self.count}, expected at least 1')
        if self.backend not in BACKENDS:
            raise ValueError(f'backend is {self.backend!r}, allowed: {", ".join(BACKENDS)}')
        if self.scheduler is not None and self.backend == 'loky':
            raise ValueError('a scheduler needs the backend dask or ray; give --backend')

    @property
    def here(self) -> bool:
        """Whether the work is done on this machine."""
        return self.backend == 'loky'

    def processes(self, calls: int) -> int:
        """How many processes so many calls take; -1: all that a cluster has."""
        if not self.here:
            return self.count or -1
        return max(1, min(self.count or usable_cores(), calls))

    def run(
        self, function: Callable[..., T], calls: Iterable[Sequence[Any]], count: int
    ) -> Iterator[T]:
        """Results of `function(*call)`, in the order in which they are done.

        On this machine a call is taken from `calls` when a process is free for it. Ray makes as
        many calls at a time as it has workers, and takes more when the slowest is done.

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
        from joblib import delayed

        jobs = (delayed(function)(*call) for call in calls)
        take = self._in_turns if self.backend == 'ray' else self._as_done
        with self._connected():
            yield from take(jobs, processes)

    def _as_done(self, jobs: Iterator[Any], processes: int) -> Iterator[Any]:
        from joblib import Parallel, parallel_config
        from joblib.externals.loky.process_executor import TerminatedWorkerError

        own = {'initializer': _leave_with_parent} if self.here else {}
        with parallel_config(self.backend, n_jobs=processes, **own):
            parallel = Parallel(
                return_as='generator_unordered',
                batch_size=1,
                pre_dispatch='n_jobs' if self.here else 'all',
            )
        results = parallel(jobs)
        try:
            for result in results:  # noqa: UP028, which would close it with a warning
                yield result
        except TerminatedWorkerError as error:
            raise WorkerDied(str(error)) from error
        finally:
            with warnings.catch_warnings():
                warnings.simplefilter('ignore')  # that a stopped run was stopped
                results.close()

    def _in_turns(self, jobs: Iterator[Any], processes: int) -> Iterator[Any]:
        """As many jobs at a time as there are workers: Ray's backend hands nothing out before."""
        from joblib import effective_n_jobs, Parallel, parallel_config

        with parallel_config(self.backend, n_jobs=processes):
            parallel, together = Parallel(batch_size=1), effective_n_jobs(processes)
        with parallel:  # the same workers for all turns
            while some := list(islice(jobs, together)):
                yield from parallel(some)

    @contextlib.contextmanager
    def _connected(self) -> Iterator[None]:
        if self.backend == 'dask':
            from distributed import Client

            # without an address the client that this process has made before is taken
            with (
                Client(self.scheduler)  # type: ignore[no-untyped-call,unused-ignore]
                if self.scheduler
                else contextlib.nullcontext()
            ):
                yield
        elif self.backend == 'ray':
            import ray
            from ray.util.joblib import register_ray

            ray.init(address=self.scheduler, ignore_reinit_error=True)
            register_ray()
            yield
        else:
            yield


def _leave_with_parent() -> None:
    """End this process when the one that started it was killed, not only after its work."""
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
