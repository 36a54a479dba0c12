"""Collisions of two spheres in the last two intervals of a window, fitted as rebounds are.

Earlier ones leave frames enough to tell the motion after them without.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rigid_gns_core.state import Array

from .collisions import exchange, meeting, pairs_near
from .motions import Flight
from .rebound import IMPACT, SLACK, Before, Rebound, after_contact, before_contact
from .stretches import Sums
from .surroundings import Surroundings

_INTERVALS = 2
# what is known of a collision before it is seen, as parts of the change of velocity
_ALONG, _ACROSS = 0.1, 0.15


class Knocks(NamedTuple):
    """Motions after collisions.

    Args:
        rebound: Their fits.
        kinds: Of motion after them: 0 for flight, 2 for one that something holds, shape (m, n).
    """

    rebound: Rebound
    kinds: NDArray[np.int64]

    def among(self, who: NDArray[np.int64], count: int) -> Knocks:
        """The same as some of more spheres, the others of which have met nobody."""
        rebound, rows = self.rebound, len(self.kinds)

        def spread(part: NDArray[Any]) -> NDArray[Any]:
            whole = np.zeros((rows, count, *part.shape[2:]), dtype=part.dtype)
            whole[:, who] = part
            return whole

        flights = Flight(*(spread(part) for part in rebound.flights))
        flights.cost[:, np.setdiff1d(np.arange(count), who)] = np.inf
        times, angles, laws = (spread(p) for p in (rebound.times, rebound.angles, rebound.laws))
        return Knocks(Rebound(rebound.first, flights, times, angles, laws), spread(self.kinds))


def may_have_met(
    stamps: Array, offsets: Array, origin: Array, radii: Array, mask: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of spheres that are so near, and were so fast, that they may have met lately.

    Args:
        stamps: Times of the frames, the last is 0 [s], shape (frames,).
        offsets: Centres, less `origin` [m], shape (frames, n, 3).
        origin: Where spheres were seen last [m], shape (n, 3).
        radii: [m], shape (n,).
        mask: Whether a sphere was seen in a frame, shape (frames, n).
    """
    recent = slice(-_INTERVALS - 2, None)
    steps = np.linalg.norm(np.diff(offsets[recent], axis=0), axis=-1)
    both = mask[recent][1:] & mask[recent][:-1]
    speeds = np.where(both, steps / np.diff(stamps[recent])[:, None], 0.0).max(axis=0)
    # half as fast again, as a step may have been there and back
    return pairs_near(origin, radii - 1.5 * stamps[-min(_INTERVALS + 1, len(stamps))] * speeds)


