# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Laws that each trajectory keeps by itself: energy, momentum, and that bodies are solid."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from .failure import Failure
from .scenes import Case
from ...scenes.plane import distances, Plane
from ...scenes.state import Array, Trajectory
from ...scoring import energy

ROUNDING = 1e-9
"""Relative change of energy and momentum that counts as none."""
LAST_BOUNCES = 1e-4
"""Relative energy of bounces that are slow enough to end."""
DEPTH = 0.01
"""Depth that may last [radii]."""
LASTS = 5
"""Last frames throughout which a depth lasts."""


def broken_laws(case: Case, path: Trajectory) -> list[Failure]:
    """Laws that a finite trajectory of the case breaks."""
    laws = (_energy, _momentum, _inside, _depth)
    return [failure for law in laws for failure in law(case, path)]


def _energy(case: Case, path: Trajectory) -> Iterator[Failure]:
    """Energy never rises, nor falls where nothing takes it."""
    scene, parts = case.scene, energy(path, case.scene)
    start = float(parts.kinetic[0] + parts.rotational[0])
    mass, radius = (scene.per_sphere(name, path.count) for name in ('mass', 'radius'))
    scale = start + float(np.linalg.norm(scene.gravity)) * float(mass @ radius)
    share = parts.with_rotation / (scale or 1.0)
    frame = int(np.argmax(np.diff(share)))
    rise = float(np.diff(share)[frame])
    if rise > ROUNDING:
        yield Failure('energy', rise, ROUNDING, f'rises in frame {frame + 1}')
    lost, bound = np.abs(share - share[0]), _lossless(case)
    if bound is not None and lost.max() > bound:
        text = f'energy, from frame {np.argmax(lost > bound)}'
        yield Failure('conserved', float(lost.max()), bound, text)


def _lossless(case: Case) -> float | None:
    """Share of the energy that may be lost, where that is next to nothing, else None.

    Newton's impacts keep all energy at restitution 1, also several at once, if they are solved
    exactly. With gravity a bounce ends where it is slow enough, and several spheres may rest on
    each other, so there it is asked of one sphere only.
    """
    scene = case.scene
    bounces = np.append(scene.restitution, scene.surface_values('restitution'))
    rubs = np.append(scene.friction, scene.rolling_friction)
    if not (bounces == 1).all() or rubs.any():
        return None
    if not np.any(scene.gravity):
        return ROUNDING
    return LAST_BOUNCES if len(case.start) == 1 else None


def _momentum(case: Case, path: Trajectory) -> Iterator[Failure]:
    """Spheres that nothing else can touch in a frame move on together as in free flight.

    Their centre of mass moves by V dt + g dt^2 / 2, V by g dt, and the angular momentum about it
    stays.
    """
    mass, radius = (case.scene.per_sphere(name, path.count) for name in ('mass', 'radius'))
    gyration = case.scene.per_sphere('inertia_factor', path.count) * radius**2
    gravity, dt = np.asarray(case.scene.gravity), path.dt
    length, reach = float(radius.max()), _reach(case, path)
    time = 10.0 * dt
    speed = np.linalg.norm(path.velocities, axis=2).max() * time / length
    for k in range(path.steps):
        p, v, w = path.positions[k : k + 2], path.velocities[k : k + 2], path.angular_velocities
        gaps = np.linalg.norm(p[0][:, None] - p[0], axis=2) - np.add.outer(radius, radius)
        near = gaps < np.add.outer(reach[k], reach[k])
        to_surfaces = distances(case.scene.surfaces, p[0]) - radius[:, None]
        held = (to_surfaces < reach[k][:, None]).any(axis=1)
        count, group = connected_components(near)
        for own in (group == g for g in range(count)):
            if held[own].any():
                continue
            share = mass[own] / mass[own].sum()
            centre, mean = share @ p[:, own], share @ v[:, own]
            flight = centre[0] + mean[0] * dt + 0.5 * gravity * dt**2
            arm, flow = p[:, own] - centre[:, None], v[:, own] - mean[:, None]
            spin = np.cross(arm, flow) + gyration[own, None] * w[k : k + 2, own]
            errors = {
                'path': np.linalg.norm(centre[1] - flight) / length,
                'momentum': np.linalg.norm(mean[1] - mean[0] - gravity * dt) * time / length,
                'angular momentum': np.linalg.norm(share @ np.diff(spin, axis=0)[0])
                * (time / length**2),
            }
            name = max(errors, key=lambda of: errors[of])
            bound = ROUNDING * (1.0 + speed)
            if errors[name] > bound:
                spheres = ', '.join(map(str, np.flatnonzero(own)))
                text = f'{name} of spheres {spheres}, which touch no surface, in frame {k + 1}'
                yield Failure('momentum', float(errors[name]), bound, text)
                return


