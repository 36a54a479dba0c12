# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stamps of arrival, put back on the clock of the camera where one shows.

A camera of constant rate takes frame k at t0 + k T. Its frames arrive late by a time that varies,
and some are lost: t = t0 + k T + jitter, with k rising by one or more. T is that of all tracks of
a file, t0 of each track. The stamps are replaced only where the motion says so: short parabolas
through the positions must fit clearly better on the clock than on the stamps, since stamps that
are irregular may well be true.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...data.tracks import Track
from ...scenes.state import Array

# stamps with more jitter than this show no clock [periods]; without one it is 0.29
_JITTER = 0.2
# stamps with less are on the clock already, but for their last digit [periods]
_EXACT = 5e-3
# samples of a parabola, and gain of the loop that follows the clock
_WINDOW, _GAIN = 9, 0.1
# most intervals that the period is guessed from
_SPANS = 5000
# the parabolas fit better by this factor in the median, and in so many of them [deviations]
_BETTER, _SIGMAS = 1.1, 4.0
# robust standard deviation of a normal distribution by its median absolute deviation
_MAD = 1.4826


@dataclass(frozen=True)
class CameraClock:
    """What is known of the clock of a file.

    Args:
        period: Time between frames T [s].
        jitter: Standard deviation of the stamps about the clock [s].
        gain: Residual of short parabolas on the stamps, over that on the clock.
        used: Whether the stamps were replaced.
    """

    period: float
    jitter: float
    gain: float
    used: bool

    def __str__(self) -> str:
        clock = f'a clock of {1 / self.period:.6g} Hz, with {1e3 * self.jitter:.2g} ms of jitter'
        if self.used:
            return f'stamps are put on {clock}: the motion fits it {self.gain:.3g} times better'
        return f'stamps are kept: they follow {clock}, but the motion does not fit it better'


def on_camera_clock(tracks: Sequence[Track]) -> tuple[list[Track], CameraClock | None]:
    """Tracks with their times on the clock of the camera, where it is clearly better.

    Args:
        tracks: Tracks of one file, of one tracker.

    Returns:
        The tracks, and the clock; None: the stamps show none, or already are on one.
    """
    stamps = [track.times for track in tracks if len(track.times) > _WINDOW]
    if not stamps:
        return list(tracks), None
    period = _guess(stamps)
    counts = [_follow(times, period) for times in stamps]
    for _ in range(4):
        period, begins = _fit(stamps, counts)
        if not period > 0:
            return list(tracks), None
        counts = [
            _distinct(np.rint((times - begin) / period).astype(np.int64))
            for times, begin in zip(stamps, begins, strict=True)
        ]
    period, begins = _fit(stamps, counts)
    off = np.concatenate(
        [t - b - period * k for t, b, k in zip(stamps, begins, counts, strict=True)]
    )
    jitter = _MAD * float(np.median(np.abs(off)))
    if jitter > _JITTER * period or jitter < _EXACT * period:
        return list(tracks), None
    found, fits = [], []
    parts = iter(zip(begins, counts, strict=True))
    for track in tracks:
        if len(track.times) <= _WINDOW:
            found.append(track)
            continue
        begin, count = next(parts)
        times = period * (count - count[0])
        moved = track.begin + begin + period * float(count[0])
        found.append(replace(track, times=times, begin=moved))
        fits += [
            (_parabolas(track.times[seen], places), _parabolas(times[seen], places))
            for seen, places in _samples(track)
        ]
    by_stamps, by_clock = (np.concatenate(part) for part in zip(*fits, strict=True))
    gain = float(np.median(by_stamps) / max(np.median(by_clock), 1e-300)) if len(by_clock) else 1.0
    wins = int((by_clock < by_stamps).sum())
    clear = wins - len(by_clock) / 2 > _SIGMAS * np.sqrt(len(by_clock)) / 2
    used = bool(clear and gain > _BETTER)
    return (found if used else list(tracks)), CameraClock(period, jitter, gain, used)


