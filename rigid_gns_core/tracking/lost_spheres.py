# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses of spheres that a tracker has lost: NaN, zeros, or exactly the origin."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .rejected_frame import RejectedFrame
from ..scenes.state import Array


def measured(poses: Array) -> NDArray[np.bool_]:
    """Whether poses, shape (..., 7), are numbers and not all zero, as those of lost markers."""
    return np.asarray(np.isfinite(poses).all(axis=-1) & (poses != 0.0).any(axis=-1))


def lost_at_origin(positions: Array) -> NDArray[np.bool_]:
    """Whether a sphere was lost, told by a place at exactly the origin, shape (m, n).

    Trackers put a marker that they have lost there; no measurement hits it. A sphere that was
    there from the first frame on is one.

    Args:
        positions: Centres in frames in their order [m], shape (m, n, 3).
    """
    there = (positions == 0.0).all(axis=-1)
    elsewhere = np.logical_or.accumulate(~there & np.isfinite(positions).all(axis=-1), axis=0)
    lost: NDArray[np.bool_] = there & elsewhere
    return lost


def why_lost(poses: Array, seen: NDArray[np.bool_]) -> str:
    """What is said of the first pose that is no measurement; empty: all are."""
    if seen.all():
        return ''
    sphere = int(np.argmin(seen))
    values = ', '.join(f'{value:g}' for value in poses[sphere])
    if np.isfinite(poses[sphere]).all():
        return (
            f'the position of sphere {sphere} is exactly the origin, where trackers put a marker '
            'that they have lost'
        )
    return f'the pose of sphere {sphere} is ({values}), expected finite numbers'


def check_seen(
    poses: Array, seen: NDArray[np.bool_], before: NDArray[np.bool_], length: int
) -> None:
    """Check that lost spheres were seen often enough before to be coasted.

    Args:
        poses: Poses of the frame, shape (n, 7).
        seen: Whether each is a measurement, shape (n,).
        before: The same of the last `length` - 1 frames, shape (k, n).
        length: Number of frames from which motion is estimated.

    Raises:
        RejectedFrame: One was not; the message says which.
    """
    least = min(length - 1, max(2, length // 2))
    if seen.all() or (least and (seen | (before.sum(axis=0) >= least)).all()):
        return
    raise RejectedFrame(
        'unseen',
        f'{why_lost(poses, seen)}; expected a sphere in at least {max(least, 1)} of the '
        f'{max(length - 1, 1)} frames before (with match_spheres they may be missing)',
    )
