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

"""How Numba compiles a package of ours: at the first use, then read from a folder of its own."""

from __future__ import annotations

from collections.abc import Callable
import hashlib
import os
from pathlib import Path
import shutil
from typing import Any, cast, TypeVar

import numba

Function = TypeVar('Function', bound=Callable[..., Any])


class MachineCode:
    """Machine code of some sources, in a folder named by a hash of all of them.

    Numba looks at the file of a function only, and would go on with old code of those it calls.

    Args:
        name: What the folder's name begins with.
        sources: Folders of the sources; the code is kept beside the first, or in the user's cache
            where that cannot be written. Of their files `jit.py` counts, and those that import it.
        options: Of numba.njit, for all functions.
    """

    def __init__(self, name: str, *sources: Path, **options: Any) -> None:
        self._options = options
        paths = [path for folder in sources for path in sorted(folder.glob('*.py'))]
        texts = [(path.name, path.read_bytes()) for path in paths]
        code = b''.join(text for own, text in texts if own == 'jit.py' or b'jit import' in text)
        mark = hashlib.sha256(code + repr(options).encode()).hexdigest()[:16]
        self.folder = _place(sources[0], name, mark)
        self._seen = False

    def exists(self) -> bool:
        """Whether this or an earlier process has left machine code of these sources."""
        # the disk is searched no more, once it was found
        self._seen = self._seen or any(self.folder.rglob('*.nbc'))
        return self._seen

    def of(self, function: Function, **options: Any) -> Function:
        """Return `function` compiled, with more options of numba.njit."""
        settings: Any = numba.config
        theirs = settings.CACHE_DIR
        settings.CACHE_DIR = str(self.folder)
        try:
            decorate: Any = numba.njit(cache=True, error_model='numpy', **self._options, **options)
            return cast(Function, decorate(function))
        finally:
            settings.CACHE_DIR = theirs


def _place(sources: Path, name: str, mark: str) -> Path:
    beside, own = sources / '__pycache__', f'{name}-{mark}'
    if not os.access(beside if beside.exists() else sources, os.W_OK):
        home = os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache'
        return Path(home) / 'rigid_gns' / own
    for old in beside.glob(f'{name}-*'):
        if old.name != own:
            shutil.rmtree(old, ignore_errors=True)
    return beside / own
