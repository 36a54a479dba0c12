# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""How the filter is compiled: as the engine, whose code it calls, but without fused sums."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ..kernels.machine_code import Function, MachineCode
from ..scenes.state import Array

_CODE = MachineCode(
    'tracking', *(Path(__file__).parents[1] / name for name in ('tracking', 'engine', 'kernels'))
)
is_compiled = _CODE.exists


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
