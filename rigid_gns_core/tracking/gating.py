# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gating: how far a pose may be from a track's prediction and still be associated with it."""

from __future__ import annotations

from .collisions import Pairs, pairs_near
from .jit import entry, plain
from ..kernels.neighbours import Flags
from ..scenes.state import Array

# standard deviations of the predicted position that a gate adds to radius and travel
GATE_SIGMAS = 6.0


def gates(
    speeds: Array, positions: Array, radii: Array, spread: Array, time: float, reliable: Flags
) -> Array:
    """Gate of each track: largest distance of a pose from its prediction [m], shape (n,).

    One radius, since other spheres are at least two away; `GATE_SIGMAS` standard deviations; and
    the distance that the sphere itself, or the fastest one that can reach it, travels in a frame,
    since either may have been struck.

    Args:
        speeds: Magnitudes of the velocities [m/s], shape (n,).
        positions: Predicted centres [m], shape (n, 3).
        radii: Radii [m], shape (n,).
        spread: Standard deviation of the predicted positions [m], shape (n,).
        time: Time since the previous frame [s].
        reliable: Whether a speed comes from three frames or more, shape (n,): a wrong association
            must not widen the gates of other tracks.
    """
    positions, radii, travel = plain(positions), plain(radii), plain(speeds * time)
    fastest = travel.copy()
    _raise_to_fastest(fastest, travel, reliable, pairs_near(positions, radii + travel))
    return radii + GATE_SIGMAS * spread + fastest


@entry
def _raise_to_fastest(fastest: Array, travel: Array, reliable: Flags, pairs: Pairs) -> None:
    """Raise the travel of each sphere to that of the fastest reliable one that can reach it."""
    first, second = pairs
    for k in range(len(first)):
        i, j = first[k], second[k]
        if reliable[j]:
            fastest[i] = max(fastest[i], travel[j])
        if reliable[i]:
            fastest[j] = max(fastest[j], travel[i])
