# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracks cut into stretches of one ball, each with a start of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..data.tracks import Track
from ..scenes.scene import Scene
from ..scenes.state import Array
from ..tracking.ball_contact import FREE
from ..tracking.ball_model import BallModel, surface_under
from ..tracking.held import held
from ..tracking.kinks import kinks

# a stretch is no longer than this [s]: what the laws do not know grows with time
LONGEST = 0.7
FEWEST = 8
# a shorter piece tells little but what is unknown at its ends [s]
_SHORTEST = 0.15
# a ball that is not seen for longer may have touched anything [s]
_LOST = 0.25
# a velocity shows in this time [s]; an edge is moved by so much at most [s], to be clearer of
# surfaces by this [m], where it is closer than this [m]
_SHOWS, _SHIFT, _CLEARER, _CLOSE = 0.08, 0.12, 0.01, 0.03
# two balls nearer than this many sums of radii may have touched
_NEAR = 1.04


@dataclass(frozen=True)
class Stretch:
    """Frames of one ball between things that the laws do not know.

    Args:
        track: Number of the track, the unit of cross-validation.
        sphere: Number of the sphere in the scene.
        times: Times [s], shape (m,).
        positions: Centres [m], shape (m, 3).
        on: Surface that the ball is on at the start, or FREE.
    """

    track: int
    sphere: int
    times: Array
    positions: Array
    on: int


def pieces(
    tracks: Sequence[Track],
    scene: Scene,
    spheres: Sequence[str],
    models: Sequence[BallModel],
    noise: float,
) -> list[Stretch]:
    """Tracks cut where a ball was lost, near another, held, or hit by what the scene has not."""
    found = []
    for number, track in enumerate(tracks):
        for column, label in enumerate(track.spheres):
            sphere = spheres.index(label) if label in spheres else 0
            times, positions = track.samples(column)
            model = models[min(sphere, len(models) - 1)]
            mass = float(scene.per_sphere('mass', max(len(spheres), 1))[sphere])
            away = _near_others(track, column, scene, len(spheres))[track.seen[:, column]]
            away |= held(model, mass, times, positions, noise)
            edges = np.flatnonzero(np.diff(times) > _LOST) + 1
            changes = np.flatnonzero(np.diff(away.astype(int))) + 1
            hits = kinks(model, times, positions, noise)
            cuts = sorted({0, len(times), *edges, *changes, *hits})
            for begin, end in pairwise(cuts):
                long = end - begin >= FEWEST and times[end - 1] - times[begin] >= _SHORTEST
                if long and not away[begin]:
                    found.append(
                        Stretch(number, sphere, times[begin:end], positions[begin:end], FREE)
                    )
    return found


def stretches(
    found: Sequence[Stretch], models: Sequence[BallModel], noise: float, longest: float = LONGEST
) -> list[Stretch]:
    """Pieces cut into stretches of about equal length, at most `longest` seconds and a little.

    None begins just before an impact, of which the first frames would tell no velocity.
    """
    cut = []
    for piece in found:
        times = piece.times
        model = models[min(piece.sphere, len(models) - 1)]
        count = max(1, int(np.ceil((times[-1] - times[0]) / longest - 1e-9)))
        clear = _clearance(model, times, piece.positions)
        edges = [
            _clearest(times, clear, edge) for edge in np.linspace(times[0], times[-1], count + 1)
        ]
        edges[-1] = times[-1]
        for begin, end in pairwise(edges):
            inside = (times >= begin - 1e-9) & (times <= end + 1e-9)
            if inside.sum() < FEWEST:
                continue
            places = piece.positions[inside]
            on = surface_under(model, times[inside], places, noise)
            cut.append(Stretch(piece.track, piece.sphere, times[inside], places, on))
    return cut


def _clearance(model: BallModel, times: Array, positions: Array) -> Array:
    """Least distance from a surface in the time after each frame in which a velocity shows [m]."""
    heights = model.heights(positions).min(axis=0, initial=np.inf)
    ends = np.searchsorted(times, times + _SHOWS)
    return np.array([heights[i : max(end, i + 1)].min() for i, end in enumerate(ends)])


def _clearest(times: Array, clear: Array, edge: float) -> float:
    """Time of the frame near an edge from which the ball stays clearest of surfaces."""
    near = np.flatnonzero(np.abs(times - edge) <= _SHIFT)
    if not len(near):
        return edge
    best = near[int(np.argmax(clear[near]))]
    now = clear[near[int(np.abs(times[near] - edge).argmin())]]
    # a ball that rolls, or rests, is as close to its surface everywhere
    return float(times[best]) if now < _CLOSE and clear[best] - now > _CLEARER else edge


def _near_others(track: Track, column: int, scene: Scene, count: int) -> np.ndarray:
    """Whether another ball is near, in each frame; places in between are interpolated."""
    near = np.zeros(len(track.times), dtype=bool)
    if len(track.spheres) < 2:
        return near
    places = []
    for other in range(len(track.spheres)):
        times, positions = track.samples(other)
        if len(times) < 2:
            places.append(np.full((len(track.times), 3), np.inf))
            continue
        places.append(
            np.stack([np.interp(track.times, times, positions[:, a]) for a in range(3)], axis=1)
        )
    radii = scene.per_sphere('radius', max(count, 1))
    for other in range(len(track.spheres)):
        if other != column:
            distance = np.linalg.norm(places[other] - places[column], axis=1)
            near |= distance < _NEAR * 2.0 * float(radii.max())
    return near
