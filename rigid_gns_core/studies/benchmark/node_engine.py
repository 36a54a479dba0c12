# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Game engines as peers: packages of npm, as WebAssembly in a process of Node.js.

A package is found where npm installs it, in the folder that the benchmark runs in or above it.
"""

from __future__ import annotations

from dataclasses import asdict
import json
from pathlib import Path
import shutil
import subprocess
from typing import Any, ClassVar

import numpy as np

from .plain_scene import check_plain, common_values
from ...scenes.scene import Scene
from ...scenes.state import Array, State


def package_version(peer: str, package: str) -> str:
    """Version of a package.

    Args:
        peer: Name of the engine, for messages.
        package: Its name on npm.

    Raises:
        ModuleNotFoundError: Node.js or the package is not installed.
    """
    node, advice = shutil.which('node'), f'install Node.js, then: npm install {package}'
    if node is None:
        raise ModuleNotFoundError(f'the peer {peer} needs node, which is not installed: {advice}')
    code = f'console.log(require.resolve({json.dumps(package)}))'
    found = subprocess.run([node, '-e', code], capture_output=True, text=True)
    if found.returncode:
        raise ModuleNotFoundError(
            f'the peer {peer} needs {package}, which is not in node_modules here: {advice}'
        )
    folders = Path(found.stdout.strip()).parents
    described = next(f / 'package.json' for f in folders if (f / 'package.json').is_file())
    return str(json.loads(described.read_text(encoding='utf-8'))['version'])


class NodeSpheres:
    """A live scene of such an engine that is advanced frame by frame.

    Args:
        count: Number of spheres.
        described: The scene, as its script takes it.

    Raises:
        FloatingPointError: Its process ended.
    """

    peer: ClassVar[str]
    package: ClassVar[str]
    script: ClassVar[Path]

    @classmethod
    def version(cls) -> str:
        """Version of its package; ModuleNotFoundError: Node.js or the package is not installed."""
        return package_version(cls.peer, cls.package)

    @classmethod
    def describe(cls, settings: Any) -> dict[str, Any]:
        """Settings, a dataclass, for the report."""
        return {'engine': cls.package, 'version': cls.version(), **asdict(settings)}

    def __init__(self, count: int, described: dict[str, Any]) -> None:
        self._count = count
        command = [shutil.which('node') or 'node', str(self.script), self.package]
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
            raise FloatingPointError(f'the process of {self.peer} ended') from error

    def _answer(self, count: int) -> Array:
        assert self._process.stdout is not None
        content = self._process.stdout.read(8 * count)
        if len(content) < 8 * count:
            raise FloatingPointError(f'the process of {self.peer} ended')
        return np.frombuffer(content)


def describe_scene(peer: str, scene: Scene, start: State, step: float) -> dict[str, Any]:
    """A scene as the scripts take it.

    Args:
        peer: Name of the engine, for messages.
        scene: Half spaces, and properties that are the same for all spheres.
        start: State at time 0.
        step: Time step of the engine's integration [s].

    Raises:
        UserError: The engine cannot express the scene.
    """
    check_plain(peer, scene, start)
    names = ('radius', 'mass', 'restitution', 'friction')
    # v += g h; x += v h is exact in flight if v is that of h / 2 before x
    early = start.velocities - 0.5 * step * np.asarray(scene.gravity)
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
        **common_values(peer, scene, len(start), *names),
        'planes': planes,
        'positions': start.positions.tolist(),
        'quaternions': start.quaternions.tolist(),
        'velocities': early.tolist(),
        'angular_velocities': start.angular_velocities.tolist(),
    }
