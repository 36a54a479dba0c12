# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Measures the cost in time and the gain in accuracy of a change to the model or a scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache, partial
import time
from typing import Any, cast

from ablation_starts import Start
from ablations import Change, USUAL
import numpy as np
from rigid_gns_core.data.records import Record
from rigid_gns_core.engine.stepper import EngineStepper
from rigid_gns_core.files.checkpoint import LAWS
from rigid_gns_core.prediction.load import load_simulator
from rigid_gns_core.rollout.rollout import Rollout
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.scenes.state import State
from rigid_gns_core.scoring import horizon_metrics

HORIZON = 30  # steps at which errors are taken


def advance(rollout: Rollout, steps: int) -> float:
    """Advance a rollout; the time that it took [ms]."""
    begin = time.perf_counter()
    for _ in range(steps):
        rollout.step()
    return 1e3 * (time.perf_counter() - begin)


class Bench:
    """Measures changes of the laws.

    Args:
        starts: Starts by name, see `make_starts`.
        records: Bullet's records for errors; empty: no errors.
        repeats: Number of turns of each side.
        block: Steps of a turn.
    """

    def __init__(
        self, starts: Mapping[str, Start], records: Sequence[Record], repeats: int, block: int
    ) -> None:
        self.starts, self.records = starts, records
        self.repeats, self.block = repeats, block
        self.load = cache(partial(load_simulator, LAWS))
        self.before = cache(self._before)
        self.bullet_error = cache(self._bullet_error)

    def measure(self, name: str, change: Change) -> dict[str, Any]:
        """Times, difference and errors of a change, from the start `name`."""
        sides = {'usual': USUAL, 'other': change}
        times = {key: np.zeros(self.repeats + 1) for key in sides}
        rollouts: dict[str, Rollout] = {}
        for turn in range(self.repeats + 1):
            # the sides alternate in being first
            for key in list(sides)[:: -1 if turn % 2 else 1]:
                if not (change.goes_on and turn):
                    rollouts[key] = self._ready(name, sides[key], change.goes_on)
                times[key][turn] = advance(rollouts[key], self.block) / self.block
        both = np.array(list(times.values()))[:, 1:]  # the first warms up
        result: dict[str, Any] = {
            'start': name,
            'spheres': len(self.starts[name].state),
            'usual': change.usual,
            'other': change.other,
            'ratio': float(np.median(both[1] / both[0])),
            'difference': self._difference(name, change),
        }
        for (key, side), spent in zip(sides.items(), both, strict=True):
            low, median, high = (float(q) for q in np.quantile(spent, [0.1, 0.5, 0.9]))
            result |= {f'{key}_ms': median, f'{key}_p10_ms': low, f'{key}_p90_ms': high}
            stepper = cast(EngineStepper, rollouts[key].stepper)
            result[f'{key}_asleep'] = float(stepper.sleepers.asleep.mean())
            if self.records and self.starts[name].bullet:
                result[f'{key}_error'] = self.bullet_error(side)
        return result

    def _begin(self, change: Change, scene: Scene, state: State) -> Rollout:
        simulator = self.load(**change.options)
        return simulator.start(change.scene(scene, len(state)), **vars(state))

    def _before(self, name: str) -> State:
        """State after the first steps from a start, by the unchanged model."""
        start = self.starts[name]
        rollout = self._begin(USUAL, start.scene, start.state)
        advance(rollout, start.skip)
        return rollout.state

    def _ready(self, name: str, change: Change, goes_on: bool) -> Rollout:
        """Rollout to be timed, after its first step, which has one-time costs."""
        start = self.starts[name]
        state, steps = (start.state, start.skip) if goes_on else (self.before(name), 1)
        rollout = self._begin(change, start.scene, state)
        advance(rollout, steps)
        return rollout

    def _difference(self, name: str, change: Change) -> float:
        """Mean distance between the two after 30 steps from the start [m]."""
        ends = []
        for side in (USUAL, change):
            rollout = self._begin(side, self.starts[name].scene, self.before(name))
            advance(rollout, HORIZON)
            ends.append(rollout.state.positions)
        return float(np.linalg.norm(ends[0] - ends[1], axis=1).mean())

    def _bullet_error(self, change: Change) -> float:
        """Mean distance to Bullet after 30 steps, over spheres and records [m]."""
        errors = []
        for record in self.records:
            start = record.trajectory[0]
            scene = change.scene(record.scene, len(start))
            predicted = self.load(**change.options).rollout(scene, steps=HORIZON, **vars(start))
            horizons = horizon_metrics(predicted, record.trajectory, record.scene, [HORIZON])
            errors.append(horizons[HORIZON]['position_error'])
        return float(np.mean(errors))
