# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forecasts: predicted poses at any time after a start frame, interpolated between model steps."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
import time
from types import MappingProxyType
from typing import Any, TYPE_CHECKING
import warnings

import numpy as np

from .interpolation import between
from .moving_surfaces import with_surfaces
from ..errors import UserError
from ..scenes.plane import Plane, RANGES
from ..scenes.scene import Scene
from ..scenes.state import Array, State

if TYPE_CHECKING:
    from ..rollout.rollout import Rollout

MEMORY = 1.0  # how far back a forecast keeps its predictions [s]


@dataclass(frozen=True)
class Prediction:
    """Poses predicted for one time.

    Args:
        stamp_ns: Time that is predicted [ns].
        poses: Position [m] and quaternion (x, y, z, w) of each sphere, shape (n, 7).
        step_times: Wall-clock time of each model step that it took [s].
    """

    stamp_ns: int
    poses: Array
    step_times: tuple[float, ...]


class Forecast:
    """Predictions from one start frame, for later times in rising order.

    Args:
        rollout: The model's rollout from the start frame.
        start_ns: Stamp of the start frame [ns].
    """

    def __init__(self, rollout: Rollout, start_ns: int) -> None:
        self.rollout, self.start_ns = rollout, start_ns
        self._before = self._after = rollout.state
        self._past = deque([rollout.state], maxlen=int(np.ceil(MEMORY / rollout.dt)) + 2)

    def advance_to(self, stamp_ns: int) -> Prediction:
        """Prediction for a time, after as many model steps as it needs.

        Between two steps, positions are interpolated linearly and rotations along the shorter arc.

        Args:
            stamp_ns: Time to predict [ns], after the start frame and all earlier predictions.

        Raises:
            UserError: The rollout diverged: a pose is not finite.
            FloatingPointError: The rollout itself found that it diverged.
        """
        place = self._place(stamp_ns)
        step_times = []
        while self.rollout.steps < place:
            begun = time.perf_counter()
            self._before, self._after = self._after, self.rollout.step()
            self._past.append(self._after)
            step_times.append(time.perf_counter() - begun)
        weight = place - (self.rollout.steps - 1)
        poses = _poses(self._after)
        if weight < 1:
            poses = between(_poses(self._before), poses, weight)
        if not np.isfinite(poses).all():
            sphere = int(np.argmin(np.isfinite(poses).all(axis=1)))
            raise UserError(f'the predicted pose of sphere {sphere} is not finite')
        return Prediction(stamp_ns, poses, tuple(step_times))

    def recall(self, stamp_ns: int) -> Array | None:
        """Predicted centres at a past time [m], shape (n, 3), linear between two model steps.

        None for a time that is not reached yet or lies more than about `MEMORY` back.
        """
        index = self._place(stamp_ns) - (self.rollout.steps - len(self._past) + 1)
        if not 0 <= index <= len(self._past) - 1:
            return None
        low = int(index)
        weight = index - low
        before = self._past[low].positions
        if not weight:
            return before
        return (1 - weight) * before + weight * self._past[low + 1].positions

    def _place(self, stamp_ns: int) -> float:
        """Number of model steps from the start to a time, not rounded."""
        place = (stamp_ns - self.start_ns) * 1e-9 / self.rollout.dt
        nearest = round(place)
        # stamps are whole nanoseconds: one that is a nanosecond off is on the step
        return float(nearest) if abs(place - nearest) * self.rollout.dt <= 1e-9 else place


