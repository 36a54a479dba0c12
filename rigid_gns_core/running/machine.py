# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a timing depends on: machine, versions, threads, load."""

from __future__ import annotations

import os
from pathlib import Path
import platform
from typing import Any

from .threads import usable_cores
from ..installation.versions import PACKAGE, versions_of

PACKAGES = (PACKAGE, 'numpy', 'scipy', 'numba', 'pybullet', 'mujoco', 'torch')
THREADS = ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS', 'NUMBA_NUM_THREADS')


def describe_machine() -> dict[str, Any]:
    """Processor, cores, system, versions and thread counts; no name and no path of the machine."""
    return {
        'cpu': cpu_name(),
        'cores': os.cpu_count(),
        'usable_cores': usable_cores(),
        'system': f'{platform.system()} {platform.machine()}',
        'python': platform.python_version(),
        'versions': versions_of(PACKAGES),
        'threads': {name: os.environ.get(name) for name in THREADS},
    }


def load_average() -> list[float] | None:
    """Mean number of runnable processes over 1, 5 and 15 minutes; None: unknown here."""
    try:
        return [round(load, 2) for load in os.getloadavg()]
    except (AttributeError, OSError):
        return None


def stolen_time() -> float:
    """Time that the host of a virtual machine ran something else, of all cores together [s].

    Since the machine has started; 0 where Linux does not tell (`steal` in proc(5)).
    """
    stat = Path('/proc/stat')
    fields = stat.read_text().split(maxsplit=9) if stat.is_file() else []
    return int(fields[8]) / os.sysconf('SC_CLK_TCK') if len(fields) > 8 else 0.0


def cpu_name() -> str:
    """Name of the processor, or its architecture where Linux does not tell."""
    cpuinfo = Path('/proc/cpuinfo')
    lines = cpuinfo.read_text().splitlines() if cpuinfo.is_file() else []
    names = [line.split(':', 1)[1].strip() for line in lines if line.startswith('model name')]
    return names[0] if names else platform.machine()


def resident_bytes(which: str = 'VmRSS') -> int | None:
    """Memory of this process [bytes], now ('VmRSS') or at its peak ('VmHWM'). None: no Linux.

    Not `ru_maxrss`, which a process inherits from its parent.
    """
    status = Path('/proc/self/status')
    lines = status.read_text().splitlines() if status.is_file() else []
    values = [line.split()[1] for line in lines if line.startswith(f'{which}:')]
    return 1024 * int(values[0]) if values else None
