"""Position, velocity and spin at the last of a few noisy frames: the motion that explains them.

Between contacts a sphere falls freely, or a surface carries it, or it lies among others; each is a
straight line once the known acceleration is taken off. So each of these motions is fitted to every
tail of the window, and, for each moment between two frames, a flight into a known surface and out
of it again. What explains most frames within the noise is taken: its cost is the squared residuals
in units of the noise, plus a charge for each frame that it leaves out. docs/tracking.md measures
how well that works.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigid_gns_core.state import Array, rotate_quaternions, rotation_between

from .carried import NEAR, NEAR_SIGMAS, take_carried, touching
from .coasting import coast
from .knocks import Knocks, knocks, may_have_met
from .motions import AMONG, FLIGHT, LEFT_OUT, Best, Motion
from .rebound import Rebound, rebounds
from .stretches import Sums, tail_frames
from .surroundings import Surroundings

# charge for flight beside a surface, which has two unknowns more than being carried by it
_FREEDOM = 4.0
# charge for being held by what the scene does not know
_HELD = 9.0
# what a model of flight may do to a path, so that exact poses are not taken for more exact than
# physics [radii]
_FLOOR = 1e-4


def estimate_motion(
    times: ArrayLike,
    positions: ArrayLike,
    quaternions: ArrayLike,
    *,
    around: Surroundings,
    radii: Array,
    noise: float,
    seen: NDArray[np.bool_] | None = None,
) -> Motion:
    """The motion of each sphere at the last of a few frames.

    A sphere seen in one frame only is at rest; one not seen in the last is coasted from where it
    was seen last.

    Args:
        times: Increasing times of the frames [s], shape (frames,).
        positions: Centres [m], shape (frames, n, 3).
        quaternions: Rotations (x, y, z, w), shape (frames, n, 4); between two frames a sphere may
            turn by less than half a turn.
        around: Gravity, and what spheres can touch.
        radii: [m], shape (n,).
        noise: Standard deviation of each coordinate [m].
        seen: Whether a sphere was seen in a frame, at least once each, shape (frames, n).

    Raises:
        ValueError: Shapes disagree, or times do not increase.
    """
    stamps, places, turns = _checked(times, positions, quaternions)
    count, n = places.shape[:2]
    mask: NDArray[np.bool_] = np.ones((count, n), dtype=bool) if seen is None else seen
    stamps = stamps - stamps[-1]
    last = count - 1 - np.argmax(mask[::-1], axis=0)
    everyone = np.arange(n)
    origin = places[last, everyone]
    offsets = np.where(mask[..., None], places - origin, 0.0)
    sigma = np.asarray(np.maximum(noise, _FLOOR * radii), dtype=np.float64)
    turned = _turned(turns, mask)
    best = Best.none(mask)
    found: Rebound | None = None
    struck: Knocks | None = None
    if count > 1:
        weights = mask.astype(np.float64)
        fall = 0.5 * stamps[:, None, None] ** 2 * around.gravity
        flights = Sums.of(stamps, offsets - fall, weights)
        index, gap = around.nearest(origin, radii)
        near = gap <= NEAR * radii + NEAR_SIGMAS * sigma
        best.take_tails(
            flights.lines(*tail_frames(count)), sigma, FLIGHT, np.where(near, _FREEDOM, 0.0)
        )
        # two frames fit every motion: without a scene it is flight
        others = np.full(n, count > 2)
        if around.known:
            others = touching(origin, radii, sigma)
        if others.any() or around.known:
            straight = Sums.of(stamps, offsets, weights)
            extra = np.where(others, 0.0, _HELD)
            best.take_tails(straight.lines(*tail_frames(count)), sigma, AMONG, extra)
        if near.any():
            take_carried(best, stamps, offsets, origin, weights, around, index, near, radii, sigma)
        if around.known and count > 2:
            turns_sums = Sums.of(stamps, turned, weights)
            given = stamps, origin, around, radii, sigma
            if len(around.points):
                found = rebounds(flights, turns_sums, *given, LEFT_OUT)
                for frame, flight in found.by_frame():
                    extra = np.where(near, _FREEDOM, 0.0)
                    best.take_contact(flight, frame, frame, np.full(n, FLIGHT), extra)
            pairs = may_have_met(stamps, offsets, origin, radii, mask)
            who = np.unique(np.concatenate(pairs))
            if len(who):
                struck = knocks(
                    flights.part(who),
                    Sums.of(stamps, offsets[:, who], weights[:, who]),
                    turns_sums.part(who),
                    stamps,
                    origin[who],
                    around,
                    radii[who],
                    sigma[who],
                    LEFT_OUT,
                    (np.searchsorted(who, pairs[0]), np.searchsorted(who, pairs[1])),
                )
            if struck is not None:
                struck = struck.among(who, n)
                rows = zip(struck.rebound.by_frame(), struck.kinds, strict=True)
                for (frame, flight), kinds in rows:
                    best.take_contact(flight, frame, -frame, kinds, np.zeros(n))
    accelerations = np.where((best.kinds == FLIGHT)[:, None], around.gravity, 0.0)
    at = stamps[last][:, None]
    place = origin + best.origins + best.slopes * at + 0.5 * accelerations * at**2
    speed = best.slopes + accelerations * at
    speed = np.where((best.frames > 1)[:, None], speed, 0.0)
    spins = _spins(stamps, turned, mask, best, found, struck)
    place, speed = _coasted(around, place, speed, best, radii, -at[:, 0])
    return Motion(
        positions=place,
        quaternions=rotate_quaternions(turns[last, everyone], spins * -at),
        velocities=speed,
        angular_velocities=spins,
        kinds=best.kinds,
        frames=best.frames,
        errors=best.errors,
    )


def estimate_velocities(
    times: ArrayLike, positions: ArrayLike, quaternions: ArrayLike, gravity: ArrayLike
) -> tuple[Array, Array]:
    """Velocities where neither the scene nor the noise is known: frames are all of one motion.

    Returns:
        Velocities [m/s] and angular velocities [rad/s], world frame, each of shape (n, 3).
    """
    count = np.shape(positions)[1] if np.ndim(positions) == 3 else 0
    motion = estimate_motion(
        times,
        positions,
        quaternions,
        around=Surroundings.unknown(gravity, 1.0),
        radii=np.ones(count),
        noise=1e6,  # nothing is left out, and the motion that fits better is taken
    )
    return motion.velocities, motion.angular_velocities


def _checked(
    times: ArrayLike, positions: ArrayLike, quaternions: ArrayLike
) -> tuple[Array, Array, Array]:
    stamps: Array = np.asarray(times, dtype=np.float64)
    places: Array = np.asarray(positions, dtype=np.float64)
    turns: Array = np.asarray(quaternions, dtype=np.float64)
    if len(stamps) == 0 or len(stamps) != len(places) or len(stamps) != len(turns):
        raise ValueError(
            f'{len(stamps)} times, {len(places)} frames of positions and {len(turns)} of '
            'quaternions; expected one of each per frame, and at least one frame'
        )
    if not (np.diff(stamps) > 0).all():
        raise ValueError(f'times are {stamps.tolist()} s, expected increasing ones')
    return stamps, places, turns


def _turned(turns: Array, mask: NDArray[np.bool_]) -> Array:
    """Rotation vectors since the first frame [rad], shape (frames, n, 3)."""
    turned = np.zeros((*mask.shape, 3))
    if len(turns) == 1:
        return turned
    if not mask.all():
        turns = turns.copy()
        for frame in range(1, len(turns)):
            turns[frame] = np.where(mask[frame, :, None], turns[frame], turns[frame - 1])
        for frame in range(len(turns) - 2, -1, -1):
            early = ~mask[: frame + 1].any(axis=0)
            turns[frame, early] = turns[frame + 1, early]
    # summed increments: the total may pass half a turn, and to first order their noise telescopes
    turned[1:] = np.cumsum(rotation_between(turns[:-1], turns[1:]), axis=0)
    return turned


def _spins(
    stamps: Array,
    turned: Array,
    mask: NDArray[np.bool_],
    best: Best,
    found: Rebound | None,
    struck: Knocks | None,
) -> Array:
    """Angular velocities, from the frames since the last contact [rad/s], shape (n, 3)."""
    since = (np.arange(len(stamps))[:, None] >= best.begin) & mask
    sums = Sums.of(stamps, turned, since.astype(np.float64))
    line = sums.lines(np.zeros(1, dtype=np.int64), np.array([len(stamps)]))
    spins = line.slopes[0]
    for sign, contacts in ((1, found), (-1, struck and struck.rebound)):
        if contacts is not None:
            once = np.flatnonzero((sign * best.rebound > 0) & (line.counts[0] < 1.5))
            spins[once] = contacts.spins(np.abs(best.rebound[once]), once, turned, stamps, mask)
    return spins


def _coasted(
    around: Surroundings, places: Array, speeds: Array, best: Best, radii: Array, time: Array
) -> tuple[Array, Array]:
    if not (time > 0).any():
        return places, speeds
    return coast(around, places, speeds, best.kinds == FLIGHT, radii, time)
