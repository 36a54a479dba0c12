# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""How the engine is compiled: decorators, which every file with compiled functions imports."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from .machine_code import Function, MachineCode

# no sum is fused (FMA) or reordered: what the compiler fuses depends on what it inlines, and the
# process that compiles gave other bytes than those that load its code
_CODE = MachineCode(
    'engine', Path(__file__).parents[1] / 'engine', Path(__file__).parent, fastmath=False
)
is_compiled = _CODE.is_complete
compiling = partial(_CODE.compiling, 'the engine', 'about a minute')


def compiled(function: Function) -> Function:
    """Compile a function that only compiled functions call: Python itself must not."""
    return _CODE.part(function)


def in_place(function: Function) -> Function:
    """Compile a function that makes no array: as `compiled`, but without reference counting.

    Counting references, atomically and for every array of every tuple, took most of the time.
    """
    return _CODE.part(function, _nrt=False)


def entry(function: Function) -> Function:
    """Compile a function that Python calls; it releases the GIL, so that scenes run in threads."""
    return _CODE.of(function, nogil=True)
