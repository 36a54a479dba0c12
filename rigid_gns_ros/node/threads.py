# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""How many CPU threads this process may use, and how they take turns."""

from __future__ import annotations

import sys

from threadpoolctl import threadpool_limits


def bound_threads(count: int) -> None:
    """Let BLAS, OpenMP and torch, as far as they are loaded, use `count` threads from now on.

    The compiled engine has no parallel loops, so that Numba starts no threads.
    """
    threadpool_limits(count)  # which lasts until somebody lifts it
    torch = sys.modules.get('torch')
    if torch is not None:
        torch.set_num_threads(count)


def switch_often() -> None:
    """Let no thread of Python keep the others waiting for long.

    A model in Python may compute a future while a prediction is due.
    """
    sys.setswitchinterval(5e-4)
