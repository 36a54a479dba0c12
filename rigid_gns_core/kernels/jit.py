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

"""How the engine is compiled; every file of it with compiled functions imports this one."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from .machine_code import Function, MachineCode

# sums may be fused (FMA), never reordered: the same seed gives the same bytes
_CODE = MachineCode(
    'engine', Path(__file__).parents[1] / 'engine', Path(__file__).parent, fastmath={'contract'}
)
is_compiled = _CODE.is_complete
compiling = partial(_CODE.compiling, 'the engine', 'about a minute')


def compiled(function: Function) -> Function:
    """Machine code of `function` for the engine's own use: Python itself must not call it."""
    # a way in from Python for each would take a fifth of the time to compile
    return _CODE.of(function, no_cpython_wrapper=True, no_cfunc_wrapper=True)


def in_place(function: Function) -> Function:
    """Return the same for functions that make no array: nothing counts references in them.

    Counting them, atomically and for every array of every tuple, took most of the time.
    """
    return _CODE.of(function, no_cpython_wrapper=True, no_cfunc_wrapper=True, _nrt=False)


def entry(function: Function) -> Function:
    """Compile a function that Python calls; it holds no lock, so that scenes run in threads."""
    return _CODE.of(function, nogil=True)
