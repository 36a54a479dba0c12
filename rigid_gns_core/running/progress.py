# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Progress of a long run: a bar on a terminal, plain lines in a log."""

from __future__ import annotations

from contextlib import suppress
import sys
import time
from types import TracebackType
from typing import Any, TextIO


class Progress:
    """Counts what is done and shows it; a context manager.

    Args:
        total: Number of things to do.
        description: What is being done, shown first.
        unit: What is counted, such as 'trajectory' or 'step'.
        initial: How many were done before this run.
        interval: Least time between two plain lines [s].
        stream: Where to write; None: standard error, so that results can be piped.
    """

    def __init__(
        self,
        total: int,
        description: str,
        *,
        unit: str = 'step',
        initial: int = 0,
        interval: float = 10.0,
        stream: TextIO | None = None,
    ) -> None:
        self.total, self.description, self.unit = total, description, unit
        self.done = self._initial = initial
        self._interval = interval
        self._stream = sys.stderr if stream is None else stream
        self._begin = self._printed = time.monotonic()
        self._shown = initial - 1
        self._values = ''
        self._bar = self._make_bar() if self._stream.isatty() else None

    def _make_bar(self) -> Any:
        from tqdm import tqdm

        return tqdm(
            total=self.total,
            desc=self.description,
            unit=f' {self.unit}',
            initial=self.done,
            file=self._stream,
            dynamic_ncols=True,
        )

    def update(self, count: int = 1, **values: float | str) -> None:
        """Count `count` more as done; `values`, such as `loss=0.1`, are shown beside the count."""
        self.done += count
        self._values = ', '.join(
            f'{key} {value:.4g}' if isinstance(value, float) else f'{key} {value}'
            for key, value in values.items()
        )
        if self._bar is not None:
            self._bar.set_postfix_str(self._values, refresh=False)
            self._bar.update(count)
        elif time.monotonic() - self._printed >= self._interval:
            self._print()

    def line(self, text: str) -> None:
        """Write a line of its own, above the bar where there is one."""
        with suppress(OSError):  # of a log on a full disk: no reason to end the work
            if self._bar is not None:
                self._bar.write(text, file=self._stream)
            else:
                print(text, file=self._stream, flush=True)

    def close(self) -> None:
        """Show the last count and leave the bar standing."""
        if self._bar is not None:
            self._bar.close()
        elif self._shown != self.done:
            self._print()

    def _print(self) -> None:
        from tqdm import tqdm

        clock = tqdm.format_interval
        self._printed, self._shown = time.monotonic(), self.done
        elapsed = self._printed - self._begin
        fresh = self.done - self._initial
        left = elapsed / fresh * (self.total - self.done) if fresh else 0.0
        times = f'{clock(elapsed)} elapsed' + (f', {clock(left)} left' if left else '')
        values = f'; {self._values}' if self._values else ''
        self.line(f'{self.description}: {self.unit} {self.done} of {self.total}, {times}{values}')

    def __enter__(self) -> Progress:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if kind is not None and self.done == self._initial:
            self._shown = self.done  # nothing was done: the error alone says it in a log
        self.close()
