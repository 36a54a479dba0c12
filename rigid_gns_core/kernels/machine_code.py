# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cache of what Numba compiles of a package, at install or first use."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property
import gc
import hashlib
import os
from pathlib import Path
import pickle
import shutil
import sys
from typing import Any, cast, TypeVar
import uuid

from ..errors import UserError
from ..installation.extras import missing

try:
    import numba
    from numba.core import caching, serialize, types
    from numba.core.registry import cpu_target

    from .linking import EntryCompiler, PartCompiler, rebuilt
except ModuleNotFoundError as error:
    raise missing(error, 'the engine') from error
except ValueError as error:
    raise UserError(
        f'numba cannot be used: {error} NUMBA_NUM_THREADS is '
        f'{os.environ.get("NUMBA_NUM_THREADS")!r}, expected 1 or more; unset it'
    ) from error

Function = TypeVar('Function', bound=Callable[..., Any])

_COMPLETE = 'complete'
_SUFFIX = '.nbc'
_dumps: Any = serialize.dumps


class MachineCode:
    """Machine code of some sources, in a folder named by a hash of all of them.

    Numba's own cache checks only the file of a function, and would keep old code of functions
    that it calls. It also depends on where the sources are; this one can be copied with them.

    It is read from beside the sources, and from the user's folder: NUMBA_CACHE_DIR, or else that
    for caches. It is written to NUMBA_CACHE_DIR where that is set, or else to the first of the two
    that can be written.

    Args:
        name: What the folder's name begins with.
        sources: Folders of the sources; the code is kept beside the first. The hash is that of
            their `jit.py`, of the files that import it, and of those that extend Numba.
        options: Options of numba.njit, for all functions.
    """

    def __init__(self, name: str, *sources: Path, **options: Any) -> None:
        self._name, self._options = name, options
        paths = [path for folder in sources for path in sorted(folder.glob('*.py'))]
        texts = [(path.name, path.read_bytes()) for path in paths]
        makes = (b'jit import', b'numba.extending import', b'numba.core import')
        kept = (
            own in ('jit.py', 'linking.py') or any(m in text for m in makes) for own, text in texts
        )
        code = b''.join(text for (_, text), keeps in zip(texts, kept, strict=True) if keeps)
        self._hash = hashlib.sha256(code + repr(options).encode()).hexdigest()[:16]
        self._beside = sources[0] / '__pycache__'
        self._complete = False

    def is_complete(self) -> bool:
        """Whether this or an earlier process has compiled all that a first use needs."""
        self._complete = not _is_off() and (self._complete or self._is_whole())
        return self._complete

    @contextmanager
    def compiling(self, what: str, wait: str) -> Iterator[None]:
        """Context of a first use: say that all is compiled, and mark the code complete at the end.

        Args:
            what: What is compiled, for the message.
            wait: How long that takes, for the message.

        Raises:
            UserError: Numba is told to compile nothing.
        """
        if self.is_complete():
            yield
            return
        if _is_off():
            raise UserError(f'NUMBA_DISABLE_JIT is set, but {what} runs compiled only: unset it')
        print(f'rigid_gns: compiling {what}, once; {wait}', file=sys.stderr)
        self._complete = True  # or what is used within the block would begin another first use
        collects = gc.isenabled()
        gc.disable()  # the compiler makes millions of objects that live to its end
        try:
            yield
        except BaseException:
            self._complete = False
            raise
        finally:
            if collects:
                gc.enable()
        # last, and by name: a cache that was copied or cleared in part is not complete
        files = sorted({p.name for folder in self._readable() for p in folder.glob(f'*{_SUFFIX}')})
        if not self.write(_COMPLETE, '\n'.join(files).encode()):
            print(
                f'rigid_gns: {self._writable()[-1].parents[1]} cannot be written, so that each '
                'process compiles anew: set NUMBA_CACHE_DIR to a folder that can be written',
                file=sys.stderr,
            )

    def of(self, function: Function, **options: Any) -> Function:
        """Return `function` compiled for Python, with more options of numba.njit."""
        return self._decorated(function, pipeline_class=EntryCompiler, **options)

    def part(self, function: Function, **options: Any) -> Function:
        """The same for a function that only compiled functions call: Python itself must not."""
        # wrappers for calls from Python would take a fifth of the time to compile
        wrappers = {'no_cpython_wrapper': True, 'no_cfunc_wrapper': True}
        return self._decorated(function, pipeline_class=PartCompiler, **wrappers, **options)

    def _decorated(self, function: Function, **options: Any) -> Function:
        decorate: Any = numba.njit(error_model='numpy', **self._options, **options)
        dispatcher: Any = decorate(function)
        if hasattr(dispatcher, '_cache'):  # not with NUMBA_DISABLE_JIT
            dispatcher._cache = _Cache(function, self)
            template = dispatcher.get_call_template
            dispatcher.get_call_template = lambda args, kws: template(
                tuple(map(_general, args)), {name: _general(kind) for name, kind in kws.items()}
            )
        return cast(Function, dispatcher)

    def read(self, name: str) -> bytes | None:
        """Content that `write` stored under a name; None where there is none, or it is damaged."""
        for folder in self._readable():
            try:
                content = (folder / name).read_bytes()
            except OSError:
                continue
            digest, _, code = content.partition(b'\n')
            if digest == _digest(code):
                return code
            print(f'rigid_gns: {folder / name} is damaged: compiled anew', file=sys.stderr)
        return None

    def write(self, name: str, code: bytes) -> bool:
        """Store a file, whole or not at all; False where no folder can be written."""
        for folder in self._writable():
            partial = folder / f'{name}.{uuid.uuid4().hex}'
            try:
                folder.mkdir(parents=True, exist_ok=True)
                try:
                    partial.write_bytes(_digest(code) + b'\n' + code)
                    partial.replace(folder / name)
                finally:
                    partial.unlink(missing_ok=True)
            except OSError:
                continue
            if folder.parents[1] == self._beside:
                self._remove_old()
            return True
        return False

    def _is_whole(self) -> bool:
        """Whether the marker is there, and all files that it names."""
        content = self.read(_COMPLETE)
        return content is not None and all(map(self._exists, content.decode().split()))

    def _exists(self, name: str) -> bool:
        return any((folder / name).exists() for folder in self._readable())

    def _readable(self) -> list[Path]:
        return [folder / self._place for folder in (self._beside, *_users_folder())]

    def _writable(self) -> list[Path]:
        return self._readable()[1:] if _chosen() else self._readable()

    @cached_property
    def _place(self) -> Path:
        """Subfolder for these sources and this Python, Numba and CPU."""
        codegen = cpu_target.target_context.codegen()
        machine = (sys.implementation.cache_tag, numba.__version__, codegen.magic_tuple())
        return Path(f'{self._name}-{self._hash}', _digest(repr(machine).encode()).decode()[:16])

    def _remove_old(self) -> None:
        for old in self._beside.glob(f'{self._name}-*'):
            if old.name != self._place.parts[0]:
                shutil.rmtree(old, ignore_errors=True)


