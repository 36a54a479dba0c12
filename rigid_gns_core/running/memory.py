# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Memory that is freed and asked for again, frame after frame."""

from __future__ import annotations

import ctypes
import os
import sys

# parameters of mallopt(3), and what is kept [bytes]
_TRIM_THRESHOLD, _MMAP_THRESHOLD, _KEPT = -1, -3, 1 << 30
# by which a user sets them
_OWN = ('GLIBC_TUNABLES', 'MALLOC_TRIM_THRESHOLD_', 'MALLOC_MMAP_THRESHOLD_')


def keep_freed_memory() -> bool:
    """Let the C library keep up to 1 GiB that is freed, for what comes next; whether it does.

    By default glibc gives the system large pieces back at once, and the system clears each page
    anew at the next frame. Nothing is done with other libraries, or where the user has set it.
    """
    if not sys.platform.startswith('linux') or any(name in os.environ for name in _OWN):
        return False
    mallopt = getattr(ctypes.CDLL(None), 'mallopt', None)
    if mallopt is None:  # musl
        return False
    return all(mallopt(kind, _KEPT) == 1 for kind in (_TRIM_THRESHOLD, _MMAP_THRESHOLD))
