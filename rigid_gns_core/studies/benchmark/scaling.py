# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""How the time of a step grows with the number of spheres."""

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
"""Spheres from which on the exponent is fitted; below, what each step costs anyway counts."""
AREA = 20.0
"""Ground for each sphere [m^2], nearly that of the box of 154."""
STEPS, SKIPPED = 20, 5
"""Timed steps of a repeat, and those before, in which the first spheres come down."""


def bouncing_box(spheres: int) -> tuple[Scene, State]:
    """Spheres of 1 m that fall from 1.5 to 6 m into a box whose floor grows with their number."""
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
    """Seconds per step for each number of spheres; in each repeat all numbers in turn.

    Returns:
        `rows` with `spheres`, `seconds_per_step` (`median`, `p10`, `p90` over repeats [s]) and
        `steps_per_second`; `exponent` fitted from `FITTED_FROM` spheres on, None with less than
        two such rows; `area_per_sphere` [m^2].
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


def fitted_exponent(pairs: Sequence[tuple[int, float]], least: int = FITTED_FROM) -> float | None:
    """Fit the power of seconds = c spheres^power, by least squares in logarithms.

    Args:
        pairs: Spheres and seconds.
        least: Pairs of fewer spheres do not count.

    Returns:
        None where less than two pairs are left.
    """
    kept = [(spheres, seconds) for spheres, seconds in pairs if spheres >= least]
    if len(kept) < 2:
        return None
    logs = np.log(np.array(kept))
    return float(np.polyfit(logs[:, 0], logs[:, 1], 1)[0])
