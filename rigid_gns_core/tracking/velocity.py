# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Position, velocity and spin at the last of a few noisy frames, by the cheapest hypothesis.

Between contacts a sphere falls freely, rolls on a surface, or is supported by others; each is a
straight line once the known acceleration is subtracted. Each of these motions is fitted to every
tail of the window, and for each interval between two frames an impact on a known surface, with a
flight before and after. The cost of a hypothesis is its squared residuals in units of the noise,
plus a charge for each frame that it leaves out. docs/tracking.md has the measured errors.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .coasting import coast
from .collisions import NO_PAIRS, pairs_near
from .environment import Environment
from .jit import plain
from .line_fit import COLUMNS
from .motion_models import FLIGHT, Hypotheses, Motion
from .observations import fill, Observations
from .sphere_impact_fit import Encounters
from .window_fit import finish, fit
from ..errors import UserError
from ..scenes.state import Array

# cost of uniform motion without a known support
_HELD = 9.0
# process noise: least standard deviation of a position, so that exact poses are not trusted
# beyond the accuracy of the motion models [radii]
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
    """Motion of each sphere at the last of a few frames.

    A sphere seen in one frame only is at rest; one not seen in the last frame is coasted to it.

    Args:
        times: Increasing times of the frames [s], shape (frames,).
        positions: Centres [m], shape (frames, n, 3).
        quaternions: Rotations (x, y, z, w), shape (frames, n, 4), with less than half a turn
            between two frames.
        environment: Surfaces and gravity.
        radii: Radii [m], shape (n,).
        noise: Standard deviation of each coordinate [m].
        seen: Whether a sphere was seen in a frame, at least once each, shape (frames, n).

    Raises:
        UserError: Shapes disagree, or times do not increase.
    """
    stamps, centres, rotations = _checked(times, positions, quaternions)
    count, n = centres.shape[:2]
    mask = (
        np.ones((count, n), np.bool_) if seen is None else np.require(seen, np.bool_, ['C', 'W'])
    )
    stamps, radii = stamps - stamps[-1], plain(radii)
    for name, shape, expected in (  # compiled code checks no bounds
        ('positions', centres.shape, (count, n, 3)),
        ('quaternions', rotations.shape, (count, n, 4)),
        ('radii', radii.shape, (n,)),
        ('seen', mask.shape, (count, n)),
    ):
        if shape != expected:
            raise UserError(f'{name} have shape {shape}, expected {expected}')
    sigma = np.maximum(noise, _FLOOR * radii)
    window = Observations.of(stamps, n, radii, sigma)
    surfaces, sums = environment.surfaces, np.empty((count + 1, COLUMNS))
    fill(window, centres, rotations, mask, surfaces.gravity, np.empty((count, 3)))
    best = Hypotheses.at_rest(window.seen, window.last)
    if count > 1:
        pairs = NO_PAIRS
        if environment.known:
            pairs = pairs_near(window.origin, np.maximum(window.touch, window.met))
        held = np.full(n, _HELD if environment.known else 0.0)
        level = np.empty((count + 1, 4))
        fit(best, window, surfaces, pairs, held, Encounters.none(n), sums, level)
    end_positions, end_velocities, spins = np.empty((3, n, 3))
    quaternions = rotations[window.last, np.arange(n)]
    finish(best, window, surfaces, end_positions, end_velocities, spins, quaternions, sums)
    missing = -stamps[window.last]
    if missing.any():
        end_positions, end_velocities = coast(
            environment, end_positions, end_velocities, best.kinds == FLIGHT, radii, missing
        )
    return Motion(
        end_positions, quaternions, end_velocities, spins, best.kinds, best.frames, best.errors
    )


def _checked(
    times: ArrayLike, positions: ArrayLike, quaternions: ArrayLike
) -> tuple[Array, Array, Array]:
    stamps, centres, rotations = plain(times), plain(positions), plain(quaternions)
    if len(stamps) == 0 or len(stamps) != len(centres) or len(stamps) != len(rotations):
        raise UserError(
            f'{len(stamps)} times, {len(centres)} frames of positions and {len(rotations)} of '
            'quaternions; expected one of each per frame, and at least one frame'
        )
    if not (np.diff(stamps) > 0).all():
        raise UserError(f'times are {stamps.tolist()} s, expected increasing ones')
    return stamps, centres, rotations