def _inside(case: Case, path: Trajectory) -> Iterator[Failure]:
    """No centre is behind a half-space, or one of a room, or has gone through a plate."""
    radius, reach = case.scene.per_sphere('radius', path.count), _reach(case, path)
    for index, plane in enumerate(case.scene.surfaces):
        heights = (path.positions - plane.point) @ np.asarray(plane.normal)
        if case.closed or plane.is_half_space:
            out = -heights / radius
            size, bound, what = float(out.max()), ROUNDING, 'behind surface'
        else:
            out = _shortcut(plane, path.positions, reach) / radius
            size, bound, what = float(out.max(initial=0.0)), 0.0, 'through surface'
        if size > bound:
            frame, sphere = np.argwhere(out > bound)[0]
            text = f'centre of sphere {sphere} {what} {index}, first in frame {frame}'
            yield Failure('inside', size, bound, text)
            return


def _depth(case: Case, path: Trajectory) -> Iterator[Failure]:
    """Nothing stays deep in anything."""
    radius, last = case.scene.per_sphere('radius', path.count), path.positions[-LASTS:]
    planes = np.stack([distances(case.scene.surfaces, p) for p in last])
    depths = {'surface': (radius[:, None] - planes) / radius[:, None]}
    apart = np.linalg.norm(last[:, :, None] - last[:, None], axis=3)
    apart += np.where(np.eye(path.count), np.inf, 0.0)
    depths['sphere'] = (np.add.outer(radius, radius) - apart) / np.minimum.outer(radius, radius)
    for what, depth in depths.items():
        lasting = depth.min(axis=0)
        if lasting.max(initial=0.0) > DEPTH:
            sphere, other = np.unravel_index(np.argmax(lasting), lasting.shape)
            text = f'sphere {sphere} in {what} {other}, in each of the last {LASTS} frames'
            yield Failure('depth', float(lasting.max()), DEPTH, text)
            return


def _reach(case: Case, path: Trajectory) -> Array:
    """Longest way that a centre can go in each frame, shape (steps, n).

    Where all energy of motion and of what gravity adds would be that of one sphere.
    """
    mass, radius, inertia = (
        case.scene.per_sphere(name, path.count) for name in ('mass', 'radius', 'inertia_factor')
    )
    falls = float(np.linalg.norm(case.scene.gravity)) * path.dt
    speeds = np.linalg.norm(path.velocities, axis=2) + falls
    spins = radius * np.linalg.norm(path.angular_velocities, axis=2)
    twice_energy = (speeds**2 + inertia * spins**2) @ mass
    fastest: Array = np.sqrt(twice_energy[:-1, None] / mass) + falls
    return 1.001 * path.dt * fastest


def _shortcut(plane: Plane, positions: Array, reach: Array) -> Array:
    """By how much centres that change sides of a plate lack the way around its edges [m].

    0 or less where they need not have gone through. Shape (steps + 1, n); 0 at the start.
    """
    local = (positions - plane.point) @ plane.axes.T
    half = plane.half_lengths
    lack = np.zeros(positions.shape[:2])
    before, after = local[:-1], local[1:]
    changed = before[..., 2] * after[..., 2] < 0
    way = before - after
    share = before[..., 2] / np.where(changed, way[..., 2], 1.0)
    crossing = (before - share[..., None] * way)[..., :2]
    through: NDArray[np.bool_] = changed & (np.abs(crossing) <= half).all(axis=-1)
    around = np.full(through.shape, np.inf)
    for axis in np.flatnonzero(np.isfinite(half)):
        for edge in (-half[axis], half[axis]):
            # the shortest way over the line of an edge: both halves unfolded into one plane
            to_edge = np.hypot(before[..., axis] - edge, before[..., 2])
            from_edge = np.hypot(after[..., axis] - edge, after[..., 2])
            along = after[..., 1 - axis] - before[..., 1 - axis]
            around = np.minimum(around, np.hypot(to_edge + from_edge, along))
    lack[1:][through] = (around - reach)[through]
    return lack
