# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A process that is killed as it puts a file in its place."""

from __future__ import annotations

from collections.abc import Callable
import os


def killed_at(number: int) -> Callable[[str, str], None]:
    """What to put in the place of `os.replace`: its call of that number, from 1, ends the process.

    As a MemoryError, which nothing here handles.
    """
    replace_file, count = os.replace, 0

    def replace(source: str, target: str) -> None:
        nonlocal count
        count += 1
        if count == number:
            raise MemoryError
        replace_file(source, target)

    return replace
