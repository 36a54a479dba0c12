# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The state of tracked spheres at the end of a window of stamped positions, and how well known."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .environment import Environment
from .jit import compiling
from .known_laws import KnownLaws, most_balls, state_by_laws
from .motion_models import Motion, ROLLING
from .noise_estimate import NOISE_FRAMES, third_differences
from .pose_noise import normal_spread, rotating
from .stamp_jitter import newest_noise
from .usable_frames import MAX_DISTANCE
from .velocity import estimate_motion
from ..errors import shown, UserError
from ..scenes.scene import checked_scene, Scene
from ..scenes.state import Array, State
from ..scenes.values import checked_floats, checked_number

_UNTURNED = (0.0, 0.0, 0.0, 1.0)
# shortest time between two frames, and the latest time of one [s]: nanoseconds since 1970 are 2e18
_SHORTEST, _LATEST = 1e-9, 1e19
# fewer third differences than this, those of six frames of a sphere, do not tell the noise: it
# is at least this [m], and so many radii of small balls
_TOLD, _GUESS, _GUESSED = 9, 1e-3, 0.05


@dataclass(frozen=True)
class StateEstimate:
    """State of spheres, and its uncertainty.

    Args:
        state: The state.
        covariance: Of position [m], velocity [m/s] and angular velocity [rad/s] of each sphere, in
            this order, shape (n, 9, 9); NaN where nothing is known of a velocity.
    """

    state: State
    covariance: Array


def estimate_state(
    scene: Scene,
    times: ArrayLike,
    positions: ArrayLike,
    quaternions: ArrayLike | None = None,
    *,
    noise: float | None = None,
) -> StateEstimate:
    """Estimate the state at the last of some frames.

    All frames of the tracker's memory count, through the contacts in between, and spin is
    estimated with the prior that was learned (`rigid-gns calibrate`). Of more than 8 spheres in
    a scene without air and learned tracker it is the fit of motions that the node then makes.

    Args:
        scene: Surfaces, radii and gravity. Surfaces that move are where they are at the last
            frame.
        times: Rising times of the frames [s], shape (m,).
        positions: Centres [m], shape (m, n, 3), NaN where a sphere was not seen.
        quaternions: Rotations (x, y, z, w), shape (m, n, 4), NaN where unknown; None: not
            tracked. Those of a sphere that never change are unknown, too.
        noise: Standard deviation of each coordinate of a position [m]; None: that of the scene's
            tracker, or estimated from these frames.

    Raises:
        UserError: Shapes disagree, times do not rise, or a sphere is seen in no frame.
    """
    checked_scene(scene)
    stamps = checked_floats('times', times)
    if stamps.ndim != 1:
        raise UserError(f'times have shape {stamps.shape}, expected (m,): one per frame')
    centres = np.array(checked_floats('positions', positions))
    if noise is not None:
        noise = checked_number('noise', noise)
    if centres.ndim != 3 or centres.shape[::2] != (len(stamps), 3):
        raise UserError(
            f'positions have shape {centres.shape}, expected ({len(stamps)}, n, 3) for '
            f'{len(stamps)} times'
        )
    _check_times(stamps)
    seen = np.asarray(np.isfinite(centres).all(axis=-1))
    far = MAX_DISTANCE * float(np.max(scene.radius))
    if (out := np.abs(centres[seen]).max(initial=0.0)) > far:
        raise UserError(
            f'a position is {out:.3g} m out, expected at most {far:.3g} m (a million radii); are '
            'positions in metres?'
        )
    if not seen.any(axis=0).all():
        lost = int(np.argmin(seen.any(axis=0)))
        raise UserError(f'sphere {lost} is seen in no frame; leave it out')
    turns = np.broadcast_to(_UNTURNED, (*seen.shape, 4)).copy()
    turned = np.zeros(centres.shape[1], dtype=np.bool_)
    if quaternions is not None:
        given = checked_floats('quaternions', quaternions)
        if given.shape != turns.shape:
            raise UserError(f'quaternions have shape {given.shape}, expected {turns.shape}')
        known = np.asarray(np.isfinite(given).all(axis=-1))
        turns[seen & known] = given[seen & known]
        # one that was never told, or never changes, tells nothing of the spin
        turned = (known | ~seen).all(axis=0) & rotating(turns, seen)
        turns[:, ~turned] = _UNTURNED
    centres[~seen] = 0.0  # not read
    if centres.shape[1] > most_balls(scene):
        motion, covariance = _by_window(scene, stamps, centres, turns, seen, noise, turned)
        return StateEstimate(motion.state, covariance)
    if noise is None and scene.tracker is None:
        noise = _noise(scene, stamps, centres, seen)
    with compiling():
        laws, own = _laws_of(scene, centres.shape[1]), noise
        if noise is not None and not laws.learned:
            own = newest_noise(stamps, centres, seen, noise)
        state, covariance = state_by_laws(
            laws,
            stamps,
            centres,
            turns,
            seen,
            lambda: _by_window(scene, stamps, centres, turns, seen, own, turned),
            noise=noise,
        )
    return StateEstimate(state, covariance)


