"""Least-squares lines through all stretches of a window at once, by sums from its beginning."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rigid_gns_core.state import Array


class Lines(NamedTuple):
    """Lines value = origin + slope t through s stretches of n spheres.

    Args:
        origins: Values at time 0, shape (s, n, d).
        slopes: Shape (s, n, d).
        misfits: Sums of squared residuals over frames, shape (s, n, d).
        counts: Number of frames seen, shape (s, n).
        middles: Mean time of these [s], shape (s, n).
        spans: Sum of squared distances in time from it [s^2], shape (s, n).
    """

    origins: Array
    slopes: Array
    misfits: Array
    counts: Array
    middles: Array
    spans: Array


@dataclass(frozen=True)
class Sums:
    """Sums over the frames before each one.

    Args:
        totals: Of weights, times, squared times, values, times times values and squared values, in
            one array as one sum is faster than six; shape (frames + 1, n, 3 + 3 * 3).
    """

    totals: Array

    @classmethod
    def of(cls, times: Array, values: Array, weights: Array) -> Sums:
        """Sums of values of shape (frames, n, 3) with weights 0 or 1, shape (frames, n)."""
        totals = np.zeros((len(times) + 1, *weights.shape[1:], 12))
        terms, t = totals[1:], times[:, None]
        terms[..., 0] = weights
        np.multiply(weights, t, out=terms[..., 1])
        np.multiply(terms[..., 1], t, out=terms[..., 2])
        np.multiply(values, weights[..., None], out=terms[..., 3:6])
        np.multiply(terms[..., 3:6], t[..., None], out=terms[..., 6:9])
        np.multiply(terms[..., 3:6], values, out=terms[..., 9:])
        np.cumsum(terms, axis=0, out=terms)
        return cls(totals)

    @property
    def counts(self) -> Array:
        """Number of frames seen before each, shape (frames + 1, n)."""
        return self.totals[..., 0]

    @property
    def powers(self) -> Array:
        """Sums of squared values, shape (frames + 1, n, 3)."""
        return self.totals[..., 9:]

    def part(self, spheres: NDArray[np.int64]) -> Sums:
        """Those of some spheres."""
        return Sums(self.totals[:, spheres])

    def lines(self, begin: NDArray[np.int64], end: NDArray[np.int64]) -> Lines:
        """Lines through frames `begin` to `end`, `end` not included; both of shape (s,)."""
        totals = self.totals[end] - self.totals[begin]
        ones, first, second = (totals[..., index] for index in range(3))
        values, moments, powers = totals[..., 3:6], totals[..., 6:9], totals[..., 9:]
        count = np.maximum(ones, 1.0)
        middle = first / count
        span = np.where(ones > 1.5, second - first * middle, 0.0)
        mean = values / count[..., None]
        covariance = moments - middle[..., None] * values
        slope = covariance / np.where(span > 0, span, np.inf)[..., None]
        misfit = np.maximum(powers - values * mean - slope * covariance, 0.0)
        return Lines(mean - slope * middle[..., None], slope, misfit, ones, middle, span)


def tail_frames(count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First frame, and the one after the last, of each tail of two frames or more."""
    begin = np.arange(count - 1)
    return begin, np.full(count - 1, count)
