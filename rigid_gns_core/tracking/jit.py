# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""How the filter is compiled: as the engine, whose code it calls, but without fused sums."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ..kernels.machine_code import Function, MachineCode
from ..scenes.state import Array

_CODE = MachineCode(
    'tracking', *(Path(__file__).parents[1] / name for name in ('tracking', 'engine', 'kernels'))
)
compiling = partial(_CODE.compiling, 'the tracking filter', 'about 15 s')


def in_place(function: Function) -> Function:
    """Machine code of `function` for the filter's own use: Python itself must not call it.

    It makes no array, so that nothing counts references. Sums are neither fused nor reordered:
    between hypotheses that cost the same, rounding decides.
    """
    return _CODE.of(function, no_cpython_wrapper=True, no_cfunc_wrapper=True, _nrt=False)


def entry(function: Function) -> Function:
    """Return the same for functions that Python calls; no lock is held meanwhile."""
    return _CODE.of(function, nogil=True)


def plain(values: ArrayLike) -> Array:
    """Numbers in the one layout that entries are compiled for; another would be compiled anew."""
    return np.require(values, np.float64, ['C', 'W'])