def _check_times(times: Array) -> None:
    apart = np.diff(times)
    if not ((apart > 0).all() and np.isfinite(times).all()):
        raise UserError('times do not rise, expected increasing ones; sort the frames')
    if (apart < _SHORTEST).any() or np.abs(times).max(initial=0.0) > _LATEST:
        raise UserError(
            f'times are {shown(times.tolist())}, expected seconds: steps of {_SHORTEST:g} s or '
            f'more, within {_LATEST:g} s'
        )


@lru_cache(maxsize=8)
def _laws_of(scene: Scene, count: int) -> KnownLaws:
    return KnownLaws.of(scene, tuple(range(count)))


def _by_window(
    scene: Scene,
    stamps: Array,
    centres: Array,
    turns: Array,
    seen: NDArray[np.bool_],
    noise: float | None,
    turned: NDArray[np.bool_],
) -> tuple[Motion, Array]:
    """Fit of motions without air, as of the node for many spheres, and its covariance."""
    radii = scene.per_sphere('radius', centres.shape[1])
    sigma = _noise(scene, stamps, centres, seen) if noise is None else noise
    with compiling():
        motion = estimate_motion(
            stamps,
            centres,
            turns,
            environment=Environment.of(scene),
            radii=radii,
            noise=sigma,
            seen=seen,
        )
    return motion, motion_covariance(motion, radii, sigma, turned)


def _noise(scene: Scene, times: Array, positions: Array, seen: NDArray[np.bool_]) -> float:
    """Noise by third differences, and at least a guess where there are few of them."""
    values = [np.zeros(0)]
    for sphere, own in enumerate(seen.T):
        stamps, places = times[own], positions[own, sphere, None]
        shown = np.ones((NOISE_FRAMES, 1), dtype=np.bool_)
        values += [
            third_differences(stamps[k : k + NOISE_FRAMES], places[k : k + NOISE_FRAMES], shown)
            for k in range(len(stamps) - NOISE_FRAMES + 1)
        ]
    differences = np.concatenate(values)
    found = normal_spread(differences)
    guess = min(_GUESS, _GUESSED * float(np.min(scene.radius)))
    return max(found, guess) if len(differences) < _TOLD else found


def motion_covariance(
    motion: Motion, radii: Array, noise: float, turned: NDArray[np.bool_]
) -> Array:
    """Covariance of a line through N frames at equal intervals h, at the last of them.

        var p = 2 (2N - 1) / (N (N + 1)) s^2
        cov(p, v) = 6 / (N (N + 1) h) s^2
        var v = 12 / (N (N^2 - 1) h^2) s^2

    with s the noise; var v is known, h follows from it. Where rotations are not tracked, each
    component of a spin that is not that of rolling is as large as rolling at this speed makes it.
    """
    found = np.zeros((len(radii), 9, 9))
    count = np.maximum(motion.frames, 2).astype(np.float64)
    known = np.isfinite(motion.errors)
    velocity = np.where(known, motion.errors, np.nan)
    place = noise * np.sqrt(2 * (2 * count - 1) / (count * (count + 1)))
    # cov / (deviation of p, deviation of v), which does not depend on h
    correlation = np.sqrt(3 * (count - 1) / (2 * (2 * count - 1)))
    spin = np.linalg.norm(motion.velocities, axis=1) / radii
    spin = np.where((motion.kinds == ROLLING) | turned, 0.0, spin)
    for axis in range(3):
        found[:, axis, axis] = place**2
        found[:, axis, axis + 3] = found[:, axis + 3, axis] = correlation * place * velocity
        found[:, axis + 3, axis + 3] = velocity**2
        found[:, axis + 6, axis + 6] = spin**2
    return found
