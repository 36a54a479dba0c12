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

"""How long a cell was trained, and by which commits, over all processes that worked on it."""

from __future__ import annotations

from pathlib import Path
import threading
import time
from types import TracebackType
from typing import Any

from ...files.strict_json import read_json, write_compact_json

NAME = 'tally.json'


class Tally:
    """Keeps the seconds of a training in its folder; a context manager around the training.

    They are written now and then, so that a process that is killed is counted too.

    Args:
        folder: Of the checkpoints.
        step: Where this process begins. Earlier ones count if they came further than they began.
        commit: Of this process' source; None: not known.
        since: When it began, of `time.monotonic` [s].
        every: Between two writes [s].
    """

    def __init__(
        self, folder: Path, step: int, commit: str | None, since: float, every: float = 30.0
    ) -> None:
        self._path, self._since, self._every = folder / NAME, since, every
        known = read_json(self._path)['runs'] if self._path.is_file() else []
        self._earlier = [run for run in known if run['from_step'] < step]
        self._own: dict[str, Any] = {'from_step': step, 'commit': commit}
        self._over = threading.Event()
        self._writer = threading.Thread(target=self._write_now_and_then, daemon=True)

    def __enter__(self) -> Tally:
        self._write()
        self._writer.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._over.set()
        self._writer.join()
        self._write()

    @property
    def counted_from_step(self) -> int:
        """Step from which on seconds and commits are known: 0, unless an older source began."""
        return int(self._runs[0]['from_step'])

    @property
    def earlier(self) -> float:
        """Training of the processes before this one [s]."""
        return float(sum(run['seconds'] for run in self._earlier))

    @property
    def commits(self) -> list[str]:
        """Those of all processes, in order, each once."""
        return list(dict.fromkeys(run['commit'] for run in self._runs if run['commit']))

    @property
    def _runs(self) -> list[dict[str, Any]]:
        return [*self._earlier, self._own]

    def _write(self) -> None:
        self._own['seconds'] = time.monotonic() - self._since
        write_compact_json(self._path, {'runs': self._runs}, digits=6)

    def _write_now_and_then(self) -> None:
        while not self._over.wait(self._every):
            self._write()
