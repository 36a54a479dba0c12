# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scaling of the time per step with the number of spheres."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import time
from typing import Any

import numpy as np

from .scenes import lattice
from ...rollout.simulator import Simulator
from ...scenes.plane import Plane
from ...scenes.scene import Scene
from ...scenes.state import State

COUNTS = (1, 10, 100, 1000, 3000, 10_000, 30_000, 100_000)
QUICK_COUNTS = (1, 10, 40)
FITTED_FROM = 1000
"""Least number of spheres for the fit of the exponent; below, fixed costs dominate."""
AREA = 20.0
"""Ground area per sphere [m^2], nearly that of box_154."""
STEPS, SKIPPED = 20, 5
"""Timed steps of a repeat, and steps before them, until the first spheres land."""


def bouncing_box(spheres: int) -> tuple[Scene, State]:
    """Spheres of radius 1 m that fall from 1.5 to 6 m into a box with `AREA` for each."""
    side = float(np.sqrt(AREA * spheres))
    columns = int(np.ceil(np.sqrt(spheres)))
    pitch = side / columns
    places = lattice((columns, columns), spheres, pitch, 0.0, 0.5)
    places[:, 2] = 1.5 + 4.5 * np.random.default_rng(spheres).random(spheres)
    scene = Scene(
        surfaces=Plane.box(side, side), restitution=0.7746, friction=0.5, rolling_friction=0.03
    )
    return scene, State(positions=places)


def measure_scaling(
    simulator: Simulator,
    counts: Sequence[int],
    repeats: int,
    on_run: Callable[[int], None] | None = None,
) -> dict[str, Any]:
    """Seconds per step for each number of spheres, with all numbers in turn in each repeat.

    Args:
        simulator: Model to time.
        counts: Numbers of spheres.
        repeats: Number of repeats.
        on_run: Called with the number of spheres after each run.

    Returns:
        `rows` with `spheres`, `seconds_per_step` (`median`, `p10`, `p90` over repeats [s]) and
        `steps_per_second`; `exponent`, see `fitted_exponent`; `area_per_sphere` [m^2].
    """
    seconds: dict[int, list[float]] = {count: [] for count in counts}
    for _ in range(repeats):
        for count in counts:
            scene, start = bouncing_box(count)
            rollout = simulator.start(scene, start.positions)
            for step in range(SKIPPED + STEPS):
                if step == SKIPPED:
                    begin = time.perf_counter()
                rollout.step()
            seconds[count].append((time.perf_counter() - begin) / STEPS)
            if on_run is not None:
                on_run(count)
    rows: list[dict[str, Any]] = []
    for count, values in seconds.items():
        low, middle, high = np.percentile(values, [10, 50, 90]).tolist()
        row = {'spheres': count, 'seconds_per_step': {'median': middle, 'p10': low, 'p90': high}}
        rows.append(row | {'steps_per_second': 1.0 / middle})
    large = [(r['spheres'], r['seconds_per_step']['median']) for r in rows]
    return {
        'rows': rows,
        'exponent': fitted_exponent(large),
        'fitted_from': FITTED_FROM,
        'area_per_sphere': AREA,
        'steps': STEPS,
        'skipped': SKIPPED,
        'repeats': repeats,
    }


def fitted_exponent(pairs: Sequence[tuple[int, float]]) -> float | None:
    """Exponent p of seconds = c spheres^p, by least squares of the logarithms.

    Args:
        pairs: Numbers of spheres, and seconds; pairs below `FITTED_FROM` spheres are left out.

    Returns:
        The exponent; None from fewer than two pairs.
    """
    kept = [(spheres, seconds) for spheres, seconds in pairs if spheres >= FITTED_FROM]
    if len(kept) < 2:
        return None
    logs = np.log(np.array(kept))
    return float(np.polyfit(logs[:, 0], logs[:, 1], 1)[0])
