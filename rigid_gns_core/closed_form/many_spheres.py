# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of spheres with each other: collisions of two, piles, rest."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from . import laws
from .bounces import GRAVITY, Simulate
from .check import Check, check
from ..scenes.plane import Plane
from ..scenes.scene import Scene
from ..scenes.state import Array, State


def collision_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Velocities, spins and momenta of two spheres that collide in free space."""
    cases = [
        (ratio, e, 0.0) for ratio in (1.0, 3.0, 100.0) for e in ((0.6,) if quick else (0, 0.6, 1))
    ] + [(ratio, 0.6, offset) for ratio in (1.0, 5.0) for offset in (0.4, 1.0, 1.6)]
    friction, speed = 0.3, 4.0
    for spins in ((0.0, 0.0, 0.0), (1.0, 2.0, 3.0)):
        masses = np.array([(1.0, ratio) for ratio, _, _ in cases])
        positions = np.array(
            [
                ((-3.1, 40.0 * k + offset, 0.0), (0.0, 40.0 * k, 0.0))
                for k, (_, _, offset) in enumerate(cases)
            ]
        )
        velocities = np.zeros_like(positions)
        velocities[:, 0, 0] = speed
        turning = np.zeros_like(positions)
        turning[:, 0] = spins
        restitution = np.sqrt([e for _, e, _ in cases]).repeat(2)
        run = simulate(
            Scene(
                surfaces=(),
                gravity=(0.0, 0.0, 0.0),
                mass=tuple(masses.ravel()),
                restitution=tuple(restitution),
                friction=float(np.sqrt(friction)),
                rolling_friction=0.0,
            ),
            State(
                positions=positions.reshape(-1, 3),
                velocities=velocities.reshape(-1, 3),
                angular_velocities=turning.reshape(-1, 3),
            ),
            10,
            0.1,
        )
        for k, (ratio, e, offset) in enumerate(cases):
            pair, radii = slice(2 * k, 2 * k + 2), np.ones(2)
            normal = np.array([-np.sqrt(4.0 - offset**2), offset, 0.0]) / 2.0
            expected = laws.impact_of_spheres(
                velocities[k], turning[k], normal, radii, masses[k], float(e), friction
            )
            kind = 'oblique' if offset else 'central'
            case = f'masses 1:{ratio:g}, e {e:g}, offset {offset:g} r, spin {spins[2]:g}'
            error = np.abs(run.velocities[-1, pair] - expected[0]).max() / speed
            yield check(f'two spheres, {kind}, velocities', case, error, 0, 0.01)
            error = np.abs(run.angular_velocities[-1, pair] - expected[1]).max() / speed
            yield check(f'two spheres, {kind}, spins', case, error, 0, 0.01)
            linear, angular = laws.momenta(
                # about a point of the pair, or the distance to the origin drowns the rest
                run.positions[:, pair] - positions[k, 1],
                run.velocities[:, pair],
                run.angular_velocities[:, pair],
                masses[k],
                radii,
            )
            drift = np.linalg.norm(linear[-1] - linear[0]) / np.linalg.norm(linear[0])
            yield check('two spheres, momentum', case, drift, 0, 1e-4)
            drift = np.linalg.norm(angular[-1] - angular[0]) / speed
            yield check('two spheres, angular momentum / (m v r)', case, drift, 0, 0.01)


def _deepest(positions: Array) -> tuple[float, float]:
    """Deepest penetration among unit spheres, and into z < 0, in diameters; positions (n, 3)."""
    gaps = np.linalg.norm(positions[:, None] - positions[None], axis=-1)
    np.fill_diagonal(gaps, np.inf)
    return max(0.0, 2.0 - gaps.min()) / 2.0, max(0.0, 1.0 - positions[:, 2].min()) / 2.0


def pile_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Penetration, energy and creep of a pile in a box and of spheres at rest."""
    side, layers, steps = (2, 2, 40) if quick else (3, 3, 150)
    draw = np.random.default_rng(0)
    grid = np.stack(np.meshgrid(*[2.1 * (np.arange(side) - (side - 1) / 2)] * 2), -1).reshape(
        -1, 2
    )
    start = np.concatenate(
        [
            np.c_[
                grid + draw.uniform(-0.03, 0.03, grid.shape), np.full(len(grid), 1.2 + 2.3 * layer)
            ]
            for layer in range(layers)
        ]
    )
    # so narrow that the spheres lean on the walls
    width = 2.17 * side
    scene = Scene(surfaces=Plane.box(width, width))
    run = simulate(scene, State(positions=start), steps, 0.1)
    case = f'{len(start)} spheres, {steps * 0.1:g} s'
    between, floor = np.max([_deepest(frame) for frame in run.positions[steps // 2 :]], axis=0)
    yield check('pile, penetration of spheres [diameters]', case, between, 0, 1e-3)
    yield check('pile, penetration of the floor [diameters]', case, floor, 0, 1e-3)
    beyond = max(0.0, np.abs(run.positions[steps // 2 :, :, :2]).max() + 1.0 - width / 2)
    yield check('pile, penetration of the walls [diameters]', case, beyond / 2, 0, 1e-3)
    total = laws.energy(
        run.positions,
        run.velocities,
        run.angular_velocities,
        np.ones(len(start)),
        np.ones(len(start)),
        np.asarray(scene.gravity),
    )
    gain = np.maximum(np.diff(total), 0.0).sum() / (total[0] - GRAVITY * len(start))
    yield check('pile, energy gained / energy at the start', case, gain, 0, 1e-4)

    grid = np.stack(np.meshgrid(*[2.0 * np.arange(4.0)] * 2), -1).reshape(-1, 2)
    rest = simulate(
        Scene(), State(positions=np.c_[grid, np.ones(len(grid))]), 20 if quick else 100, 0.1
    )
    moved = np.linalg.norm(rest.positions[-1] - rest.positions[0], axis=-1).max()
    yield check('spheres at rest that touch, drift [r]', f'{len(grid)} spheres', moved, 0, 1e-3)