def knocks(
    flights: Sums,
    straight: Sums,
    turns: Sums,
    stamps: Array,
    origin: Array,
    around: Surroundings,
    radii: Array,
    sigma: Array,
    left_out: float,
    pairs: tuple[NDArray[np.int64], NDArray[np.int64]],
) -> Knocks | None:
    """Fit them, as spheres of equal mass.

    Args:
        flights: Sums of places less `origin` and the fall.
        straight: Sums of places less `origin`.
        turns: Sums of rotation vectors.
        stamps: Times of the frames, at least three [s], shape (frames,).
        origin: What places are counted from [m], shape (n, 3).
        around: Gravity and the restitution of spheres.
        radii: [m], shape (n,).
        sigma: Noise [m], shape (n,).
        left_out: Charge for a frame that is not explained.
        pairs: Of spheres that may have met, as from `may_have_met`.

    Returns:
        None where none has met another.
    """
    i, j = pairs
    first = max(2, len(stamps) - _INTERVALS)
    frames = np.arange(first, len(stamps))
    before, falls = _either(
        before_contact(flights, turns, sigma, left_out, first),
        before_contact(straight, turns, sigma, left_out, first),
    )
    begin, end = stamps[frames - 1, None], stamps[frames, None]
    middle = 0.5 * (begin + end)
    m = middle[..., None]
    g = falls[..., None] * around.gravity
    places = before.origins + origin + before.slopes * m + 0.5 * g * m**2
    speeds = before.slopes + g * m
    counts = np.maximum(before.counts, 1.0)
    spans = np.where(before.spans > 0, before.spans, np.inf)
    spread = sigma * np.sqrt(1.0 / counts + (middle - before.middles) ** 2 / spans)
    relative = speeds[:, j] - speeds[:, i]
    met = middle + meeting(places[:, j] - places[:, i], relative, radii[i] + radii[j])
    doubt = SLACK * np.hypot(spread[:, i], spread[:, j])
    doubt = doubt / np.maximum(np.linalg.norm(relative, axis=-1), 1e-300)
    slack = np.minimum(doubt, 0.25 * (end - begin))
    known = np.isfinite(before.cost[:, i]) & np.isfinite(before.cost[:, j])
    good = known & (met >= begin - slack) & (met <= end + slack)
    if not good.any():
        return None
    met = np.where(good, met, np.inf)
    when, partner = _first(met, i, j, len(radii))
    hit = np.isfinite(when)
    when = np.clip(np.where(hit, when, middle), begin, end)
    row = np.arange(len(frames))[:, None]
    since = (when - middle)[..., None]
    offsets = (places + speeds * since)[row, partner] - (places + speeds * since)
    # where there is no partner any direction does
    offsets = np.where(hit[..., None], offsets, [0.0, 0.0, 1.0])
    change = exchange(offsets, speeds[row, partner] - speeds, around.bounce)
    size = np.linalg.norm(change, axis=-1)
    t = when[..., None]
    law = before.slopes + g * t + change
    drift = sigma**2 / spans + (size * spread / radii) ** 2 + 1e-30
    after = [
        after_contact(
            sums,
            frames,
            when,
            before.origins + before.slopes * t + 0.5 * (g - fall) * t**2,
            1.0 / (1.0 / counts + (when - before.middles) ** 2 / spans),
            law - fall * t,
            offsets / np.linalg.norm(offsets, axis=-1, keepdims=True),
            sigma**2 / (drift + (_ALONG * size) ** 2),
            sigma**2 / (drift + (_ACROSS * size) ** 2),
            sigma,
        )
        for sums, fall in ((flights, around.gravity), (straight, np.zeros(3)))
    ]
    flies = after[0].cost <= after[1].cost
    chosen = type(after[0])(
        *(
            np.where(flies[..., None] if one.ndim == 3 else flies, one, other)
            for one, other in zip(*after, strict=True)
        )
    )
    cost = np.where(hit, before.cost + chosen.cost + IMPACT, np.inf)
    explained = chosen.frames + before.counts.astype(np.int64)
    rebound = Rebound(
        first,
        chosen._replace(cost=cost, frames=explained),
        when,
        before.angles + before.spins * t,
        before.spins,
    )
    return Knocks(rebound, np.where(flies, 0, 2))


def _either(flying: Before, held: Before) -> tuple[Before, NDArray[np.bool_]]:
    falls = flying.cost <= held.cost
    return Before(
        *(
            np.where(falls[..., None] if one.ndim == 3 else falls, one, other)
            for one, other in zip(flying, held, strict=True)
        )
    ), falls


def _first(
    met: Array, i: NDArray[np.int64], j: NDArray[np.int64], count: int
) -> tuple[Array, NDArray[np.int64]]:
    """Time of the first collision of each sphere, infinite where there is none, and with whom."""
    when = np.full((len(met), count), np.inf)
    partner = np.tile(np.arange(count), (len(met), 1))
    one, other = np.concatenate([i, j]), np.concatenate([j, i])
    for row, times in enumerate(np.concatenate([met, met], axis=1)):
        np.minimum.at(when[row], one, times)
        first = np.isfinite(times) & (times == when[row, one])
        partner[row, one[first]] = other[first]
    return when, partner
