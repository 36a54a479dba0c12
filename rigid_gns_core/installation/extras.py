# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""How to install a missing module: by the extra of this package that requires it."""

from __future__ import annotations

from importlib import import_module, metadata
import re
import sys
from typing import Any

from .versions import PACKAGE

# distributions that are not named as their module
_DISTRIBUTIONS = {'rclpy': 'ros-jazzy-rclpy', 'yaml': 'PyYAML'}
# what else makes a module importable
_ALSO = {'rclpy': 'source the setup.bash of a ROS 2 Jazzy, or '}


def remedy(module: str, python: tuple[int, int] = sys.version_info[:2]) -> str | None:
    """How to install a module; None: this package does not require it.

    Args:
        module: Name of the module, such as 'torch' or 'matplotlib.figure'.
        python: Version of the interpreter that lacks it.
    """
    top = module.partition('.')[0]
    wanted = _canonical(_DISTRIBUTIONS.get(top, top))
    for name, requirement in _requirements():
        if _canonical(name) != wanted:
            continue
        extra = re.search(r'extra == ["\']([\w-]+)', requirement)
        if extra is None:
            return f"pip install '{requirement.partition(';')[0].strip()}'"
        before = re.search(r'python_version < ["\'](\d+)\.(\d+)', requirement)
        if before is not None and python >= (limit := (int(before[1]), int(before[2]))):
            # the extra would install nothing here
            return (
                f'{name} has no wheel for Python {limit[0]}.{limit[1]} or newer: use Python '
                f"{limit[0]}.{limit[1] - 1} and pip install '{PACKAGE}[{extra[1]}]', or build it, "
                f'with a C++ compiler: pip install {name}'
            )
        return f"{_ALSO.get(top, '')}pip install '{PACKAGE}[{extra[1]}]'"
    return None


def missing(error: ModuleNotFoundError, what: str) -> ModuleNotFoundError:
    """The error to raise: `what` needs a module that is not installed, and how to get it."""
    module = error.name or str(error)
    advice = remedy(module)
    text = f'{what} needs {module}, which is not installed'
    return ModuleNotFoundError(f'{text}: {advice}' if advice else text, name=error.name)


def needed(module: str, what: str) -> Any:
    """Import a module that `what` needs and that an extra installs.

    Raises:
        ModuleNotFoundError: It is not installed; see `missing`.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise missing(error, what) from error


def _requirements() -> list[tuple[str, str]]:
    """(distribution, requirement), in the order of setup.py: the extra `all` is the last."""
    try:
        lines = metadata.requires(PACKAGE) or []
    except metadata.PackageNotFoundError:  # run from a source tree that is not installed
        return []
    return [(found[0], line) for line in lines if (found := re.match(r'[\w.-]+', line))]


def _canonical(name: str) -> str:
    return re.sub(r'[-_.]+', '-', name).lower()
