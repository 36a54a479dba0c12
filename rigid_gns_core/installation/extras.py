# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What to install where a module is missing: the extra of this package that brings it."""

from __future__ import annotations

from importlib import import_module
import sys
from typing import Any

from .versions import PACKAGE

# module: extra of setup.py, which a test compares
EXTRAS = {
    'torch': 'torch',
    'pybullet': 'teacher',
    'matplotlib': 'plot',
    'mujoco': 'bench',
    'distributed': 'cluster',
    'rclpy': 'ros',
}
# module that everything needs: its distribution
CORE = {
    **{name: name for name in ('numpy', 'scipy', 'h5py', 'numba', 'mcap', 'joblib', 'tqdm')},
    **{name: name for name in ('safetensors', 'threadpoolctl', 'tabulate', 'argcomplete')},
    'yaml': 'PyYAML',
}


def remedy(module: str, python: tuple[int, int] = sys.version_info[:2]) -> str | None:
    """Return what makes a module importable; None: this package asks for no such module.

    Args:
        module: Its name, such as 'torch' or 'matplotlib.figure'.
        python: Version of the interpreter it is for.
    """
    top = module.partition('.')[0]
    if top in CORE:
        return f'pip install {CORE[top]}'
    if top not in EXTRAS:
        return None
    install = f"pip install '{PACKAGE}[{EXTRAS[top]}]'"
    if top == 'pybullet' and python >= (3, 12):  # where the extra would install nothing
        return (
            f'{top} has no wheel for Python 3.12 or newer: use Python 3.11 and {install}, or '
            f'build it, with a C++ compiler: pip install {top}'
        )
    return f'source the setup.bash of a ROS 2 Jazzy, or {install}' if top == 'rclpy' else install


def missing(error: ModuleNotFoundError, what: str) -> ModuleNotFoundError:
    """Return the error: `what` needs a module that is not installed, and how to get it."""
    module = error.name or str(error)
    advice = remedy(module)
    text = f'{what} needs {module}, which is not installed'
    return ModuleNotFoundError(f'{text}: {advice}' if advice else text, name=error.name)


def needed(module: str, what: str) -> Any:
    """Import a module that an extra brings.

    Raises:
        ModuleNotFoundError: It is not installed; the message tells that `what` needs it, and how
            to get it.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise missing(error, what) from error
