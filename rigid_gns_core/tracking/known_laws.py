# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""States of balls by the laws of the scene, air and spins: each from its own last frames.

`estimate_state` and the node's starts are both of `state_by_laws`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from .ball_batch import estimate_balls
from .ball_contact import FREE
from .ball_estimate import BallEstimate, forecast_ball
from .ball_model import BallModel
from .ball_surfaces import KIND, MOVES
from .ball_window import FEWEST
from .jit import plain
from .motion_models import Motion
from .pair_blow import pair_rows
from .pose_noise import rotating
from .spin_windows import SpinWindows
from .start_correction import StartCorrection
from .start_prior import StartPrior
from .surface_rows import at_time
from ..scenes.plane import Plane
from ..scenes.scene import Scene
from ..scenes.state import Array, State
from ..scenes.tracker import Tracker

# of more balls the fastest are estimated by the laws, or none where a scene has neither air nor a
# learned tracker: all would take longer than a frame
MOST_BALLS = 8
# without air, fewer frames are fitted as well by the motions of the window, which know of blows
# between balls, and those that the laws meet worse by one of them: that of a ball that is held
_FEWEST, _WORST = 12, 1.5
# a doubted estimate is that of the laws unless its velocity is off that of the window by this, the
# square of deviations of the window: 1 in 1000 of true ones is
_APART = 16.3
# noise of a tracker of which nothing is known [m]
_NOISE, _LEAST_NOISE = 1e-3, 1e-6
# of a scene without a learned tracker, whose laws are taken as they stand: drift [m^2/s^3] and
# kicks for what is not linear; with 0 regions of 90 % held 85 to 90 %
_DRIFT, _IMPACT = 3e-5, 1e-3


def most_balls(scene: Scene) -> float:
    """Largest number of balls of a scene whose states are those of its laws.

    In air the fastest `MOST_BALLS` of any number are; without it slow ones lose as much as fast
    ones by a fit of fewer frames.
    """
    return np.inf if scene.air is not None or scene.tracker is not None else MOST_BALLS


@dataclass(frozen=True)
class KnownLaws:
    """Laws of the balls of a scene, for estimates.

    Args:
        models: Of each ball.
        pairs: Laws of two balls, see `pair_blow.PAIR`, shape (n, n, PAIR).
        windows: Prior of spins.
        tracker: Noise, drift and memory.
        learned: Whether the tracker was learned; if not, its noise is only a guess.
        correction: Of estimates in flight; None: none.
        fewest: Least number of frames of an estimate.
        worst: Loss per coordinate of an estimate that meets the frames.
    """

    models: tuple[BallModel, ...]
    pairs: Array
    windows: SpinWindows
    tracker: Tracker
    learned: bool
    correction: StartCorrection | None = None
    fewest: int = FEWEST
    worst: float = np.inf

    @classmethod
    def of(cls, scene: Scene, spheres: tuple[int, ...]) -> Self:
        """Laws of some spheres of a scene, by number; beyond those of the scene: of the last."""
        count = scene.sphere_count or 1  # 1: all are alike
        every = {i: BallModel.of(scene, i, count) for i in {min(s, count - 1) for s in spheres}}
        models = tuple(every[min(s, count - 1)] for s in spheres)
        tracker = scene.tracker or Tracker(noise=_NOISE, drift=_DRIFT, impact=_IMPACT)
        if tracker.spins is None:
            prior = StartPrior.of_any_spin(float(np.mean([model.radius for model in models])))
        else:
            prior = StartPrior.of(tracker.spins)
        own = None if tracker.correction is None else StartCorrection.of(tracker.correction)
        pairs = pair_rows(scene, [min(s, count - 1) for s in spheres], count)
        known = cls(models, pairs, prior.windows, tracker, scene.tracker is not None, own)
        if np.isinf(most_balls(scene)):
            return known
        return replace(known, fewest=_FEWEST, worst=_WORST)

    def among(self, scene: Scene, moving: tuple[Plane, ...], spheres: tuple[int, ...]) -> Self:
        """The same with planes that change place besides; the other arguments are as of `of`."""
        count = scene.sphere_count or 1
        models = tuple(
            model.among(scene, moving, min(sphere, count - 1), count)
            for model, sphere in zip(self.models, spheres, strict=True)
        )
        return replace(self, models=models)

    @cached_property
    def moves(self) -> bool:
        """Whether a plane changes place."""
        return bool((self.models[0].planes[:, KIND] == MOVES).any())

    @cached_property
    def arrays(self) -> tuple[Array, Array, Array]:
        """Balls, planes and laws as `estimate_balls` takes them."""
        first = self.models[0]
        balls = np.concatenate([model.ball for model in self.models])
        return plain(balls), first.planes, plain(np.array([model.laws for model in self.models]))

    def states(
        self,
        times: Array,
        positions: Array,
        seen: NDArray[np.bool_],
        most: int | None = None,
        noise: float | None = None,
    ) -> tuple[Array, Array, NDArray[np.bool_], NDArray[np.bool_]]:
        """State of each ball at the last of some frames; see `estimate_balls`.

        Args:
            times: Rising times of the frames [s], shape (m,).
            positions: Centres [m], shape (m, n, 3).
            seen: Whether a ball was seen, shape (m, n).
            most: Of more balls the fastest are estimated; None: all are.
            noise: Standard deviation of a coordinate [m], where none was learned; None: a guess.

        Returns:
            States, shape (n, 9), their covariances, shape (n, 9, 9), which were found, and which
            of these are doubted, as the laws do not quite meet the frames: of a ball with fewer
            than `fewest` frames, or that they miss by far, there is no estimate here.
        """
        count, tracker = len(self.models), self.tracker
        if noise is None or self.learned:
            noise = tracker.noise
        else:
            noise = max(noise, _LEAST_NOISE)
        states, covariances = np.zeros((count, 9)), np.zeros((count, 9, 9))
        ends = np.zeros((count, 3), dtype=np.int64)
        begin = int(np.searchsorted(times, times[-1] - tracker.memory - 1e-9))
        balls, planes, laws = self.arrays
        if self.moves:
            planes = at_time(planes, float(times[-1]))
        estimate_balls(
            balls,
            planes,
            laws,
            self.pairs,
            np.array([noise, tracker.drift, tracker.impact]),
            self.windows,
            plain(times),
            plain(positions),
            np.require(seen, np.bool_, ['C', 'W']),
            begin,
            self.fewest,
            self.worst,
            self.learned,
            count if most is None else most,
            states,
            covariances,
            ends,
        )
        found = ends[:, 0] >= 0
        if self.correction is not None:
            flying = np.flatnonzero(found & (ends[:, 1] == FREE))
            radii = balls[flying, 7]
            states[flying] = self.correction.corrected(states[flying], covariances[flying], radii)
        covariances *= tracker.spread
        for ball in np.flatnonzero(found & (ends[:, 0] < len(times) - 1)):
            last, on, _ = ends[ball]
            estimate = BallEstimate(states[ball], covariances[ball], int(on), 0.0, 0.0, 0)
            model, spell = replace(self.models[ball], planes=planes), (times[last], times[-1])
            states[ball], covariances[ball] = _coasted(model, estimate, tracker, *spell)
        return states, covariances, found, found & (ends[:, 2] == 0)


