# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""How the filter is compiled: like the engine, no sum is fused or reordered."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ..kernels.machine_code import Function, MachineCode
from ..scenes.state import Array

_CORE = Path(__file__).parents[1]
_CODE = MachineCode('tracking', Path(__file__).parent, _CORE / 'engine', _CORE / 'kernels')
_FLOAT64 = np.dtype(np.float64)
compiling = partial(_CODE.compiling, 'the tracking filter', 'about half a minute')


def in_place(function: Function) -> Function:
    """Compile a function that only compiled code calls.

    It allocates no array, so no references are counted.
    """
    return _CODE.part(function, _nrt=False)


def compiled(function: Function) -> Function:
    """Compile a function that only compiled code calls and that makes arrays."""
    return _CODE.part(function)


def entry(function: Function) -> Function:
    """Compile a function that Python calls; it runs without Python's global lock."""
    return _CODE.of(function, nogil=True)


def plain(values: ArrayLike) -> Array:
    """Array in the one layout that entries are compiled for; any other would compile anew."""
    if type(values) is np.ndarray and values.dtype is _FLOAT64 and values.flags.carray:
        return values  # as nearly always, and ten times faster told so than by `require`
    return np.require(values, _FLOAT64, ['C', 'W'])
