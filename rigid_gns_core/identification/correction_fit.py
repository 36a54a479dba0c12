# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Correction of estimated starts, learned from what forecasts of left-out tracks missed.

A Gaussian process over what starts look like (`tracking.start_correction`). What forecast i missed
at its horizons, y_i, has slopes J_i over one unit of each part of the correction of its start:

    y_i = J_i (c(x_i) + t + r_i) + e_i,    cov(c(x), c(x')) = k(x, x') g^2 1

with t of a track, r_i of a start, and e_i of the noise and of an acceleration that the laws leave
open. So it is one correction of the start that all horizons share, through contacts, and starts of
one track, which miss alike, count less than as many tracks. A forecast that misses by many
deviations (a net) counts less, too. The mean of c is a sum of kernels.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from .left_out import CLOSE, Part, starts
from .parameters import Laws
from ..scenes.correction import Correction, PARTS
from ..scenes.state import Array
from ..tracking.ball_contact import FREE
from ..tracking.ball_estimate import forecast_ball
from ..tracking.start_correction import features_of, kernel, roots_of, StartCorrection

# most starts of all
_MOST = 400
# b, f [m/s], see `start_correction`; with half and with twice these, errors on left-out tracks are
# 1 to 2 % larger
_BANDWIDTH, _FLOOR = 0.5, 0.05
# deviations of c, t and r
_OF_ALL, _OF_TRACK, _OF_START = 1.5, 0.5, 1.0
# deviation of e: of the noise, and of an acceleration [m/s^2]
_NOISES, _ACCELERATION = 3.0, 0.3
# least unit of distance of position [m], velocity, spin [m/s] and logarithm
_SCALES = np.array([0.01] * 3 + [0.05] * 7)


@dataclass(frozen=True)
class Missed:
    """One start, and what the forecast from it missed at h horizons.

    Args:
        track: Number of the track.
        features: What it looks like, shape (10,).
        slopes: Of the positions over one unit of each part of a correction [m], shape (3 h, 6).
        missed: Position less forecast [m], shape (3 h,).
        leads: Times ahead [s], shape (3 h,).
    """

    track: int
    features: Array
    slopes: Array
    missed: Array
    leads: Array


def missed_by(laws: Laws, part: Part, noise: Array, memory: float) -> Iterator[Missed]:
    """What forecasts of left-out pieces of tracks miss, from all that start in flight."""
    for start in starts(laws, part, noise, memory, CLOSE):
        one, estimate = start.piece, start.estimate
        if estimate.on != FREE:
            continue
        stamps, radius = one.times[start.frames], np.array([start.model.radius])
        ahead = forecast_ball(start.model, estimate, start.time, stamps)
        state, covariance = estimate.state[None], estimate.covariance[None]
        root = roots_of(state, covariance, radius, _FLOOR)[0]
        yield Missed(
            track=one.track,
            features=features_of(state, covariance, radius)[0],
            slopes=(ahead.slopes[:, :3, 3:] @ root).reshape(-1, PARTS),
            missed=(one.positions[start.frames] - ahead.states[:, :3]).ravel(),
            leads=np.repeat(stamps - start.time, 3),
        )


class CorrectionFit:
    """The correction that some starts make, and that without some tracks.

    Args:
        found: What forecasts missed; of more than `_MOST` they are taken evenly.
        noise: Standard deviation of a coordinate [m].
    """

    def __init__(self, found: Sequence[Missed], noise: float) -> None:
        if len(found) > _MOST:
            found = [found[k] for k in np.linspace(0, len(found) - 1, _MOST).astype(int)]
        self.tracks = np.array([one.track for one in found])
        self.features = np.array([one.features for one in found])
        self.scales = np.maximum(self.features.std(axis=0), _SCALES)
        self._slopes = np.concatenate([one.slopes for one in found])
        self._of = np.repeat(np.arange(len(found)), [len(one.missed) for one in found])
        shared = self._slopes @ self._slopes.T
        placed = self.features / self.scales
        alike = kernel(placed, placed, _BANDWIDTH)[np.ix_(self._of, self._of)]
        own = self._of[:, None] == self._of
        leads = np.concatenate([one.leads for one in found])
        open_ = (_NOISES * noise) ** 2 + (0.5 * _ACCELERATION * leads**2) ** 2
        alone = _OF_START**2 * shared * own + np.diag(open_)
        track = self.tracks[self._of]
        common = _OF_ALL**2 * shared * alike + _OF_TRACK**2 * shared * (track[:, None] == track)
        missed = np.concatenate([one.missed for one in found])
        far = np.ones(len(found))
        for k in range(len(found)):
            rows = np.ix_(self._of == k, self._of == k)
            y = missed[self._of == k]
            far[k] = max(1.0, y @ np.linalg.solve((common + alone)[rows], y) / len(y))
        self._inverse = np.linalg.inv(common + alone * far[self._of])
        self._solved = self._inverse @ missed

    def whole(self) -> StartCorrection:
        """The correction by all starts."""
        return self._correction(self._solved)

    def without(self, *tracks: int) -> StartCorrection:
        """The correction by all tracks but some, of which the fit is not made anew.

        With the inverse M of the covariance, out the rows of these and in the others, the
        solution without them is a_in - M_in,out M_out,out^-1 a_out.
        """
        out = np.isin(self.tracks[self._of], tracks)
        solved = np.where(out, 0.0, self._solved)
        inner = np.linalg.solve(self._inverse[np.ix_(out, out)], self._solved[out])
        solved[~out] -= self._inverse[np.ix_(~out, out)] @ inner
        return self._correction(solved)

    def _correction(self, solved: Array) -> StartCorrection:
        weights = np.zeros((len(self.features), PARTS))
        np.add.at(weights, self._of, self._slopes * solved[:, None])
        weights *= _OF_ALL**2
        return StartCorrection(self.features, weights, self.scales, _BANDWIDTH, _FLOOR)


def kept(correction: StartCorrection) -> Correction:
    """What a scene keeps of a correction."""
    rows = np.concatenate([correction.features, correction.weights], axis=1)
    return Correction(
        windows=tuple(tuple(_short(value) for value in row) for row in rows),
        scales=tuple(_short(value) for value in correction.scales),
        bandwidth=correction.bandwidth,
        floor=correction.floor,
    )


def _short(value: float) -> float:
    return float(f'{value:.4g}')
