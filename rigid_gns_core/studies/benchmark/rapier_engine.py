# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rapier as a peer: a game engine, as WebAssembly in a process of Node.js.

Its package is found where npm installs it, in the folder that the benchmark runs in or above it.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
import json
from pathlib import Path
import shutil
import subprocess
from typing import Any

import numpy as np

from .plain_scene import check_plain, common_values
from ...scenes.scene import Scene
from ...scenes.state import Array, State

PACKAGE = '@dimforge/rapier3d-simd-compat'
_SCRIPT = Path(__file__).with_suffix('.js')


@dataclass(frozen=True)
class RapierSettings:
    """Settings of Rapier.

    Args:
        substeps: Steps of Rapier per frame.
        iterations: Iterations of its solver in each; 4 is Rapier's own.
    """

    substeps: int = 6
    iterations: int = 4


def load_rapier() -> str:
    """Version of Rapier.

    Raises:
        ModuleNotFoundError: Node.js or the package is not installed.
    """
    node, advice = shutil.which('node'), f'install Node.js, then: npm install {PACKAGE}'
    if node is None:
        raise ModuleNotFoundError(f'the peer Rapier needs node, which is not installed: {advice}')
    code = f'console.log(require.resolve({json.dumps(PACKAGE)}))'
    found = subprocess.run([node, '-e', code], capture_output=True, text=True)
    if found.returncode:
        raise ModuleNotFoundError(
            f'the peer Rapier needs {PACKAGE}, which is not in node_modules here: {advice}'
        )
    folders = Path(found.stdout.strip()).parents
    described = next(f / 'package.json' for f in folders if (f / 'package.json').is_file())
    return str(json.loads(described.read_text(encoding='utf-8'))['version'])


class RapierSpheres:
    """A live Rapier scene that is advanced frame by frame.

    Args:
        scene: Half spaces, and properties that are the same for all spheres.
        start: State at time 0.
        dt: Length of a frame [s].
        settings: Settings of Rapier.

    Raises:
        UserError: Rapier cannot express the scene.
        FloatingPointError: Its process ended.
    """

    def __init__(self, scene: Scene, start: State, dt: float, settings: RapierSettings) -> None:
        described = _describe(scene, start, dt, settings)
        self._count = len(start)
        command = [shutil.which('node') or 'node', str(_SCRIPT), PACKAGE]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._answer(1)
        self._ask(json.dumps(described))
        self._answer(1)

    def advance(self) -> Array:
        """Advance by a frame; the centres after it [m], shape (n, 3).

        Raises:
            FloatingPointError: Its process ended.
        """
        self._ask('')
        return self._answer(3 * self._count).reshape(-1, 3)

    def close(self) -> None:
        """End the process."""
        self._process.communicate()

    def _ask(self, line: str) -> None:
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(line.encode() + b'\n')
            self._process.stdin.flush()
        except BrokenPipeError as error:
            raise FloatingPointError('the process of Rapier ended') from error

    def _answer(self, count: int) -> Array:
        assert self._process.stdout is not None
        content = self._process.stdout.read(8 * count)
        if len(content) < 8 * count:
            raise FloatingPointError('the process of Rapier ended')
        return np.frombuffer(content)


def describe(settings: RapierSettings) -> dict[str, Any]:
    """Settings for the report."""
    return {'engine': PACKAGE, 'version': load_rapier(), **asdict(settings)}


def _describe(scene: Scene, start: State, dt: float, settings: RapierSettings) -> dict[str, Any]:
    check_plain('Rapier', scene, start)
    names = ('radius', 'mass', 'restitution', 'friction')
    values = common_values('Rapier', scene, len(start), *names)
    step = dt / settings.substeps
    # v += g h; x += v h, h that of an iteration, is exact in flight if v is that of h / 2 before x
    h = step / settings.iterations
    early = start.velocities - 0.5 * h * np.asarray(scene.gravity)
    planes = [
        {
            'point': list(map(float, plane.point)),
            'normal': list(map(float, plane.normal)),
            'restitution': restitution,
            'friction': friction,
        }
        for plane, restitution, friction in zip(
            scene.surfaces,
            scene.surface_values('restitution').tolist(),
            scene.surface_values('friction').tolist(),
            strict=True,
        )
    ]
    return {
        'gravity': list(map(float, scene.gravity)),
        'step': step,
        **asdict(settings),
        **values,
        'planes': planes,
        'positions': start.positions.tolist(),
        'quaternions': start.quaternions.tolist(),
        'velocities': early.tolist(),
        'angular_velocities': start.angular_velocities.tolist(),
    }
