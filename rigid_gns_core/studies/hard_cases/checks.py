# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Measures of a trajectory of a hard case, and the thresholds they are checked against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, get_args

import numpy as np

from .case import Case
from .cases import DRIFT, ENERGY_RISE
from ..chaos_floor import least_floor, over_floor
from ...errors import UserError
from ...scenes.scene import Scene
from ...scenes.state import Array, Trajectory
from ...scoring import divergence, energy, passed_through, sphere_penetration, surface_penetration
from ...scoring.evaluate import Velocities

HORIZONS = (10, 30, 100)
"""Steps at which errors against the teacher are reported."""
TEACHER_ENERGY_RISE = 0.1
"""Energy rise above which a teacher's trajectory is unstable and not used as a reference."""
_BELOW = 1e-9  # centres less far behind a surface are on it, but for rounding [r]


def measure_laws(
    case: Case, trajectory: Trajectory, *, velocities: Velocities = 'given'
) -> dict[str, Any]:
    """Measure laws of physics, which need no reference.

    Args:
        case: The case that was simulated.
        trajectory: Its trajectory.
        velocities: 'given': velocities are instantaneous; 'poses': they are means over a step, so
            that energies are of backward differences of the poses, except at the start.

    Returns:
        Measures by name. `diverged_at` is the step or None, `escaped` the number of spheres that
        went through a surface, `deepest` and `final_depth` the deepest penetration in the second
        half and in the last frame [diameters], `deepest_allowed` the bound of the first or None
        where it is not judged, `drift` that over the second half [r] or None where
        nothing should rest, `final_speed` that of the fastest sphere [m/s]; `finite` and `inside`
        are verdicts, `energy_rise` and `push_out` those of the function `energy_rise`. Measures of
        a whole rollout are infinite where it diverged.

    Raises:
            UserError: The trajectory has other numbers of spheres or steps than the case.
    """
    if velocities not in get_args(Velocities):
        raise UserError(f"velocities is {velocities!r}, expected 'given' or 'poses'")
    if trajectory.positions.shape[:2] != (case.steps + 1, len(case.start)):
        raise UserError(
            f'the trajectory has {trajectory.steps} steps of {trajectory.count} spheres, case '
            f'{case.name!r} {case.steps} of {len(case.start)}'
        )
    with np.errstate(over='ignore', invalid='ignore'):
        lost = divergence(trajectory, case.scene)
    # spheres may escape before the rollout diverges
    escaped = _escaped(
        case, trajectory.positions[: max(1, len(trajectory) if lost is None else lost)]
    )
    laws: dict[str, Any] = {
        'diverged_at': lost,
        'finite': lost is None,
        'inside': not escaped,
        'escaped': escaped,
        'deepest_allowed': case.deepest,
    }
    if lost is not None:
        names = ('deepest', 'final_depth', 'energy_rise', 'push_out', 'final_speed')
        drift = float('inf') if case.rests else None
        return laws | dict.fromkeys(names, float('inf')) | {'drift': drift}
    if velocities == 'poses':
        trajectory = _from_poses(trajectory)
    half = trajectory.positions[len(trajectory) // 2 :]
    rise, push_out = energy_rise(case, trajectory)
    radius = case.scene.per_sphere('radius', trajectory.count)
    moved = np.linalg.norm(half - half[0], axis=2) / radius
    return laws | {
        'deepest': _depth(case.scene, half, radius),
        'final_depth': _depth(case.scene, half[-1:], radius),
        'energy_rise': rise,
        'push_out': push_out,
        'drift': float(moved.max()) if case.rests else None,
        'final_speed': float(np.linalg.norm(trajectory.velocities[-1], axis=1).max()),
    }


def failures(laws: dict[str, Any]) -> list[str]:
    """Names of the laws that are out of bounds; only 'finite' and 'inside' where it diverged."""
    whole = laws['diverged_at'] is None
    allowed = laws['deepest_allowed']
    kept = {
        'finite': laws['finite'],
        'inside': laws['inside'],
        'deepest': not whole or allowed is None or laws['deepest'] <= allowed,
        'energy_rise': not whole or laws['energy_rise'] <= ENERGY_RISE,
        'drift': not whole or laws['drift'] is None or laws['drift'] <= DRIFT,
    }
    return [name for name, is_kept in kept.items() if not is_kept]


def energy_rise(case: Case, trajectory: Trajectory) -> tuple[float, float]:
    """Sum of all rises of the energy, with rotation, and the energy of pushing spheres out.

    Both relative to the sum of m g r plus the initial kinetic energy. In a case that starts with
    overlaps, the potential energy gained in the first step counts as the second number only.
    """
    parts = energy(trajectory, case.scene)
    mass, radius = (case.scene.per_sphere(name, trajectory.count) for name in ('mass', 'radius'))
    scale = float(np.linalg.norm(case.scene.gravity)) * float(mass @ radius)
    scale += float(parts.kinetic[0] + parts.rotational[0])
    change = np.diff(parts.with_rotation)
    push_out = 0.0
    if case.overlaps:
        push_out = max(0.0, float(parts.potential[1] - parts.potential[0]))
        change[0] -= push_out
    return float(np.maximum(change, 0.0).sum()) / scale, push_out / scale


def measure_errors(
    case: Case, trajectory: Trajectory, references: Sequence[Trajectory]
) -> dict[str, dict[str, float | None]] | None:
    """Errors against the teacher, and the floor by its own substeps.

    Args:
        case: The case that was simulated.
        trajectory: Its trajectory.
        references: The teacher's trajectory, then those at other substeps; may be shorter.

    Returns:
        By step: `error` and `floor`, mean distances over the spheres [m], and their `ratio`, see
        `chaos_floor`. None where the teacher is unstable, so that there is no reference.
    """
    if not all(_is_sound(case, reference) for reference in references):
        return None
    truth, *others = references
    least = least_floor('position_error', case.scene.radius)
    errors = {}
    for step in (step for step in HORIZONS if step <= min(trajectory.steps, truth.steps)):
        error = _distance(trajectory, truth, step)
        floor = max(_distance(other, truth, step) for other in others)
        ratio = over_floor(error, floor, least)
        errors[str(step)] = {'error': error, 'floor': floor, 'ratio': ratio}
    return errors


def _distance(one: Trajectory, other: Trajectory, step: int) -> float:
    with np.errstate(over='ignore', invalid='ignore'):
        distance = np.linalg.norm(one.positions[step] - other.positions[step], axis=1).mean()
    return float(distance) if np.isfinite(distance) else float('inf')


def _is_sound(case: Case, reference: Trajectory) -> bool:
    laws = measure_laws(replace(case, steps=reference.steps), reference)
    return bool(laws['finite'] and laws['inside'] and laws['energy_rise'] <= TEACHER_ENERGY_RISE)


def _from_poses(trajectory: Trajectory) -> Trajectory:
    """Trajectory with velocities by backward differences, except for those of the start."""
    made = Trajectory.from_poses(trajectory.positions, trajectory.quaternions, trajectory.dt)
    made.velocities[0] = trajectory.velocities[0]
    made.angular_velocities[0] = trajectory.angular_velocities[0]
    return made


def _escaped(case: Case, positions: Array) -> int:
    """Number of spheres whose centre went through a surface, or is behind an enclosing one."""
    radius = case.scene.per_sphere('radius', positions.shape[1])
    out = passed_through(positions, case.scene.surfaces)
    for plane in case.enclosing:
        beyond = (positions - plane.point) @ np.asarray(plane.normal) < -_BELOW * radius
        # a sphere that starts behind it must come inside and stay there
        came_in = np.logical_or.accumulate(~beyond, axis=0)
        out |= (beyond & came_in).any(axis=0) | beyond[-1]
    return int(out.sum())


def _depth(scene: Scene, positions: Array, radius: Array) -> float:
    """Deepest penetration of spheres into each other and into surfaces [diameters]."""
    return max(
        sphere_penetration(positions, radius).deepest,
        surface_penetration(positions, radius, scene.surfaces).deepest,
    )
