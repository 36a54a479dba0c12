# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

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

from .coasting import coast
from .collisions import NONE_NEAR, pairs_near
from .environment import Environment
from .jit import plain
from .line_fit import COLUMNS
from .motion_models import FLIGHT, Hypotheses, Motion
from .observations import fill, Observations
from .sphere_impact_fit import Encounters
from .window_fit import finish, fit
from ..errors import UserError
from ..scenes.state import Array

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
    environment: Environment,
    radii: Array,
    noise: float,
    seen: NDArray[np.bool_] | None = None,
) -> Motion:
    """Return the motion of each sphere at the last of a few frames.

    A sphere seen in one frame only is at rest; one not seen in the last is coasted from where it
    was seen last.

    Args:
        times: Increasing times of the frames [s], shape (frames,).
        positions: Centres [m], shape (frames, n, 3).
        quaternions: Rotations (x, y, z, w), shape (frames, n, 4); between two frames a sphere may
            turn by less than half a turn.
        environment: Gravity, and what spheres can touch.
        radii: [m], shape (n,).
        noise: Standard deviation of each coordinate [m].
        seen: Whether a sphere was seen in a frame, at least once each, shape (frames, n).

    Raises:
        UserError: Shapes disagree, or times do not increase.
    """
    stamps, places, turns = _checked(times, positions, quaternions)
    count, n = places.shape[:2]
    mask = (
        np.ones((count, n), np.bool_) if seen is None else np.require(seen, np.bool_, ['C', 'W'])
    )
    stamps, radii = stamps - stamps[-1], plain(radii)
    for name, shape, expected in (  # compiled code looks at no bounds
        ('positions', places.shape, (count, n, 3)),
        ('quaternions', turns.shape, (count, n, 4)),
        ('radii', radii.shape, (n,)),
        ('seen', mask.shape, (count, n)),
    ):
        if shape != expected:
            raise UserError(f'{name} have shape {shape}, expected {expected}')
    sigma = np.maximum(noise, _FLOOR * radii)
    window = Observations.of(stamps, n, radii, sigma)
    surfaces, sums = environment.surfaces, np.empty((count + 1, COLUMNS))
    fill(window, places, turns, mask, surfaces.gravity, np.empty((count, 3)))
    best = Hypotheses.at_rest(window.seen, window.last)
    if count > 1:
        pairs = NONE_NEAR
        if environment.known:
            pairs = pairs_near(window.origin, np.maximum(window.touch, window.met))
        held = np.full(n, _HELD if environment.known else 0.0)
        level = np.empty((count + 1, 4))
        fit(best, window, surfaces, pairs, held, Encounters.none(n), sums, level)
    place, speed, spins = np.empty((3, n, 3))
    quaternions = turns[window.last, np.arange(n)]
    finish(best, window, surfaces.gravity, place, speed, spins, quaternions, sums)
    missing = -stamps[window.last]
    if missing.any():
        place, speed = coast(environment, place, speed, best.kinds == FLIGHT, radii, missing)
    return Motion(place, quaternions, speed, spins, best.kinds, best.frames, best.errors)


def _checked(
    times: ArrayLike, positions: ArrayLike, quaternions: ArrayLike
) -> tuple[Array, Array, Array]:
    stamps, places, turns = plain(times), plain(positions), plain(quaternions)
    if len(stamps) == 0 or len(stamps) != len(places) or len(stamps) != len(turns):
        raise UserError(
            f'{len(stamps)} times, {len(places)} frames of positions and {len(turns)} of '
            'quaternions; expected one of each per frame, and at least one frame'
        )
    if not (np.diff(stamps) > 0).all():
        raise UserError(f'times are {stamps.tolist()} s, expected increasing ones')
    return stamps, places, turns
