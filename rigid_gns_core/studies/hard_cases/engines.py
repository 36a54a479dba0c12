# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulators that run the hard cases, and the runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TYPE_CHECKING
import warnings

import numpy as np

from .case import Case
from .checks import failures, HORIZONS, measure_errors, measure_laws
from ..chaos_floor import References
from ...errors import UserError
from ...scenes.scene import Scene
from ...scenes.state import State, Trajectory
from ...scoring.evaluate import Velocities
from ...teacher.bullet import simulate as bullet
from ...teacher.settings import TeacherSettings

if TYPE_CHECKING:
    from ...rollout.simulator import Simulator

TEACHER = 'teacher'
"""Name of the teacher itself for `--model`."""


@dataclass(frozen=True)
class Engine:
    """A simulator for the hard cases.

    Args:
        name: Name in the table.
        simulate: (scene, start, steps) -> trajectory; raises UserError where it does not support
            the scene, FloatingPointError where it diverged.
        velocities: Kind of its velocities, see `measure_laws`.
    """

    name: str
    simulate: Callable[[Scene, State, int], Trajectory]
    velocities: Velocities = 'poses'


def simulator_engine(
    simulator: Simulator, name: str, velocities: Velocities | None = None
) -> Engine:
    """Engine of a simulator; `velocities` None: the simulator's own kind, or 'poses'."""

    def simulate(scene: Scene, start: State, steps: int) -> Trajectory:
        given = (scene, start.positions, start.velocities, start.angular_velocities)
        simulator.start(*given, quaternions=start.quaternions)  # a UserError here is a refusal
        try:
            return simulator.rollout(*given, steps=steps, quaternions=start.quaternions)
        except UserError as error:  # and later on a failure
            raise FloatingPointError(str(error)) from error

    says: Velocities = 'given' if getattr(simulator, 'velocities', 'poses') == 'given' else 'poses'
    return Engine(name, simulate, velocities or says)


def teacher_engine(settings: TeacherSettings) -> Engine:
    """Engine of the teacher, at the time step of the models."""

    def simulate(scene: Scene, start: State, steps: int) -> Trajectory:
        gravity = float(np.linalg.norm(scene.gravity))
        dt = 0.1 * np.sqrt(float(np.max(scene.radius)) * 9.81 / gravity)
        return bullet(scene, start, steps, float(dt), settings)

    return Engine(TEACHER, simulate, 'given')


def load_engine(name: str, velocities: Velocities | None, settings: TeacherSettings) -> Engine:
    """Engine of a model by name or path, or of the teacher; see `simulator_engine`."""
    if name == TEACHER:
        return teacher_engine(settings)
    from ...prediction.load import load_simulator

    return simulator_engine(load_simulator(name), name, velocities)


def run_cases(
    engines: Sequence[Engine], cases: Sequence[Case], references: References | None = None
) -> Iterator[dict[str, Any]]:
    """Run all engines on all cases, case by case.

    Yields:
        A row for each: `case`, `model`, `verdict` (ok, FAILED or refused), `failed` (names of
        laws), `refused` (the reason, or None), `warnings`, `dt` [s], `velocities`, `laws` (see
        `measure_laws`), `errors` (see `measure_errors`), `teacher` (False: unstable; None: not
        run).
    """
    for case in cases:
        for engine in engines:
            yield _row(case, engine, references)


def _row(case: Case, engine: Engine, references: References | None) -> dict[str, Any]:
    row = _empty(case, engine.name)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter('always')
        try:
            trajectory = engine.simulate(case.scene, case.start, case.steps)
        except UserError as error:
            return row | {'refused': str(error)}
        except FloatingPointError as error:
            warnings.warn(f'the rollout diverged: {error}', stacklevel=1)
            trajectory = _lost(case)
    texts = list(dict.fromkeys(str(warning.message) for warning in caught))
    laws = measure_laws(case, trajectory, velocities=engine.velocities)
    laws['finite'] &= not any('diverged' in text for text in texts)
    failed = failures(laws)
    row |= {
        'verdict': 'FAILED' if failed else 'ok',
        'failed': failed,
        'warnings': texts,
        'dt': trajectory.dt,
        'velocities': engine.velocities,
        'laws': laws,
    }
    if references is not None:
        steps = min(case.steps, max(HORIZONS))
        runs = references.of(case.name, case.scene, case.start, steps, trajectory.dt)
        row['errors'] = None if runs is None else measure_errors(case, trajectory, runs)
        row['teacher'] = row['errors'] is not None
    return row


def _empty(case: Case, model: str) -> dict[str, Any]:
    names = ('refused', 'dt', 'velocities', 'laws', 'errors', 'teacher')
    row: dict[str, Any] = {'case': case.name, 'model': model, 'verdict': 'refused', 'failed': []}
    return row | {'warnings': []} | dict.fromkeys(names)


def _lost(case: Case) -> Trajectory:
    """Trajectory of the start alone, NaN after it."""
    shapes = {'positions': 3, 'quaternions': 4, 'velocities': 3, 'angular_velocities': 3}
    arrays = {n: np.full((case.steps + 1, len(case.start), k), np.nan) for n, k in shapes.items()}
    for name, array in arrays.items():
        array[0] = getattr(case.start, name)
    return Trajectory(dt=1.0, **arrays)
