# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether a module works, asked of another process: it may be slow, broken, or crash there."""

from __future__ import annotations

import json
import subprocess
import sys
from types import TracebackType
from typing import Any

from .extras import remedy
from .versions import version_of

TIME_LIMIT = 60.0
"""Seconds that an import may take, from a cold disk perhaps."""
_ENGINE = """
    from rigid_gns_core.kernels.jit import is_compiled
    found['compiled'] = is_compiled()
    found['remedy'] = None if is_compiled() else 'python -m rigid_gns_core.engine'
"""
_TORCH = """
    import torch
    found['cuda'] = torch.version.cuda
    count = torch.cuda.device_count() if torch.cuda.is_available() else 0
    found['gpus'] = [torch.cuda.get_device_name(index) for index in range(count)]
"""
_PYBULLET = """
    import pybullet
"""
_ROS = """
    import os, rclpy, rclpy.utilities
    found['distribution'] = os.environ.get('ROS_DISTRO')
    found['rmw'] = rclpy.utilities.get_rmw_implementation_identifier()
"""
# name: (module that may be missing, and its distribution; code that puts facts into `found`)
PROBES = {
    'engine': ('numba', _ENGINE),
    'torch': ('torch', _TORCH),
    'pybullet': ('pybullet', _PYBULLET),
    'ros': ('rclpy', _ROS),
}
# sys.path as here, so that what is asked about is what this process would import
_FRAME = """import json, sys
sys.path[:] = json.loads(sys.argv[1])
found = {{}}
try:{code}except ModuleNotFoundError as error:
    found = {{'missing': error.name}}
print(json.dumps(found))
"""


class Probes:
    """Processes that ask, side by side; a context manager."""

    def __init__(self) -> None:
        self._processes: dict[str, subprocess.Popen[str]] = {}

    def __enter__(self) -> Probes:
        path = json.dumps(sys.path)
        for name, (_, code) in PROBES.items():
            self._processes[name] = subprocess.Popen(
                [sys.executable, '-c', _FRAME.format(code=code), path],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            )
        return self

    def results(self) -> dict[str, dict[str, Any]]:
        """Of each: `state` (ready, missing or broken), `version`, `error`, `remedy`, and facts."""
        return {name: self._result(name) for name in PROBES}

    def _result(self, name: str) -> dict[str, Any]:
        module, _ = PROBES[name]
        version = version_of(module)
        try:
            output, errors = self._processes[name].communicate(timeout=TIME_LIMIT)
            found = json.loads(output.splitlines()[-1])
        except subprocess.TimeoutExpired:
            return _broken(version, f'no answer in {TIME_LIMIT:g} s')
        except (IndexError, json.JSONDecodeError):  # it ended before its answer
            lines = errors.strip().splitlines()
            code = self._processes[name].returncode
            return _broken(version, lines[-1] if lines else f'its process ended with code {code}')
        if absent := found.get('missing'):
            if absent.partition('.')[0] != module:
                return _broken(version, f'it lacks {absent}') | {'remedy': remedy(absent)}
            return {'state': 'missing', 'version': None, 'error': None, 'remedy': remedy(module)}
        return {'state': 'ready', 'version': version, 'error': None, 'remedy': None, **found}

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for process in self._processes.values():
            if process.poll() is None:
                process.kill()
            process.communicate()


def _broken(version: str | None, error: str) -> dict[str, Any]:
    return {'state': 'broken', 'version': version, 'error': error, 'remedy': None}
