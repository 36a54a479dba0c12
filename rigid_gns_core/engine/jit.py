"""How the engine is compiled: by Numba at the first use, then read from a folder of its own."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

Function = TypeVar('Function', bound=Callable[..., Any])

_SOURCES = Path(__file__).parent


def _folder() -> Path:
    """Where machine code of just these sources is kept.

    Numba looks at the file of a function only, and would go on with old code of those it calls.
    """
    texts = [path.read_bytes() for path in sorted(_SOURCES.glob('*.py'))]
    text = b''.join(text for text in texts if b'.jit import' in text)
    name = f'engine-{hashlib.sha256(text).hexdigest()[:16]}'
    beside = _SOURCES / '__pycache__'
    if not os.access(beside if beside.exists() else _SOURCES, os.W_OK):
        home = os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache'
        return Path(home) / 'rigid_gns' / name
    for old in beside.glob('engine-*'):
        if old.name != name:
            shutil.rmtree(old, ignore_errors=True)
    return beside / name


_FOLDER = _folder()


_seen_compiled = False


def is_compiled() -> bool:
    """Whether this or an earlier process has left machine code of these sources."""
    global _seen_compiled  # the disk is searched no more, once it was found
    _seen_compiled = _seen_compiled or any(_FOLDER.rglob('*.nbc'))
    return _seen_compiled


def compiled(function: Function) -> Function:
    """Machine code of `function` for the engine's own use: Python itself must not call it.

    Sums may be fused (FMA), never reordered: the same seed gives the same bytes.
    """
    # a way in from Python for each would take a fifth of the time to compile
    return _compile(function, no_cpython_wrapper=True, no_cfunc_wrapper=True)


def in_place(function: Function) -> Function:
    """The same for functions that make no array: nothing counts references in them.

    Counting them, atomically and for every array of every tuple, took most of the time.
    """
    return _compile(function, no_cpython_wrapper=True, no_cfunc_wrapper=True, _nrt=False)


def entry(function: Function) -> Function:
    """The same for functions that Python calls; no lock is held, so that scenes run in threads."""
    return _compile(function, nogil=True)


def _compile(function: Function, **options: bool) -> Function:
    settings: Any = numba.config
    theirs = settings.CACHE_DIR
    settings.CACHE_DIR = str(_FOLDER)
    try:
        njit: Any = numba.njit
        decorate = njit(cache=True, error_model='numpy', fastmath={'contract'}, **options)
        return cast(Function, decorate(function))
    finally:
        settings.CACHE_DIR = theirs
