"""Spheres that something carries: what may hold them, and rolling on a surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rigid_gns_core.state import Array

from .collisions import pairs_near
from .motions import CARRIED, Best
from .stretches import Sums, tail_frames
from .surroundings import Surroundings

# a sphere within so many radii, and standard deviations of noise, of something may touch it
NEAR, NEAR_SIGMAS = 0.02, 4.0
# what a surface that carries may do to the height of a sphere [radii]
_HEIGHT = 5e-3


def touching(origin: Array, radii: Array, sigma: Array) -> NDArray[np.bool_]:
    """Whether another sphere may hold a sphere, shape (n,)."""
    reach = (1.0 + NEAR) * radii + NEAR_SIGMAS * sigma
    found = np.zeros(len(radii), dtype=bool)
    for touched in pairs_near(origin, reach):
        found[touched] = True
    return found


def take_carried(
    best: Best,
    stamps: Array,
    offsets: Array,
    origin: Array,
    weights: Array,
    around: Surroundings,
    index: NDArray[np.int64],
    near: NDArray[np.bool_],
    radii: Array,
    sigma: Array,
) -> None:
    """Try rolling on the nearest surface, at the height of its radius.

    Args:
        best: Takes it where it costs least.
        stamps: Times of the frames, the last is 0 [s], shape (frames,).
        offsets: Centres, less `origin` [m], shape (frames, n, 3).
        origin: Where spheres were seen last [m], shape (n, 3).
        weights: 1 where a sphere was seen in a frame, else 0, shape (frames, n).
        around: Surfaces and gravity.
        index: Of the nearest surface, shape (n,).
        near: Whether it is near enough, shape (n,).
        radii: [m], shape (n,).
        sigma: Noise [m], shape (n,).
    """
    normals = around.axes[index, 2]
    along = around.gravity - (normals @ around.gravity)[:, None] * normals
    height = ((origin - around.points[index]) * normals).sum(axis=-1) - radii
    above = (offsets * normals).sum(axis=-1) + height
    level = offsets - (offsets * normals).sum(axis=-1)[..., None] * normals
    # a solid sphere that rolls; its line tells the direction in which rolling friction acts
    t = stamps[:, None, None]
    rolling = 5.0 / 7.0 * along
    first = Sums.of(stamps, level - 0.5 * rolling * t**2, weights)
    slope = first.lines(np.zeros(1, dtype=np.int64), np.array([len(stamps)])).slopes[0]
    speed = np.linalg.norm(slope, axis=-1)
    brake = around.rolling_friction / 1.4 * np.abs(normals @ around.gravity)
    # slower than this it may stop within the window
    rolls = speed > brake * -stamps[0]
    rolling = rolling - np.where(rolls, brake / np.maximum(speed, 1e-300), 0.0)[:, None] * slope
    sums = Sums.of(stamps, level - 0.5 * rolling * t**2, weights)
    lines = sums.lines(*tail_frames(len(stamps)))
    spread = sigma**2 + (_HEIGHT * radii) ** 2
    squares = np.cumsum((weights * above**2 / spread)[::-1], axis=0)[::-1]
    extra = np.where(near, squares[: len(stamps) - 1], np.inf)
    back = -height[:, None] * normals  # from the measured centre to the height of the radius
    best.take_tails(
        lines._replace(
            misfits=np.concatenate([lines.misfits, (extra * sigma**2)[..., None]], axis=-1),
            origins=lines.origins + back,
        ),
        sigma,
        CARRIED,
        np.zeros(len(radii)),
    )
