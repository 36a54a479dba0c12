# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""CSV tracks of balls that fly and bounce in closed form, as a tracker of positions sends them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

RADIUS, GRAVITY, RESTITUTION = 0.02, 9.81, 0.9
RATE = 180.0
HEADER = 'track,sphere,time,x,y,z'
SCENE = """scene:
  surfaces: [{point: [0, 0, 0], normal: [0, 0, 1], restitution: 0.9, friction: 0.0}]
  radius: 0.02
  mass: 0.0027
  restitution: 1.0
  friction: 0.0
  rolling_friction: 0.0
"""

Row = tuple[object, ...]


def bounces(times: np.ndarray, start: Sequence[float], velocity: Sequence[float]) -> np.ndarray:
    """Centres at times [s] of a ball that bounces without friction on z = 0, shape (m, 3)."""
    found = []
    for time in times:
        height, speed, left = start[2] - RADIUS, velocity[2], float(time)
        while True:
            fall = (speed + np.sqrt(speed**2 + 2 * GRAVITY * height)) / GRAVITY
            if left <= fall:
                break
            left -= fall
            height, speed = 0.0, RESTITUTION * (GRAVITY * fall - speed)
        z = RADIUS + height + speed * left - 0.5 * GRAVITY * left**2
        found.append([start[0] + velocity[0] * time, start[1] + velocity[1] * time, z])
    return np.array(found)


def shots(
    count: int = 4, duration: float = 1.0, noise: float = 0.0, seed: int = 0
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Times [s] and centres [m] of shots that differ in speed."""
    rng = np.random.default_rng(seed)
    times = np.arange(round(duration * RATE) + 1) / RATE
    found = []
    for _ in range(count):
        velocity = [rng.uniform(2.0, 4.0), rng.uniform(-0.5, 0.5), rng.uniform(0.5, 1.5)]
        centres = bounces(times, [0.0, 0.0, rng.uniform(0.3, 0.6)], velocity)
        found.append((times, centres + rng.normal(0.0, noise, centres.shape)))
    return found


def rows_of(tracks: Iterable[tuple[np.ndarray, np.ndarray]], sphere: object = 0) -> list[Row]:
    """Rows of tracks of one sphere each."""
    return [
        (number, sphere, f'{time:.7f}', *(f'{value:.7f}' for value in place))
        for number, (times, places) in enumerate(tracks)
        for time, place in zip(times.tolist(), places.tolist(), strict=True)
    ]


def write_csv(path: Path, rows: Iterable[Row], header: str = HEADER) -> Path:
    """Return the path of a file with these rows."""
    path.write_text('\n'.join([header, *(','.join(map(str, row)) for row in rows), '']))
    return path


def write_scene(folder: Path) -> Path:
    """Return the path of the scene of `bounces`."""
    path = folder / 'scene.yaml'
    path.write_text(SCENE)
    return path
