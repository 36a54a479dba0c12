# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""How a simulator fares while another process keeps one core busy."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import subprocess
import sys
import time
from typing import Any

import numpy as np

from .peers import Peer
from .scenes import BenchScene


@contextmanager
def busy_core() -> Iterator[int]:
    """Start a process that only computes, until the context ends; yield its number."""
    # a pipe that ends with us ends it too, should we be killed
    code = (
        'import os, threading; '
        'threading.Thread(target=lambda: (os.read(0, 1), os._exit(0)), daemon=True).start()\n'
        'print(flush=True)\n'
        'while True: pass'
    )
    process = subprocess.Popen(
        [sys.executable, '-c', code], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    try:
        if process.stdout is not None:
            process.stdout.readline()  # it runs now
        yield process.pid
    finally:
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                pipe.close()


def measure_busy_core(peer: Peer, scene: BenchScene, repeats: int) -> dict[str, Any]:
    """Run a scene without and with a busy core, in turns.

    Returns:
        `alone` and `beside_a_busy_core` [steps/s], medians over the repeats, and their `ratio`;
        `peer`, `scene`, `repeats`.
    """
    rates: dict[str, list[float]] = {'alone': [], 'beside_a_busy_core': []}
    for _ in range(repeats):
        rates['alone'].append(_rate(peer, scene))
        with busy_core():
            rates['beside_a_busy_core'].append(_rate(peer, scene))
    alone, beside = (float(np.median(values)) for values in rates.values())
    return {
        'peer': peer.name,
        'scene': scene.name,
        'repeats': repeats,
        'alone': alone,
        'beside_a_busy_core': beside,
        'ratio': beside / alone,
    }


def _rate(peer: Peer, scene: BenchScene) -> float:
    """Frames per second of one run of the scene."""
    run = peer.start(scene.scene, scene.start)
    begin = time.perf_counter()
    for _ in range(scene.frames):
        run.advance()
    seconds = time.perf_counter() - begin
    run.close()
    return scene.frames / seconds
