# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fits beside a running node: one at a time, in a process of low priority."""

from __future__ import annotations

from collections.abc import Sequence
import subprocess
import sys
import threading

from .pipe import encode_task
from ..data.tracks import Track
from ..errors import UserError
from ..files.strict_json import parse_json
from ..forecasts.learned_scene import LearnedScene
from ..scenes.scene import Scene

NICE = 19
"""How far the process steps back behind others."""


class Background:
    """One fit at a time in another process, since Python's lock is one for all threads.

    All methods are called from one thread, and return at once.
    """

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._answer: tuple[bytes, bytes, int] | None = None
        self._thread: threading.Thread | None = None
        self._lock, self._closed = threading.Lock(), False

    @property
    def busy(self) -> bool:
        """Whether a fit runs, or its result was not taken."""
        return self._thread is not None

    def start(self, tracks: Sequence[Track], given: Scene, present: Scene) -> None:
        """Begin a fit; see `relearn`. None runs."""
        task = tuple(tracks), given, present
        self._thread = threading.Thread(target=self._ask, args=task, name='learning', daemon=True)
        self._thread.start()

    def _ask(self, tracks: Sequence[Track], given: Scene, present: Scene) -> None:
        """Run a process, and keep its answer."""
        command = [sys.executable, '-P', '-m', __package__, f'{NICE}']
        pipe = subprocess.PIPE
        try:
            content = encode_task(tracks, given, present)
            with self._lock:
                if self._closed:
                    return
                # a group of its own: Ctrl-C is for the node, which ends it
                self._process = process = subprocess.Popen(
                    command, stdin=pipe, stdout=pipe, stderr=pipe, process_group=0
                )
            out, log = process.communicate(content)
            self._answer = out, log, process.returncode
        except (OSError, UserError) as error:  # no memory for a process
            self._answer = b'', str(error).encode(), 1

    def take(self) -> LearnedScene | None:
        """The result, where it is there; None: not yet, or no fit runs.

        Raises:
            UserError: The tracks do not tell a scene, or the process failed.
        """
        if self._thread is None or self._thread.is_alive() or self._answer is None:
            return None
        (out, log, code), self._answer, self._thread = self._answer, None, None
        if code:
            text = log.decode(errors='replace').strip().splitlines() or ['no word']
            raise UserError(f'the process that learns ended with {code}: {text[-1]}')
        content = parse_json(out.decode())
        if isinstance(content, dict) and 'error' in content:
            raise UserError(str(content['error']))
        return LearnedScene.from_json(out.decode())

    def close(self) -> None:
        """End the process, if any runs."""
        with self._lock:
            self._closed = True
            if self._process is not None and self._process.poll() is None:
                self._process.kill()
        if self._thread is not None:
            self._thread.join()
