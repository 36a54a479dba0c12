# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is put to the hard cases, and how."""

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
"""Name by which `--model` takes the teacher itself."""


@dataclass(frozen=True)
class Engine:
    """What is put to the cases.

    Args:
        name: For the table.
        simulate: (scene, start, steps) -> trajectory; UserError: it refuses the scene;
            FloatingPointError: it broke on the way.
        velocities: 'given': those of its trajectories are instantaneous; see `measure_laws`.
    """

    name: str
    simulate: Callable[[Scene, State, int], Trajectory]
    velocities: Velocities = 'poses'


def simulator_engine(
    simulator: Simulator, name: str, velocities: Velocities | None = None
) -> Engine:
    """Return a simulator; `velocities` None: as it says itself, or else by poses."""

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
    """Return the teacher itself, at the time step that the learned simulators have."""

    def simulate(scene: Scene, start: State, steps: int) -> Trajectory:
        gravity = float(np.linalg.norm(scene.gravity))
        dt = 0.1 * np.sqrt(float(np.max(scene.radius)) * 9.81 / gravity)
        return bullet(scene, start, steps, float(dt), settings)

    return Engine(TEACHER, simulate, 'given')


def load_engine(name: str, velocities: Velocities | None, settings: TeacherSettings) -> Engine:
    """Return a model by name or path, or the teacher; `velocities` None: as it says itself."""
    if name == TEACHER:
        return teacher_engine(settings)
    from ...prediction.load import load_simulator

    return simulator_engine(load_simulator(name), name, velocities)


def run_cases(
    engines: Sequence[Engine], cases: Sequence[Case], references: References | None = None
) -> Iterator[dict[str, Any]]:
    """One row per case and engine, case by case.

    Yields:
        `case`, `model`, `verdict` (ok, FAILED or refused), `failed` (names of laws), `refused`
        (the reason or None), `warnings`, `dt` [s], `velocities`, `laws` (see `measure_laws`),
        `errors` (see `measure_errors`), `teacher` (False: it blew up; None: not asked).
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
    """Return the start, and nothing after it."""
    shapes = {'positions': 3, 'quaternions': 4, 'velocities': 3, 'angular_velocities': 3}
    arrays = {n: np.full((case.steps + 1, len(case.start), k), np.nan) for n, k in shapes.items()}
    for name, array in arrays.items():
        array[0] = getattr(case.start, name)
    return Trajectory(dt=1.0, **arrays)