class Forecaster:
    """Forecasts of a model in a scene, from start states.

    Args:
        model: Name or path of the model; empty: the shipped default.
        scene: Surfaces and spheres.
        scene_name: Name of the scene, for messages.
        rate: Predictions per second [Hz]; 0: one per step of the model.
        threads: CPU threads of the model.

    Raises:
        UserError: There is no such model, or it cannot serve the scene.
    """

    def __init__(
        self,
        model: str,
        scene: Scene,
        *,
        scene_name: str = 'at hand',
        rate: float = 0.0,
        threads: int = 1,
    ) -> None:
        self.scene, self.scene_name = scene, scene_name
        # imported late, so that a node's signal handlers are in place while this loads and
        # compiles
        from ..prediction.load import load_simulator

        self.simulator = load_simulator(model or None, threads=threads)
        self.native_dt = self.simulator.native_dt(self.scene)
        self.period = 1 / rate if rate else self.native_dt
        # the first step in a process is slow: take it now
        count = self.scene.sphere_count or 2
        surfaces = self.scene.surfaces
        ground = np.array(surfaces[0].point if surfaces else (0.0, 0.0, 0.0))
        # of the scene and number of spheres of the last forecast
        self._starter: tuple[Scene, int, Callable[[State], Rollout]] | None = None
        self.radius = float(self.scene.per_sphere('radius', count).max())
        heights = self.radius * np.arange(1, 2 * count, 2)
        state = State(positions=ground + heights[:, None] * self.scene.up)
        self.forecast(state, 0).rollout.step()

    @property
    def description(self) -> dict[str, Any]:
        """Scene, model and time steps [s], ready for JSON."""
        return {
            'scene': self.scene.to_mapping(),
            'model': self.simulator.name,
            'model_card': self.simulator.card,
            'dt': self.native_dt,
            'period': self.period,
        }

    def __str__(self) -> str:
        native = abs(self.period / self.native_dt - 1) < 1e-9
        gravity = ', '.join(f'{value:.4g}' for value in self.scene.gravity)
        how = '' if native else ', interpolated between model steps'
        return (
            f'model {self.simulator.name}, scene {self.scene_name} '
            f'({len(self.scene.surfaces)} surfaces, gravity ({gravity}) m/s^2), '
            f'native rate {1 / self.native_dt:.6g} Hz, publishing at {1 / self.period:.6g} Hz{how}'
        )

    @property
    def level(self) -> bool:
        """Whether spheres can rest on a surface, or there are no surfaces."""
        return not self.scene.surfaces or self.scene.ground is not None

    def check(self, count: int) -> list[str]:
        """Warnings about predicting `count` spheres.

        Raises:
            UserError: The model or the scene does not support this number.
        """
        if self.scene.sphere_count not in (None, count):
            raise UserError(
                f'scene {self.scene_name} gives properties of {self.scene.sphere_count} spheres, '
                f'but there are {count}'
            )
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter('always')
            self.simulator.check(self.scene, count)
        return sorted({str(warning.message) for warning in caught})

    def take_scene(self, scene: Scene) -> None:
        """Go on in another scene of spheres of the same size; the period stays."""
        self.scene = scene

    def scene_at(self, ids: Sequence[int] | None, surfaces: Mapping[int, Plane]) -> Scene:
        """Scene of these spheres, with surfaces that bodies carry; see `forecast`."""
        scene = self.scene if ids is None else scene_of(self.scene, ids)
        return with_surfaces(scene, surfaces)

    def forecast(
        self,
        state: State,
        start_ns: int,
        ids: Sequence[int] | None = None,
        surfaces: Mapping[int, Plane] = MappingProxyType({}),
    ) -> Forecast:
        """Forecast from a start state.

        Args:
            state: Start state.
            start_ns: Its stamp [ns].
            ids: Ids of its spheres, by which properties per sphere are looked up; None: 0, 1, ...
            surfaces: Surfaces that bodies carry, then, by index among all.
        """
        scene, count, known = self.scene_at(ids, surfaces), len(state), self._starter
        if known is None or known[0] is not scene or known[1] != count:
            with warnings.catch_warnings():
                warnings.simplefilter('ignore')  # `check` reports them
                known = self._starter = scene, count, self.simulator.starter(scene, count)
        return Forecast(known[2](state), start_ns)


def scene_of(scene: Scene, ids: Sequence[int]) -> Scene:
    """The scene with its properties per sphere, if any, selected by these ids.

    Raises:
        UserError: The scene lacks the properties of an id.
    """
    known = scene.sphere_count
    if known is None or tuple(ids) == tuple(range(known)):
        return scene
    if missing := [sphere for sphere in ids if sphere >= known]:
        raise UserError(
            f'sphere {missing[0]} has no properties: the scene gives those of {known} spheres; '
            'give one number for all, where spheres appear and vanish'
        )
    own: dict[str, Any] = {
        name: tuple(value[sphere] for sphere in ids)
        for name in RANGES
        if isinstance(value := getattr(scene, name), tuple)
    }
    return replace(scene, **own)


def with_gravity_along(scene: Scene, direction: Sequence[float]) -> Scene:
    """The scene with gravity of the same magnitude along `direction`; (0, 0, 0): unchanged.

    Surfaces are unchanged: like the spheres, they are given in the tracker's frame.

    Raises:
        UserError: The scene has no gravity.
    """
    towards = np.asarray(direction, dtype=np.float64)
    length = float(np.linalg.norm(towards))
    if not length:
        return scene
    size = float(np.linalg.norm(scene.gravity))
    if not size:
        raise UserError(
            f'gravity_direction is {towards.tolist()}, but the scene has no gravity; '
            'give the scene a gravity, or leave gravity_direction at [0.0, 0.0, 0.0]'
        )
    x, y, z = (size / length * towards).tolist()
    return replace(scene, gravity=(x, y, z))


def _poses(state: State) -> Array:
    return np.concatenate([state.positions, state.quaternions], axis=1)
