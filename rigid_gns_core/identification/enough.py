# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether tracks show enough for a fit that is judged by left-out ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .ladder import MEMORY
from .left_out import HORIZONS, USUAL, windows
from .stretches import FEWEST, LONGEST, Stretch
from ..data.tracks import Track
from ..errors import UserError

_FEWEST_TRACKS = 4
# a ball whose places differ by less may be at rest [deviations of the noise]
_STILL = 10.0


def check_enough(
    tracks: Sequence[Track], found: Sequence[Stretch], every: Sequence[Stretch], noise: float
) -> None:
    """Raise UserError where tracks show too few stretches, no window to forecast, or no motion.

    Args:
        tracks: The tracks.
        found: Their pieces that hold a stretch.
        every: Their stretches.
        noise: Standard deviation of each coordinate of a position [m].
    """
    apart = [np.diff(track.times) for track in tracks]
    interval = float(np.median(np.concatenate(apart))) if any(map(len, apart)) else 0.0
    most = MEMORY / (FEWEST - 1)
    seldom = (
        f' with frames at most {1e3 * most:.0f} ms apart: these are {1e3 * interval:.3g} ms apart'
        if interval > most
        else ''
    )
    if (count := len({one.track for one in every})) < _FEWEST_TRACKS:
        raise UserError(
            f'the tracks show {count} stretches of a ball of {FEWEST} frames or more within '
            f'{LONGEST:g} s, but a fit with left-out tracks takes at least {_FEWEST_TRACKS}; '
            f'import more tracks{seldom}'
        )
    if not any(True for one in found for _ in windows(one, MEMORY, *USUAL)):
        longest = max(float(one.times[-1] - one.times[0]) for one in found)
        raise UserError(
            f'no stretch of a ball shows {FEWEST} frames within {MEMORY:g} s and one '
            f'{HORIZONS[0]:g} s later, by which a fit is judged, the longest has {longest:.2g} s; '
            f'import {"" if seldom else "longer "}tracks{seldom}'
        )
    far = max(float(np.ptp(one.positions, axis=0).max()) for one in every)
    if far <= (least := _STILL * noise):
        raise UserError(
            f'the balls stay where they are: none goes further than {far:.2g} m in a stretch, '
            f'expected at least {least:.2g} m, {_STILL:g} times the noise; import tracks of balls '
            'that move'
        )