class _Cache(caching.NullCache):
    """Numba's cache of one function, with a file for each signature.

    Unlike Numba's own it has no index, which two processes could corrupt, and it is no error where
    a file is damaged or cannot be written.
    """

    def __init__(self, function: Callable[..., Any], code: MachineCode) -> None:
        self._name = f'{function.__module__}.{function.__qualname__}'
        self._code = code

    def load_overload(self, signature: Any, target: Any) -> Any:
        target.refresh()
        content = self._code.read(self._file(signature))
        if content is None:
            return None
        try:
            their_signature, code = pickle.loads(content)  # noqa: S301  # Numba knows no other way
        except (AttributeError, ImportError):  # of a type that has moved
            return None
        if their_signature != signature:  # another type of the same name
            return None
        return rebuilt(target, *code)

    def save_overload(self, signature: Any, compiled: Any) -> None:
        self._code.write(self._file(signature), _dumps((signature, compiled._reduce())))

    def _file(self, signature: Any) -> str:
        return f'{self._name}-{_digest(str(signature).encode()).decode()[:16]}{_SUFFIX}'


def _general(kind: Any) -> Any:
    """Type of an argument: a constant would make a function of its own of each callee."""
    constant = isinstance(kind, types.IntegerLiteral | types.BooleanLiteral)
    return types.unliteral(kind) if constant else kind


def _users_folder() -> list[Path]:
    """The user's folder for machine code; empty where there is no home."""
    place = _chosen() or os.environ.get('XDG_CACHE_HOME')
    try:
        return [Path(place or Path.home() / '.cache') / 'rigid_gns']
    except RuntimeError:
        return []


def _is_off() -> bool:
    """Whether Numba compiles nothing: then modules can be imported, as for documentation."""
    settings: Any = numba.config
    return bool(settings.DISABLE_JIT)


def _chosen() -> str:
    settings: Any = numba.config
    return str(settings.CACHE_DIR)


def _digest(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest().encode()
