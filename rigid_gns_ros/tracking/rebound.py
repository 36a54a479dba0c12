"""A flight into a known surface and out of it again, fitted together, for each moment of a window.

The flight before says when and where the surface is met. The flight after begins there: with one
frame after the contact its velocity is known already. The law of impact enters as a measurement of
that velocity, as uncertain as materials are, which counts where the frames after it are few.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rigid_gns_core.state import Array

from .motions import Flight
from .stretches import Sums
from .surroundings import Contacts, Surroundings, after_impact

# what is known of a rebound before it is seen: parts of the changes that the law says
_NORMAL, _TANGENT = 0.1, 0.3
# a contact may be found a little outside of its two frames: standard deviations of the flight
SLACK = 3.0
# contacts are sought so many frames back, and the flights before them so long: what was earlier
# adds little, and cost would grow with the square of the window
_REACH = 10
# charge for a contact: at the moment of one it is better not yet to have happened, as a model then
# makes it happen
IMPACT = 8.0
# nearer to its contact than this part of an interval, a frame tells less of spin than the law does
_SOON = 0.3


@dataclass(frozen=True)
class Rebound:
    """Motions with a contact in front of frame `first`, the next, ..., each shape (m, n, ...).

    Args:
        first: The first of these frames.
        flights: After the contacts, stacked; infinite cost where there is none.
        times: Of the contacts [s].
        angles: Rotation vectors at the contacts [rad].
        laws: Spins after them, by the law of impact [rad/s].
    """

    first: int
    flights: Flight
    times: Array
    angles: Array
    laws: Array

    def by_frame(self) -> Iterator[tuple[int, Flight]]:
        """Frame after the contact, and the flights from there."""
        for row in range(len(self.times)):
            yield row + self.first, Flight(*(field[row] for field in self.flights))

    def spins(
        self,
        frame: NDArray[np.int64],
        spheres: NDArray[np.int64],
        turned: Array,
        stamps: Array,
        mask: NDArray[np.bool_],
    ) -> Array:
        """Spins of spheres seen once since a contact in front of `frame`, shape (m, 3)."""
        row = frame - self.first
        last = len(stamps) - 1 - np.argmax(mask[::-1, spheres], axis=0)
        since = stamps[last] - self.times[row, spheres]
        angle = turned[last, spheres] - self.angles[row, spheres]
        long = since > _SOON * (stamps[frame] - stamps[frame - 1])
        seen = angle / np.where(long, since, 1.0)[:, None]
        tracked = np.abs(turned[:, spheres]).max(axis=(0, 2)) > 1e-9
        spins = np.where(long[:, None], seen, self.laws[row, spheres])
        return np.where(tracked[:, None], spins, 0.0)


class Before(NamedTuple):
    """The flight before a contact, the longest that fits, for each frame after it."""

    cost: Array
    origins: Array
    slopes: Array
    middles: Array
    spans: Array
    counts: Array
    angles: Array
    spins: Array


def rebounds(
    flights: Sums,
    turns: Sums,
    stamps: Array,
    origin: Array,
    around: Surroundings,
    radii: Array,
    sigma: Array,
    left_out: float,
) -> Rebound:
    """Fit all of them.

    Args:
        flights: Sums of places less `origin` and the fall.
        turns: Sums of rotation vectors.
        stamps: Times of the frames, at least three [s], shape (frames,).
        origin: What places are counted from [m], shape (n, 3).
        around: Surfaces and materials.
        radii: [m], shape (n,).
        sigma: Noise [m], shape (n,).
        left_out: Charge for a frame that is not explained.
    """
    first = max(2, len(stamps) - _REACH)
    before = before_contact(flights, turns, sigma, left_out, first)
    frames = np.arange(first, len(stamps))
    begin, end = stamps[frames - 1, None], stamps[frames, None]
    counts = np.maximum(before.counts, 1.0)
    spans = np.where(before.spans > 0, before.spans, np.inf)
    middle = 0.5 * (begin + end)
    spread = sigma * np.sqrt(1.0 / counts + (middle - before.middles) ** 2 / spans)
    speed = np.linalg.norm(before.slopes + around.gravity * middle[..., None], axis=-1)
    slack = np.minimum(SLACK * spread / np.maximum(speed, 1e-300), 0.25 * (end - begin))
    hits = around.first_contact(
        before.origins + origin, before.slopes, radii, begin - slack, end + slack
    )
    hit = np.isfinite(hits.times) & np.isfinite(before.cost)
    when = np.clip(np.where(hit, hits.times, middle), begin, end)
    t = when[..., None]
    angles = before.angles + before.spins * t
    incoming = before.slopes + around.gravity * t
    contacts = Contacts(when, *hits[1:])
    law, spins = after_impact(incoming, before.spins, contacts, np.broadcast_to(radii, when.shape))
    change = law - incoming
    along = (change * hits.normals).sum(axis=-1)
    across = np.linalg.norm(change - along[..., None] * hits.normals, axis=-1)
    drift = sigma**2 / spans + (1e-6 * speed) ** 2  # never without any doubt
    # of a spin that no tracker follows nothing is known
    unknown = np.where(
        np.abs(turns.powers[-1]).sum(axis=-1) > 0, across, hits.friction * np.abs(along)
    )
    after = after_contact(
        flights,
        frames,
        when,
        before.origins + before.slopes * t,
        1.0 / (1.0 / counts + (when - before.middles) ** 2 / spans),
        law - around.gravity * t,
        hits.normals,
        sigma**2 / (drift + (_NORMAL * along) ** 2 + 1e-30),
        sigma**2 / (drift + (_TANGENT * unknown) ** 2 + (0.02 * along) ** 2 + 1e-30),
        sigma,
    )
    cost = np.where(hit, before.cost + after.cost + IMPACT, np.inf)
    explained = after.frames + before.counts.astype(np.int64)
    return Rebound(first, after._replace(cost=cost, frames=explained), when, angles, spins)


def before_contact(flights: Sums, turns: Sums, sigma: Array, left_out: float, first: int) -> Before:
    """For each frame from `first` on, the cheapest motion through frames before it."""
    frames = range(first, len(flights.totals) - 1)
    begins = [np.arange(max(0, frame - _REACH), frame - 1) for frame in frames]
    # all stretches at once, as for so few numbers the calls take the time
    begin, lengths = np.concatenate(begins), [len(one) for one in begins]
    end = np.repeat(frames, lengths)
    lines, spin = flights.lines(begin, end), turns.lines(begin, end)
    cost = lines.misfits.sum(axis=-1) / sigma**2 + left_out * flights.counts[begin]
    cost = np.where(lines.counts > 1.5, cost, np.inf)
    borders = pairwise(np.cumsum([0, *lengths]))
    cheapest = [start + cost[start:stop].argmin(axis=0) for start, stop in borders]
    best = np.stack(cheapest), np.arange(len(sigma))
    return Before(
        cost[best],
        lines.origins[best],
        lines.slopes[best],
        lines.middles[best],
        lines.spans[best],
        lines.counts[best],
        spin.origins[best],
        spin.slopes[best],
    )


def after_contact(
    flights: Sums,
    frames: NDArray[np.int64],
    when: Array,
    places: Array,
    weight: Array,
    expected: Array,
    normals: Array,
    along: Array,
    across: Array,
    sigma: Array,
) -> Flight:
    """Lines through the frames from `frames` on, the place of contact, and an expected slope.

    Args:
        flights: Sums of places less the fall.
        frames: First frame after each contact, shape (s,).
        when: Of the contacts [s], shape (s, n).
        places: Less the fall, at the contacts [m], shape (s, n, 3).
        weight: Of these in units of a frame's, shape (s, n).
        expected: Slopes [m/s], shape (s, n, 3).
        normals: Shape (s, n, 3).
        along: Weight of the expected slope along the normal [s^2], shape (s, n).
        across: The same in the other directions [s^2].
        sigma: Noise [m], shape (n,).
    """
    w, t = weight[..., None], when[..., None]
    totals = flights.totals[-1] - flights.totals[frames]
    counts = totals[..., 0]
    ones = counts + weight
    times = totals[..., 1] + weight * when
    squares = totals[..., 2] + weight * when**2
    values = totals[..., 3:6] + w * places
    moments = totals[..., 6:9] + w * t * places
    powers = totals[..., 9:] + w * places**2
    span = squares - times**2 / ones
    slope = np.zeros_like(places)
    total = (powers - values**2 / ones[..., None]).sum(axis=-1)
    covariance = moments - (times / ones)[..., None] * values
    normal = (covariance * normals).sum(axis=-1)[..., None] * normals
    wanted = (expected * normals).sum(axis=-1)[..., None] * normals
    for part, goal, prior in (
        (normal, wanted, along[..., None]),
        (covariance - normal, expected - wanted, across[..., None]),
    ):
        own = (part + prior * goal) / (span[..., None] + prior)
        slope += own
        # residuals of places and of the slope, at the best slope
        total += (own**2 * span[..., None] - 2.0 * own * part + prior * (own - goal) ** 2).sum(-1)
    origin = (values - slope * times[..., None]) / ones[..., None]
    errors = sigma / np.sqrt(span + np.minimum(along, across))
    seen = counts > 0.5
    cost = np.where(seen, np.maximum(total, 0.0) / sigma**2, np.inf)
    return Flight(cost, origin, slope, counts.astype(np.int64), errors)
