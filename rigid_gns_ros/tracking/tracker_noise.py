"""A tracker's noise, from what no motion between contacts can do: third differences."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rigid_gns_core.state import Array

# newest third differences kept: their number gives the noise within some per cent
KEPT = 1200
# fewer tell too little
LEAST = 24
# a normal distribution: part of its smallest quarter, and its mean square when cut at 3
_QUARTER, _CUT = 0.3186, 0.9733


def third_differences(times: Array, positions: Array, seen: NDArray[np.bool_]) -> Array:
    """Those of four frames, each with the standard deviation of one coordinate [m], shape (m,).

    Args:
        times: [s], shape (4,), at any distances.
        positions: Centres [m], shape (4, n, 3).
        seen: Shape (4, n); spheres that were not seen in all are left out.
    """
    gaps = times[:, None] - times + np.eye(4)
    factors = 1.0 / gaps.prod(axis=1)
    factors /= np.linalg.norm(factors)
    whole = positions[:, seen.all(axis=0)]
    # differences first: they are small where positions are not
    return np.einsum('f,fnc->nc', factors, whole - whole[-1:]).ravel()


def spread(values: Array) -> float | None:
    """Standard deviation of the normal part of values, the rest of which are contacts.

    Returns:
        None where there are too few to tell.
    """
    if len(values) < LEAST:
        return None
    size = np.sort(np.abs(values))
    found = float(size[len(size) // 4]) / _QUARTER
    squares = np.cumsum(size**2)
    for _ in range(20):
        kept = int(np.searchsorted(size, 3.0 * found, side='right'))
        if not kept:
            break
        before, found = found, float(np.sqrt(squares[kept - 1] / kept / _CUT))
        if found == before:
            break
    return found
