# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where balls that roll or rest show that a surface is, without a fit.

A ball that rolls further above a surface than the tracker's noise would be taken for one that
flies, and gravity be fitted to its straight path. A tilt of half a degree is 3 cm after 4 m.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from .parameters import WALL
from ..data.tracks import Track
from ..scenes.plane import Plane
from ..scenes.scene import Scene
from ..scenes.state import Array

# frames that show whether a ball stays on a surface: of this time [s], so many at least
_WINDOW, _FEWEST = 0.25, 6
# it stays where its height is a line: the acceleration [g], its deviation [g], what the line
# leaves [deviations of the noise], [radii], and the ascent [horizontal speed], [m/s]
_LEVEL, _TOLD, _NOISE, _SMOOTH, _ASCENT, _CREEP = 0.25, 0.15, 1.5, 0.02, 0.1, 0.03
# a surface is at most so far from where it is given to be [radii], [distance from its point]
_FAR, _STEEP = 0.5, 0.03
# a ball that moved by less than this since it was last counted tells nothing more [radii]
_MOVED = 0.5
# places and tracks that tell a surface, and the part of the places that must agree
_PLACES, _TRACKS, _AGREE = 8, 3, 0.6
# rounds of the robust fit of a plane; deviations beyond which a place does not agree
_ROUNDS, _APART = 20, 3.0


def placed_surfaces(
    scene: Scene, tracks: Sequence[Track], labels: Sequence[str], noise: float
) -> tuple[Scene, tuple[str, ...]]:
    """The scene with carrying surfaces where balls that stay on them show them.

    Only a surface that is so far off that such balls would be taken for flying ones is moved.

    Args:
        scene: Scene as given.
        tracks: Stamped positions.
        labels: Labels of the scene's spheres in the tracks.
        noise: Standard deviation of a coordinate [m].

    Returns:
        The scene, and what was moved, in words.
    """
    radii = scene.per_sphere('radius', max(len(labels), 1))
    planes, notes = list(scene.surfaces), []
    for k, plane in enumerate(scene.surfaces):
        if plane.axes[2] @ scene.up <= WALL or plane.changes_place:
            continue
        places = _places(plane, scene, tracks, labels, noise)
        found = _plane_through(places, float(radii.mean()))
        if found is None:
            continue
        height, x, y = found
        shift = np.abs(height + places[:, 1] * x + places[:, 2] * y)
        if np.quantile(shift, 0.9) <= max(4.0 * noise, 1e-3):
            continue
        axes = plane.axes
        planes[k] = replace(
            plane,
            point=tuple(np.asarray(plane.point) + height * axes[2]),
            normal=tuple(axes[2] - x * axes[0] - y * axes[1]),
        )
        degrees = float(np.degrees(np.arctan(np.hypot(x, y))))
        notes.append(
            f'surface {k}: balls that roll or rest on it show it {1e3 * height:.2g} mm higher at '
            f'its point, tilted by {degrees:.2g} degrees, than given: taken from there'
        )
    return replace(scene, surfaces=tuple(planes)), tuple(notes)


def _places(
    plane: Plane, scene: Scene, tracks: Sequence[Track], labels: Sequence[str], noise: float
) -> Array:
    """Number of the track, place along both axes and height of balls that stay, shape (m, 4)."""
    axes, radii = plane.axes, scene.per_sphere('radius', max(len(labels), 1))
    pull = -float(axes[2] @ np.asarray(scene.gravity))
    found: list[tuple[float, float, float, float]] = []
    if pull <= 0.0:
        return np.zeros((0, 4))
    for number, track in enumerate(tracks):
        for column, label in enumerate(track.spheres):
            radius = float(radii[labels.index(label) if label in labels else 0])
            times, positions = track.samples(column)
            local = (positions - np.asarray(plane.point)) @ axes.T
            local[:, 2] -= radius
            last = None
            for part in _windows(times):
                one = _place_of(times[part], local[part], radius, pull, noise)
                if one is None or not _within(plane, one, radius):
                    continue
                if last is not None and np.linalg.norm(one - last) < _MOVED * radius:
                    continue
                last = one
                found.append((float(number), *one.tolist()))
    return np.array(found).reshape(-1, 4)


def _windows(times: Array) -> Iterator[slice]:
    """Frames that follow each other without a gap, window after window."""
    begin = 0
    while begin < len(times):
        end = int(np.searchsorted(times, times[begin] + _WINDOW))
        end = max(end, begin + _FEWEST)
        if end <= len(times) and times[end - 1] - times[begin] < 2.0 * _WINDOW:
            yield slice(begin, end)
        begin = end


def _place_of(
    times: Array, local: Array, radius: float, pull: float, noise: float
) -> Array | None:
    """Mean place of a ball that stays at one height over a surface; None: it does not."""
    t = times - times.mean()
    basis = np.stack([np.ones_like(t), t, 0.5 * t * t], axis=1)
    heights = local[:, 2]
    curved = np.linalg.lstsq(basis, heights, rcond=None)[0]
    line, off, *_ = np.linalg.lstsq(basis[:, :2], heights, rcond=None)
    if len(t) < _FEWEST or not len(off):
        return None
    third = np.diff(heights, 3)
    noise = max(noise, float(np.sqrt(np.mean(third**2) / 20.0)))
    left = float(np.sqrt(off[0] / (len(t) - 2)))
    told = noise * float(np.sqrt(np.linalg.inv(basis.T @ basis)[2, 2]))
    speeds = np.linalg.lstsq(basis[:, :2], local[:, :2], rcond=None)[0][1]
    climbs = abs(line[1]) > _ASCENT * np.linalg.norm(speeds) + _CREEP + 3.0 * noise / np.ptp(t)
    level = abs(curved[2]) < _LEVEL * pull and told < _TOLD * pull
    if climbs or not level or left > _NOISE * noise + _SMOOTH * radius:
        return None
    place: Array = np.append(local[:, :2].mean(axis=0), line[0])
    far = abs(place[2]) > _FAR * radius + _STEEP * float(np.linalg.norm(place[:2]))
    return None if far else place


def _within(plane: Plane, place: Array, radius: float) -> bool:
    half = (0.5 * (np.inf if one is None else one) for one in (plane.length_x, plane.length_y))
    return all(abs(along) <= most + radius for along, most in zip(place[:2], half, strict=True))


def _plane_through(places: Array, radius: float) -> tuple[float, float, float] | None:
    """Height, and slopes along both axes, that most places agree on; None: too few do."""
    if len(places) < _PLACES or len(set(places[:, 0].tolist())) < _TRACKS:
        return None
    basis = np.column_stack([np.ones(len(places)), places[:, 1:3]])
    heights = places[:, 3]
    weights, found = np.ones(len(places)), np.zeros(3)
    scale = radius
    for _ in range(_ROUNDS):
        # places in a line do not tell a tilt across it
        weak = np.diag([radius, _STEEP, _STEEP]) ** 2
        weighted = basis * weights[:, None]
        matrix = basis.T @ weighted + scale**2 * np.linalg.inv(weak)
        found = np.linalg.solve(matrix, weighted.T @ heights)
        off = np.abs(heights - basis @ found)
        scale = max(1.4826 * float(np.median(off)), 1e-4)
        weights = 1.0 / (1.0 + (off / scale) ** 2)
    agree = float(np.mean(off <= _APART * scale))
    if agree < _AGREE or scale > 0.2 * radius:
        return None
    height, x, y = (float(value) for value in found)
    return height, x, y
