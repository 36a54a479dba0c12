# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""CPU threads of the process: their number, and how often Python switches between them."""

from __future__ import annotations

import sys

from threadpoolctl import threadpool_limits


def bound_threads(count: int) -> None:
    """Limit BLAS, OpenMP and torch, as far as they are loaded, to `count` threads.

    The compiled engine has no parallel loops, so Numba starts no threads.
    """
    threadpool_limits(count)  # stays in effect
    torch = sys.modules.get('torch')
    if torch is not None:
        torch.set_num_threads(count)


def switch_often() -> None:
    """Shorten the switch interval of Python's threads.

    A model in Python may compute a future when a prediction is due.
    """
    sys.setswitchinterval(5e-4)
