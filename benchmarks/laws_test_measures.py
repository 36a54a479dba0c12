# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Measures of a rollout against its reference, and the floor: Bullet against itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
import sys
from typing import Any

import numpy as np
from rigid_gns_core.data.records import Record
from rigid_gns_core.engine.stepper import EngineStepper
from rigid_gns_core.rollout.rollout import Rollout
from rigid_gns_core.rollout.simulator import Simulator
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.scenes.similarity import Similarity
from rigid_gns_core.scenes.state import State, Trajectory
from rigid_gns_core.scoring import sphere_penetration, surface_penetration
from rigid_gns_core.scoring.evaluate import evaluate
from rigid_gns_core.studies.chaos_floor import least_floor, over_floor, worst
from rigid_gns_core.studies.hard_cases.case import Case
from rigid_gns_core.studies.hard_cases.checks import measure_laws

REST = 0.01  # m/s: below it a sphere has come to rest
SQUARED = ('mse', 'chamfer')
# key: name in the table; those of `errors` also have a floor and a ratio to it
ERRORS = {
    'mse': 'MSE [m²]',
    'chamfer': 'Chamfer [m²]',
    'predictability_time': 'predictability time [s]',
    'resting_drift': 'drift of spheres at rest [m]',
    'rest_speed_max': 'of spheres that Bullet stops, the fastest at the end [m/s]',
    'rest_share': 'of those, slower than 1 cm/s at the end [%]',
}
LAWS = {
    'energy_gain_with_rotation': 'energy gain',
    'depth_sphere': 'mean depth in spheres [diameters]',
    'depth_ground': 'mean depth in the ground [diameters]',
    'depth_static': 'mean depth in other surfaces [diameters]',
    'deepest_sphere': 'deepest in a sphere [diameters]',
    'deepest_surface': 'deepest in a surface [diameters]',
    'passed_through': 'went through a surface [%]',
    'escaped': 'spheres out of the box',
    'final_speed': 'speed at the end [m/s]',
    'diverged': 'diverged [share of rollouts]',
    'guard_acted': 'islands that the guard slowed, per step',
    'guard_removed': 'energy that the guard took, of that at the start',
}


def roll(simulator: Simulator, record: Record, steps: int) -> tuple[Trajectory, Rollout]:
    """Trajectory from the record's start, NaN after a divergence, and its rollout."""
    rollout = simulator.start(record.scene, **vars(record.trajectory[0]))
    states: list[State] = [rollout.state]
    try:
        while len(states) <= steps:
            states.append(rollout.step())
    except FloatingPointError as error:
        print(f'{record.name} {record.index}: {error}', file=sys.stderr)
    made = Trajectory.from_states(states, rollout.dt)
    lost = ((0, steps + 1 - len(made)), (0, 0), (0, 0))
    arrays = {
        name: np.pad(getattr(made, name), lost, constant_values=np.nan) for name in vars(states[0])
    }
    return replace(made, **arrays), rollout


def errors_of(predicted: Trajectory, reference: Trajectory, report: Mapping[str, Any]) -> dict:
    """Errors that have a floor: of a report, and of spheres that rest in the reference."""
    values = {key: report['errors'].get(key) for key in ERRORS}
    stopped = np.linalg.norm(reference.velocities[-1], axis=1) < REST
    if stopped.any():
        speed = np.linalg.norm(predicted.velocities[-1, stopped], axis=1)
        speed = np.where(np.isfinite(speed), speed, np.inf)
        values['rest_speed_max'] = float(speed.max())
        values['rest_share'] = 100.0 * float(np.mean(speed < REST))
    for step, horizon in report['horizons'].items():
        for key in ('position_error', 'mse'):
            values[f'{key}_{step}'] = horizon[key]
    return values


def floor_of(reference: Record, others: Sequence[Record]) -> dict[str, float | None]:
    """Worst errors of Bullet at other substeps, and the laws of the reference."""
    errors: list[dict] = []
    laws: dict[str, float | None] = {}
    start = reference.trajectory.positions[0]
    for other in others:
        again = other.trajectory.window(0, len(reference.trajectory))
        there = again.positions[0]
        if there.shape != start.shape or np.abs(there - start).max() > 1e-6:
            raise SystemExit(f'{reference.name} {reference.index}: its floor has another start')
        report = evaluate(again, reference.trajectory, reference.scene)
        errors.append(errors_of(again, reference.trajectory, report))
        laws = report['laws']['reference']
    return {key: laws[key] for key in LAWS if key in laws} | worst(errors)


def measure(
    simulator: Simulator, record: Record, floor: Mapping[str, float | None]
) -> dict[str, float | None]:
    """All measures of a model on a record, by name."""
    reference, scene = record.trajectory, record.scene
    predicted, rollout = roll(simulator, record, reference.steps)
    report = evaluate(predicted, reference, scene, velocities=simulator.velocities)
    values: dict[str, float | None] = errors_of(predicted, reference, report)
    radius = scene.per_sphere('radius', reference.count)
    for key, error in list(values.items()):
        ratio = over_floor(error, floor.get(key), least_floor(key, radius))
        if ratio is not None:
            values[f'{key}_ratio'] = ratio
    values |= {key: value for key, value in report['laws']['predicted'].items() if key in LAWS}
    lost = report['diverged_at']['predicted']
    whole = predicted.positions[:lost]
    values['deepest_sphere'] = sphere_penetration(whole, radius).deepest
    deepest = [
        # a ground has no other side
        surface_penetration(whole, radius, (plane,), limit=np.inf if i == scene.ground else 1.0)
        for i, plane in enumerate(scene.surfaces)
    ]
    values['deepest_surface'] = max((one.deepest for one in deepest), default=0.0)
    start = reference[0]
    case = Case(record.name, '', scene, start, reference.steps)
    values['escaped'] = measure_laws(case, predicted, velocities=simulator.velocities)['escaped']
    values['diverged'] = float(lost is not None)
    if isinstance(rollout.stepper, EngineStepper) and rollout.stepper.guards:
        # the guard counts in the model's units
        similarity = Similarity.between(scene, simulator.units)
        values |= guard_shares(
            rollout.stepper, similarity.scene(scene), similarity.to_model(start)
        )
    return values


def guard_shares(stepper: EngineStepper, scene: Scene, start: State) -> dict[str, float | None]:
    """Rate at which the guard acted per step, and the share of energy that it removed."""
    ground = scene.surfaces[scene.ground].point if scene.ground is not None else (0.0, 0.0, 0.0)
    mass, radius = (scene.per_sphere(name, len(start)) for name in ('mass', 'radius'))
    spin = 0.4 * radius**2 * np.sum(start.angular_velocities**2, axis=1)
    kinetic = 0.5 * mass * (np.sum(start.velocities**2, axis=1) + spin)
    height = -mass * ((start.positions - np.asarray(ground)) @ np.asarray(scene.gravity))
    total = float(np.sum(kinetic + height))
    return {
        'guard_acted': stepper.acted / max(1, stepper.frames),
        'guard_removed': stepper.removed / total if total > 0 else None,
    }
