"""How many CPU threads the libraries of this process may use."""

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
