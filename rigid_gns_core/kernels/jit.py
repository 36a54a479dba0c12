# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

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
