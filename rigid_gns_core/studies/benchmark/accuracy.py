# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Accuracy of a peer: errors against the reference, and whether it is unstable."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .interleaved import PeerRecord
from .scenes import BenchScene, FRAME
from ..chaos_floor import worst
from ...scenes.scene import Scene
from ...scenes.state import Array, Trajectory
from ...scoring import chamfer, lost_behind, passed_through

HORIZONS = (30, 50, 100)
"""Frames at which errors are reported."""
ENERGY_RISE = 0.05
"""Relative rise of the energy, as estimated from positions, above which a peer is unstable."""


def position_errors(positions: Array, reference: Array) -> dict[str, float]:
    """Errors of centres [m], shape (frames + 1, n, 3), against those of the reference.

    Returns:
        `position_error_H` [m], the mean over spheres of the distance after H frames, for each of
        `HORIZONS` within the reference; `chamfer` [m^2] over all frames. Infinite where
        `positions` are too short or not finite.
    """
    last = len(reference) - 1
    errors: dict[str, float] = {}
    for frame in (horizon for horizon in HORIZONS if horizon <= last):
        there = len(positions) > frame and bool(np.isfinite(positions[: frame + 1]).all())
        apart = positions[frame] - reference[frame] if there else None
        errors[f'position_error_{frame}'] = (
            float('inf') if apart is None else float(np.linalg.norm(apart, axis=1).mean())
        )
    whole = positions.shape == reference.shape and bool(np.isfinite(positions).all())
    errors['chamfer'] = chamfer(positions, reference) if whole else float('inf')
    return errors


def faults(scene: BenchScene, record: PeerRecord) -> tuple[list[str], list[str]]:
    """Faults of a peer: those that make it unstable, and minor ones.

    It is unstable where it stopped, its energy rose, or spheres are behind a surface at the end.
    Centres that were behind a surface and came back are minor.
    """
    if record.stopped is not None:
        return [record.stopped], []
    positions, count = np.stack(record.positions), len(scene.start)
    through = passed_through(positions, scene.scene.surfaces)
    lost = lost_behind(positions, scene.scene.surfaces)
    grave, slight = [], []
    if (rise := energy_rise(scene, positions)) > ENERGY_RISE:
        grave.append(f'energy rose by {100.0 * rise:.2g} %')
    if lost.any():
        grave.append(f'{int(lost.sum())} of {count} spheres are lost behind a surface')
    if back := int((through & ~lost).sum()):
        slight.append(f'{back} of {count} centres were behind a surface, and came back')
    return grave, slight


def energy_rise(scene: BenchScene, positions: Array) -> float:
    """Largest rise of the energy above that of the start, relative to the latter; at least 0.

    It is estimated from positions, since not all peers give velocities: between two frames, the
    kinetic energy of the mean velocity, and the mean of both heights. In flight and at rest this
    is a lower bound, so that a rise is real; the unknown rotational energy can only add to it.

    Args:
        scene: Gravity, masses and the start with its velocities.
        positions: Centres [m], shape (frames + 1, n, 3).
    """
    energy = energies(scene, positions)
    count = len(scene.start)
    gravity = float(np.linalg.norm(scene.scene.gravity))
    weight = scene.scene.per_sphere('mass', count) * gravity
    # plus m g r of all spheres: spheres that rest on the ground from the start have no energy
    scale = energy[0] + (weight * scene.scene.per_sphere('radius', count)).sum()
    return max(0.0, float((energy.max() - energy[0]) / scale))


def energies(scene: BenchScene, positions: Array) -> Array:
    """Energy of the start, and that between each two frames by `energy_rise` [J].

    That of spheres that lie on the ground is 0. Arguments as there; shape (frames + 1,).
    """
    count = len(scene.start)
    mass = scene.scene.per_sphere('mass', count)
    up, gravity = scene.scene.up, float(np.linalg.norm(scene.scene.gravity))
    height = positions @ up - _ground(scene.scene)
    radius = scene.scene.per_sphere('radius', count)
    potential = (mass * gravity * (height - radius)).sum(axis=1)
    moves = np.linalg.norm(np.diff(positions, axis=0), axis=2) / FRAME
    moving = 0.5 * (mass * moves**2).sum(axis=1)
    spin = np.linalg.norm(scene.start.angular_velocities, axis=1)
    speed = np.linalg.norm(scene.start.velocities, axis=1)
    inertia = scene.scene.per_sphere('inertia_factor', count)
    begin = 0.5 * (mass * (speed**2 + inertia * (radius * spin) ** 2)).sum() + potential[0]
    found: Array = np.append(begin, moving + 0.5 * (potential[1:] + potential[:-1]))
    return found


def floor_of(runs: Sequence[Trajectory] | None) -> dict[str, float | None] | None:
    """Floor of chaos: the worst errors of the runs at other substeps against the first run."""
    if runs is None:
        return None
    reference, *others = (run.positions for run in runs)
    return worst([position_errors(other, reference) for other in others])


def assess(scene: BenchScene, record: PeerRecord, reference: Array | None) -> dict[str, Any]:
    """Status, faults and errors of a peer.

    Returns:
        `status` ('ok', 'unstable' or 'refused'), `faults` (see `faults`, or why it refused) and
        `errors` (see `position_errors`; None without a reference or a simulation).
    """
    if record.refused is not None:
        return {'status': 'refused', 'faults': [record.refused], 'errors': None}
    grave, slight = faults(scene, record)
    errors = None
    if reference is not None:
        errors = position_errors(np.stack(record.positions), reference)
    status = 'unstable' if grave else 'ok'
    return {'status': status, 'faults': grave + slight, 'errors': errors}


def _ground(scene: Scene) -> float:
    """Height of the ground [m]; 0 without one."""
    if scene.ground is None:
        return 0.0
    return float(np.asarray(scene.surfaces[scene.ground].point) @ scene.up)
