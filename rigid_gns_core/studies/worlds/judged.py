# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Errors of simulators on the test tracks of a world, from true states, and their speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
import math
import time
from typing import Any, NamedTuple
import warnings

import numpy as np

from .worlds import FRAME, MATERIALS, Observed, SAMPLES, WORLDS
from ...rollout.simulator import Simulator
from ...scenes.scene import Scene
from ...scenes.state import Trajectory

HORIZONS = (1, 3, 10, 30)
"""Frames after which errors are judged."""
# the world against itself: its start moved by so much [m] in each direction
_MOVED = 1e-3
# frames whose time is taken, in so many scenes
_TIMED, _SCENES = 50, 10

Errors = dict[str, float | None]
"""Mean position error over spheres [m] by time ahead [s]; None: a rollout diverged before."""


class Rival(NamedTuple):
    """A simulator, and the scene whose materials it is given."""

    simulator: Simulator
    scene: Scene


def errors_of(rival: Rival, test: Sequence[Observed], starts: int) -> Errors:
    """Errors of rollouts from true states, so many in each test trajectory."""
    found: dict[int, list[Any]] = {frames: [] for frames in HORIZONS}
    for one in test:
        own = _with_materials(one.scene, rival.scene)
        for sample in _starts(one, starts):
            with warnings.catch_warnings():
                warnings.simplefilter('ignore')  # of divergence, which the mean shows
                made = rival.simulator.rollout(own, steps=max(HORIZONS), **vars(one.truth[sample]))
            _compare(made, 1, one, sample, found)
    return _means(found)


def own_errors(
    world: str, test: Sequence[Observed], starts: int, seed: int
) -> tuple[Errors, float]:
    """As `errors_of`, of the world itself from starts moved by 1 mm; and its frames a second."""
    rng = np.random.default_rng([seed, 5])
    found: dict[int, list[Any]] = {frames: [] for frames in HORIZONS}
    spent = 0.0
    for one in test:
        for sample in _starts(one, starts):
            state = one.truth[sample]
            moved = replace(
                state, positions=state.positions + _MOVED * rng.standard_normal((len(state), 3))
            )
            begun = time.perf_counter()
            made = WORLDS[world](one.scene, moved, max(HORIZONS))
            spent += time.perf_counter() - begun
            _compare(made, SAMPLES, one, sample, found)
    return _means(found), len(test) * starts * max(HORIZONS) / spent


def speeds_of(rivals: Mapping[str, Rival], test: Sequence[Observed]) -> dict[str, float]:
    """Frames a second, one after the other in each scene."""
    spent = dict.fromkeys(rivals, 0.0)
    scenes = test[:_SCENES]
    for one in scenes:
        for name, rival in rivals.items():
            begun = time.perf_counter()
            own = _with_materials(one.scene, rival.scene)
            rival.simulator.rollout(own, steps=_TIMED, **vars(one.truth[0]))
            spent[name] += time.perf_counter() - begun
    return {name: _TIMED * len(scenes) / seconds for name, seconds in spent.items()}


def _with_materials(scene: Scene, other: Scene) -> Scene:
    return replace(scene, **{name: getattr(other, name) for name in MATERIALS})


def _starts(one: Observed, count: int) -> list[int]:
    last = len(one.truth) - 1 - max(HORIZONS) * SAMPLES
    return [int(sample) for sample in np.linspace(0, last, count)]


def _compare(
    made: Trajectory, samples: int, one: Observed, sample: int, found_out: dict[int, list[Any]]
) -> None:
    for frames, errors in found_out.items():
        truth = one.truth.positions[sample + frames * SAMPLES]
        errors.append(np.linalg.norm(made.positions[frames * samples] - truth, axis=1))


def _means(found: Mapping[int, Sequence[Any]]) -> Errors:
    means = {frames: float(np.mean(np.concatenate(errors))) for frames, errors in found.items()}
    return {
        f'{frames * FRAME:g}': mean if math.isfinite(mean) else None
        for frames, mean in means.items()
    }
