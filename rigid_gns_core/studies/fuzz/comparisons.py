# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories that must be the same: of a changed scene, and with more substeps.

Differences are in units of the largest radius L and of T = 10 frames, those of the laws. How long
two trajectories can be compared is measured: see docs/fuzzing.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .changes import changes_of, nudged
from .failure import Failure
from .scenes import Case
from ...scenes.scene import Scene
from ...scenes.state import Array, State, Trajectory

Simulate = Callable[[Scene, State, int], Trajectory]

NUDGE = 1e-9
"""How far starts are moved to measure chaos [L, L / T, 1 / T]."""
CHAOS = 1e-6
"""Trajectories are compared until a moved start is so far from the case."""
MARGIN = 100.0
"""A difference counts above so many times that of the moved starts."""
SOLVED = 1e-5
"""Difference that a solver may make which ends an iteration sooner for another rounding."""
CONVERGED = 1e-3
"""Substeps are compared until many and twice as many differ by so much in a position [L]."""
SUBSTEP_ERROR = 0.02
"""Position error of the default's substeps that counts as none [L]."""
ORDER = 30.0
"""An error counts above so many times the difference of many and twice as many substeps:
an engine of first order has 7 times it, one of second order 21."""


FAST = 2.0
"""Substeps are compared while none of several spheres moves farther in a frame [L]: faster ones
may have impacts in one substep whose order only more substeps tell."""
NUDGES = 3
"""Number of moved starts."""


class Engines(NamedTuple):
    """Simulate with the default's substeps, with many, and with twice as many."""

    default: Simulate
    many: Simulate
    most: Simulate


def chaos_of(case: Case, path: Trajectory, simulate: Simulate) -> Array:
    """Largest difference from moved starts up to each frame, shape (steps + 1,)."""
    chaos = np.full(case.steps + 1, NUDGE)
    for start in nudged(case, NUDGE, NUDGES):
        chaos = np.maximum(chaos, difference(path, simulate(case.scene, start, case.steps), case))
    return np.asarray(np.maximum.accumulate(chaos))


def other_motion(
    case: Case, path: Trajectory, chaos: Array, simulate: Simulate
) -> Iterator[Failure]:
    """Changes of the scene after which it moves differently."""
    bound = np.maximum(SOLVED, MARGIN * chaos)
    for change in changes_of(case):
        other = change.back(simulate(change.scene, change.start, case.steps))
        yield from _differs(change.name, difference(path, other, case), bound, chaos <= CHAOS)


def not_converged(
    case: Case, path: Trajectory, chaos: Array, engines: Engines
) -> Iterator[Failure]:
    """Whether positions are others with many substeps, which agree among themselves."""
    many, most = (engine(case.scene, case.start, case.steps) for engine in engines[1:])
    spread = np.maximum.accumulate(difference(many, most, case, positions=True))
    judged = (chaos <= CHAOS) & (spread <= CONVERGED)
    if len(case.start) > 1:
        way = np.linalg.norm(most.velocities, axis=2).max(axis=1) * most.dt
        judged &= np.maximum.accumulate(way) <= FAST * np.max(case.scene.radius)
    error = difference(path, most, case, positions=True)
    yield from _differs('substeps', error, SUBSTEP_ERROR + ORDER * spread, judged)


def _differs(name: str, size: Array, bound: Array, judged: NDArray[np.bool_]) -> Iterator[Failure]:
    over = np.flatnonzero((size > bound) & judged)
    if len(over):
        worst = over[np.argmax(size[over])]
        text = f'from frame {over[0]}, of {np.count_nonzero(judged) - 1} compared'
        yield Failure(name, float(size[worst]), float(bound[worst]), text)


def difference(
    one: Trajectory, other: Trajectory, case: Case, *, positions: bool = False
) -> Array:
    """Largest difference of a sphere in each frame [L, L / T, 1 / T], shape (steps + 1,).

    Of positions, velocities and spins, or of positions alone: these are continuous, where another
    rounding of the time of a bounce makes no difference.
    """
    length, time = float(np.max(case.scene.radius)), 10.0 * one.dt
    units = {'positions': 1.0 / length}
    if not positions:
        units |= {'velocities': time / length, 'angular_velocities': time}
    apart = [
        unit * np.linalg.norm(getattr(one, name) - getattr(other, name), axis=2).max(axis=1)
        for name, unit in units.items()
    ]
    largest: Array = np.max(apart, axis=0)
    return np.where(np.isfinite(largest), largest, np.inf)
