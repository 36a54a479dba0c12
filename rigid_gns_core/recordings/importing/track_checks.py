# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is wrong with a track: too few samples, no motion, repeats, jumps, behind a surface."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...data.csv_tracks import CsvTrack
from ...scenes.placement import depths
from ...scenes.scene import Scene
from ...scenes.state import Array

# least number of samples of the sphere seen most
_SAMPLES = 3
# a track in which no sphere goes further shows no motion [radii]
_MOTION = 0.25
# a repeated pose is one where the sphere should have moved this far [radii]; so many are refused
_STILL, _REPEATS, _REPEATED = 0.05, 3, 0.02
# and further than this [steps between two places that the tracker knows]
_COARSE = 2.0
# a sphere jumps where it moves further than this [radii], and so many times as fast as beside it
_JUMP, _FASTER = 2.0, 4.0
# it is in two places where it returns to within this part of a step, in so many of its steps
_RETURN, _RETURNS, _RETURNED = 0.3, 3, 0.1
# a centre this deep behind an endless surface or in an obstacle does not fit the scene [radii];
# a tracker's frame, and so a surface, may be tilted by this [rad], and fewer places may be false
_BEHIND, _TILT, _FALSE = 0.2, 0.03, 3


class _Samples(NamedTuple):
    """One sphere of a track.

    Args:
        times: Times at which it was seen [s], shape (k,).
        places: Centres [m], shape (k, 3).
        radius: Radius [m].
        scene: Surfaces and gravity.
        noise: Standard deviation of each coordinate [m].
    """

    times: Array
    places: Array
    radius: float
    scene: Scene
    noise: float


# index of the offending sample, and what is wrong with it
_Found = tuple[int, str] | None


def problem_of(one: CsvTrack, scene: Scene, noise: float, radii: Array) -> str | None:
    """What is wrong with a track, with file, line, track, sphere, bound and remedy; None: nothing.

    Args:
        one: Track in metres, z up.
        scene: Surfaces and gravity.
        noise: Standard deviation of each coordinate [m].
        radii: Radius of each of its spheres [m], shape (n,).
    """
    track = one.track
    counts = track.seen.sum(axis=0)
    if (most := int(counts.max())) < _SAMPLES:
        return (
            f'{one.file} line {one.lines.max()}: track {track.name} has {most} '
            f'sample{"s" if most > 1 else ""} of a sphere, expected at least {_SAMPLES}; remove '
            'it, or record for longer'
        )
    ways = [_extent(track.samples(sphere)[1]) for sphere in range(len(radii))]
    furthest = int(np.argmax(ways / radii))
    for index, label in enumerate(track.spheres):
        own = _Samples(*track.samples(index), float(radii[index]), scene, noise)
        for check in _CHECKS:
            if found := check(own):
                line = one.lines[track.seen[:, index], index][found[0]]
                return f'{one.file} line {line}: track {track.name}, sphere {label}: {found[1]}'
    if ways[furthest] < _MOTION * radii[furthest]:
        return (
            f'{one.file} line {one.lines[one.lines > 0].min()}: track {track.name} shows no '
            f'motion: no sphere goes further than {ways[furthest]:.3g} m, expected at least '
            f'{_MOTION * radii[furthest]:.3g} m, {_MOTION:g} radii; remove it'
        )
    return None


def _extent(places: Array) -> float:
    """Largest extent of centres along an axis [m]."""
    return float(np.ptp(places, axis=0).max()) if len(places) else 0.0


def _two_places(own: _Samples) -> _Found:
    """A sphere that goes to and fro between two places."""
    steps = np.linalg.norm(np.diff(own.places, axis=0), axis=1)
    back = np.linalg.norm(own.places[2:] - own.places[:-2], axis=1)
    shorter = np.minimum(steps[1:], steps[:-1])
    returns = np.flatnonzero((shorter > _JUMP * own.radius) & (back < _RETURN * shorter))
    if len(returns) < max(_RETURNS, _RETURNED * len(own.times)):
        return None
    return int(returns[0]) + 1, (
        f'it is in two places, {steps[returns[0]]:.3g} m apart, and goes to and fro between them '
        f'{len(returns)} times, expected fewer than {_RETURNS}; two balls have one number: give '
        'each its own'
    )


def _jump(own: _Samples) -> _Found:
    """A step that is much faster than those beside it."""
    spans, steps = np.diff(own.times), np.linalg.norm(np.diff(own.places, axis=0), axis=1)
    if len(steps) < 3:
        return None
    speeds = steps / spans
    beside = np.maximum(np.append(0.0, speeds[:-1]), np.append(speeds[1:], 0.0))
    # what gravity and a blow add while nothing is seen, and the noise of the steps beside
    fall = float(np.linalg.norm(own.scene.gravity)) * spans
    bound = _JUMP * own.radius + _FASTER * (beside + fall) * spans + 10.0 * own.noise
    found = np.flatnonzero(steps > bound)
    if not len(found):
        return None
    place = int(found[0])
    return place + 1, (
        f'it jumps {steps[place]:.3g} m in {1e3 * spans[place]:.3g} ms, expected at most '
        f'{bound[place]:.3g} m beside the steps around; give another ball its own number, and '
        'begin a new track where the tracker jumps'
    )


def _repeats(own: _Samples) -> _Found:
    """The same pose with a new stamp, while the sphere moves."""
    times, places = own.times, own.places
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    begins = np.append(0, np.flatnonzero(steps > 0) + 1)  # of runs of one pose
    if len(begins) < 3:
        return None
    ends = np.append(begins[1:] - 1, len(times) - 1)
    # from run to run the mean speed, whichever sample of a run is the true one
    speeds = np.linalg.norm(np.diff(places[begins], axis=0), axis=1) / np.diff(times[begins])
    slower = np.minimum(speeds[1:], speeds[:-1])
    way = slower * (times[ends] - times[begins])[1:-1]
    # a coarse tracker says the same place until the next one it knows is nearer
    apart = np.abs(np.diff(places, axis=0))
    bound = max(_STILL * own.radius, _COARSE * float(apart[apart > 0].min()))
    repeated = np.flatnonzero(way > bound) + 1
    count = int((ends - begins)[repeated].sum())
    if count < max(_REPEATS, _REPEATED * len(times)):
        return None
    first = int(begins[repeated[0]]) + 1
    still = f'{way[repeated[0] - 1]:.3g} m, expected under {bound:.3g} m'
    return first, (
        f'{count} of {len(times)} samples repeat the one before with a new stamp, while it moves '
        f'on by {still}; leave out rows that hold no new measurement'
    )


def _behind(own: _Samples) -> _Found:
    """A centre behind an endless surface, or inside an obstacle."""
    allowed = _BEHIND * own.radius + 5.0 * own.noise
    if not len(own.places):
        return None
    for (where, depth), (_, past) in zip(
        depths(own.scene, own.places), depths(own.scene, own.places, _TILT), strict=True
    ):
        place = int(past.argmax())
        if (past > allowed).sum() >= _FALSE:
            bound = allowed + depth[place] - past[place]
            far = depth[place] > 100 * own.radius
            remedy = (
                'give --scale or --up where units or axes differ'
                if far
                else f"move the scene's {where.split()[1]}, or the tracker's origin"
            )
            return place, (
                f'its centre is {depth[place]:.3g} m {where} of the scene, '
                f'expected at most {bound:.3g} m; {remedy}, or name the right --scene'
            )
    return None


_CHECKS: tuple[Callable[[_Samples], _Found], ...] = (_two_places, _jump, _repeats, _behind)