def _guess(stamps: list[Array]) -> float:
    """Period by the mean cosine of 2 pi (t_(i+lag) - t_i) / T, of longer and longer lags [s].

    The median interval alone is off where frames are lost and others come late.
    """
    usual = float(np.median(np.concatenate([np.diff(times) for times in stamps])))
    best, most = usual, -1.0
    for divisor in (1, 2):  # where most frames are lost, the usual interval is two periods
        period, width = usual / divisor, 0.25
        for power in range(7):
            lag = 2**power
            spans = np.concatenate([times[lag:] - times[:-lag] for times in stamps])
            spans = spans[:: len(spans) // _SPANS + 1]
            if len(spans) < _WINDOW:
                break
            grid = period * (1.0 + width * np.linspace(-1.0, 1.0, 101))
            scores = np.cos(2.0 * np.pi * spans / grid[:, None]).mean(axis=1)
            period, width = float(grid[np.argmax(scores)]), 0.1 / lag
            if lag == 1:
                score = float(scores.max())
        # exact stamps fit half the period just as well
        if score > most + 0.05:
            best, most = period, score
    return best


def _follow(times: Array, period: float) -> NDArray[np.int64]:
    """Number of each frame, shape (m,), by a loop that follows the phase of the clock.

    Rounding each interval alone would slip wherever two neighbours jitter apart.
    """
    counts = np.zeros(len(times), dtype=np.int64)
    phase = float(times[0])
    for index, time in enumerate(times[1:].tolist(), 1):
        steps = round((time - phase) / period)
        error = time - phase - steps * period
        counts[index] = counts[index - 1] + steps
        phase += steps * period + max(_GAIN, 1 / (index + 1)) * error
    return _distinct(counts)


def _distinct(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Rising numbers: of frames that arrive at once, the earlier ones came late."""
    order = np.arange(len(counts))
    rising: NDArray[np.int64] = np.minimum.accumulate((counts - order)[::-1])[::-1] + order
    return rising


def _fit(stamps: list[Array], counts: list[NDArray[np.int64]]) -> tuple[float, list[float]]:
    """Common period and the time of frame 0 of each track [s], by robust least squares."""
    weights = [np.ones(len(times)) for times in stamps]
    period, begins = 0.0, [0.0] * len(stamps)
    for _ in range(5):
        top = bottom = 0.0
        for times, count, weight in zip(stamps, counts, weights, strict=True):
            away = count - np.average(count, weights=weight)
            top += float(np.sum(weight * away * times))
            bottom += float(np.sum(weight * away**2))
        period = top / bottom if bottom > 0 else 0.0
        begins = [
            float(np.average(t - period * k, weights=w))
            for t, k, w in zip(stamps, counts, weights, strict=True)
        ]
        off = [t - b - period * k for t, b, k in zip(stamps, begins, counts, strict=True)]
        spread = _MAD * float(np.median(np.abs(np.concatenate(off)))) or 1e-12
        # Huber's weights at 1.5 deviations
        weights = [1.5 * spread / np.maximum(np.abs(part), 1.5 * spread) for part in off]
    return period, begins


def _samples(track: Track) -> list[tuple[NDArray[np.bool_], Array]]:
    """Where each sphere was seen, shape (m,), and its centres there, shape (k, 3)."""
    seen = track.seen
    return [(own, track.positions[own, sphere]) for sphere, own in enumerate(seen.T)]


def _parabolas(times: Array, places: Array) -> Array:
    """Root mean square residuals of parabolas through samples side by side [m], shape (w,)."""
    windows = len(times) // _WINDOW
    if not windows:
        return np.zeros(0)
    t = times[: windows * _WINDOW].reshape(windows, _WINDOW)
    t = (t - t.mean(axis=1, keepdims=True)) / np.ptp(t, axis=1)[:, None]
    basis, _ = np.linalg.qr(np.stack([np.ones_like(t), t, t**2], axis=-1))
    p = places[: windows * _WINDOW].reshape(windows, _WINDOW, 3)
    p = p - p.mean(axis=1, keepdims=True)
    left = p - basis @ (basis.transpose(0, 2, 1) @ p)
    rms: Array = np.sqrt((left**2).sum(axis=(1, 2)) / (3 * (_WINDOW - 3)))
    return rms