def state_by_laws(
    laws: KnownLaws,
    times: Array,
    positions: Array,
    quaternions: Array,
    seen: NDArray[np.bool_],
    otherwise: Callable[[], tuple[Motion, Array]],
    most: int | None = None,
    noise: float | None = None,
) -> tuple[State, Array]:
    """State of spheres at the last of some frames, and its covariance, shape (n, 9, 9).

    Spins of spheres whose rotations are tracked, and spheres that too few frames show, are those
    of another estimate.

    Args:
        laws: Of these spheres.
        times: Rising times of the frames [s], shape (m,).
        positions: Centres [m], shape (m, n, 3).
        quaternions: Rotations (x, y, z, w), shape (m, n, 4).
        seen: Whether a sphere was seen, shape (m, n).
        otherwise: Makes the other estimate, a motion and its covariance.
        most: See `KnownLaws.states`, as of the next.
        noise: See there.
    """
    states, covariances, found, doubted = laws.states(times, positions, seen, most, noise)
    turned = rotating(quaternions, seen)
    if found.all() and not turned.any() and not doubted.any():
        last = len(seen) - 1 - np.argmax(seen[::-1], axis=0)
        state = State(
            positions=states[:, :3],
            quaternions=quaternions[last, np.arange(len(last))],
            velocities=states[:, 3:6],
            angular_velocities=states[:, 6:],
        )
        return state, covariances
    base, unknown = otherwise()
    variances = np.diagonal(unknown, axis1=1, axis2=2)[:, 3:6]  # those of a window are diagonal
    apart = ((states[:, 3:6] - base.velocities) ** 2 / variances).sum(axis=1)
    found &= ~(doubted & (apart >= _APART))
    own = found[:, None]
    state = State(
        positions=np.where(own, states[:, :3], base.positions),
        quaternions=base.quaternions,
        velocities=np.where(own, states[:, 3:6], base.velocities),
        angular_velocities=np.where(
            own & ~turned[:, None], states[:, 6:], base.angular_velocities
        ),
    )
    return state, np.where(found[:, None, None], covariances, unknown)


def _coasted(
    model: BallModel, estimate: BallEstimate, tracker: Tracker, begin: float, end: float
) -> tuple[Array, Array]:
    """State and covariance at a later time, with the drift that comes to it."""
    ahead = forecast_ball(model, estimate, begin, np.array([end]))
    h, q = end - begin, tracker.spread * tracker.drift
    covariance = ahead.covariances[0].copy()
    for axis in range(3):
        covariance[axis, axis] += q * h**3 / 3.0
        covariance[axis, axis + 3] += q * h**2 / 2.0
        covariance[axis + 3, axis] += q * h**2 / 2.0
        covariance[axis + 3, axis + 3] += q * h
    return ahead.states[0], covariance
