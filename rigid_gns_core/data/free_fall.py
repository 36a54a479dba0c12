# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether tracks are in the units and axes of their scene, told by what falls.

Short parabolas through the samples give accelerations. Where enough of them are as large as each
other and point the same way, balls fall there: by their size the unit of length is found, by their
direction the axis that points up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .tracks import Track
from ..scenes.scene import Scene
from ..scenes.state import Array

_UNITS = {0.001: 'millimetres', 0.01: 'centimetres', 0.0254: 'inches', 0.3048: 'feet'}

# time and least number of samples of a parabola
_TIME, _LEAST = 0.1, 6
# accelerations count if their standard error is below this part of them
_KNOWN = 0.2
# balls fall if so many accelerations have a resultant, and a spread about the median, of this
_FALLS, _RESULTANT, _SPREAD = 3, 0.8, 0.3
# a fall within these bounds is gravity with the drag of a light ball [gravity]
_LIGHT, _HEAVY = 0.5, 1.6
# least cosine between the fall and gravity, and between it and an axis
_ALONG, _AXIS = 0.7, 0.9
# no ball is faster than either [m/s], [sqrt(g r)]
_FAST, _FROUDE = 100.0, 50.0
# and most are faster than this at some time [m/s]
_SLOW = 0.15
# largest drag of a ball over its speed squared [1/m]; that of table tennis is 0.11
_DRAG = 0.25
# gravity of the earth [m/s^2]
_EARTH = 9.81


@dataclass(frozen=True)
class Misfit:
    """What does not fit the scene.

    Args:
        text: What is wrong, with the bound.
        option: Options of `rigid-gns import` that repair it; empty: none does.
        advice: What repairs it where no option does.
    """

    text: str
    option: str = ''
    advice: str = ''


def misfit_of_fall(motions: Array, scene: Scene) -> Misfit | None:
    """Compare free fall with gravity of the scene; None: it fits, or nothing falls.

    Args:
        motions: What `motions_of` found, shape (w, 2, 3).
        scene: Gives gravity.
    """
    gravity = float(np.linalg.norm(scene.gravity))
    fall = _free_fall(motions[:, 0])
    if fall is None or _slowed(motions, scene):
        return None
    size = float(np.linalg.norm(fall))
    direction = ', '.join(f'{v / size:z.2f}' for v in fall)
    if not gravity:
        if not _LIGHT <= size / _EARTH <= _HEAVY:
            return None
        return Misfit(
            f'balls fall along ({direction}) with {size:.3g} m/s^2, but the scene has no gravity',
            advice='give it gravity',
        )
    scales = [s for s in _UNITS if _LIGHT <= s * size / gravity <= _HEAVY]
    if size > 2 * gravity and scales:
        # millimetres before the others where drag leaves a doubt
        scale = min(scales, key=lambda s: abs(np.log(s * size / gravity)))
        return Misfit(
            f'balls fall with {size:.4g} a second squared, expected about {gravity:.3g} m/s^2, '
            f'so positions seem to be in {_UNITS[scale]}',
            f'--scale {scale:g}{_axis_option(fall, scene)}',
        )
    if _LIGHT <= size / gravity <= _HEAVY and _cosine(fall, scene.gravity) < _ALONG:
        return Misfit(
            f'balls fall along ({direction}), expected along '
            f'({", ".join(f"{v / gravity:z.2f}" for v in scene.gravity)}) as gravity of the scene',
            _axis_option(fall, scene).strip(),
            "turn the scene's gravity and surfaces",
        )
    return None


def misfit_of_speed(speeds: Array, scene: Scene) -> Misfit | None:
    """Compare speeds with those of balls; None: they fit.

    Args:
        speeds: Of steps between samples [m/s], shape (k,).
        scene: Gives gravity and radius.
    """
    gravity = float(np.linalg.norm(scene.gravity))
    bound = max(_FAST, _FROUDE * float(np.sqrt(gravity * np.max(scene.radius))))
    # one step in a hundred may be a jump
    speed = float(np.quantile(speeds, 0.99)) if len(speeds) else 0.0
    if speed <= bound:
        return None
    # millimetres are the most common, unless balls would hardly move
    scale = 0.001 if 0.001 * speed > _SLOW else 0.01
    return Misfit(
        f'balls move with {speed:.4g} m/s, expected under {bound:.4g} m/s; are positions in '
        f'{_UNITS[scale]}?',
        f'--scale {scale:g}',
    )


def motions_of(tracks: Sequence[Track], noise: float) -> Array:
    """Accelerations and velocities of short parts of tracks that are parabolas, (w, 2, 3)."""
    found = [np.zeros((0, 2, 3))]
    for track in tracks:
        for sphere in range(len(track.spheres)):
            found.append(parabolas(*track.samples(sphere), noise))
    return np.concatenate(found)


def speeds_of(tracks: Sequence[Track]) -> Array:
    """Speeds between consecutive samples of each sphere [m/s], shape (k,); see `step_speeds`."""
    speeds = [np.zeros(0)]
    for track in tracks:
        speeds += [step_speeds(*track.samples(sphere)) for sphere in range(len(track.spheres))]
    return np.concatenate(speeds)


def step_speeds(times: Array, places: Array) -> Array:
    """Speeds between consecutive samples [m/s], shape (m - 1,).

    No interval counts as shorter than the median: stamps that jitter come near to each other.

    Args:
        times: Rising times [s], shape (m,).
        places: Centres [m], shape (m, 3).
    """
    if len(times) < 2:
        return np.zeros(0)
    intervals = np.diff(times)
    intervals = np.maximum(intervals, np.median(intervals))
    return np.asarray(np.linalg.norm(np.diff(places, axis=0), axis=1) / intervals)


def _free_fall(values: Array) -> Array | None:
    """Acceleration of falling balls [m/s^2], shape (3,); None where no fall is seen."""
    sizes = np.linalg.norm(values, axis=1)
    if len(values) < _FALLS:
        return None
    middle = float(np.median(sizes))
    spread = float(np.median(np.abs(sizes - middle))) / middle
    resultant = float(np.linalg.norm((values / sizes[:, None]).mean(axis=0)))
    if resultant < _RESULTANT or spread > _SPREAD:
        return None
    usual: Array = np.median(values, axis=0)
    return usual


def _slowed(motions: Array, scene: Scene) -> bool:
    """Whether gravity of the scene and drag explain the accelerations, as those of a smash."""
    accelerations, velocities = motions[:, 0], motions[:, 1]
    others = accelerations - scene.gravity
    drags = np.linalg.norm(velocities, axis=1, keepdims=True) * velocities
    along = -(others * drags).sum(axis=1) / np.maximum((drags**2).sum(axis=1), 1e-300)
    left = others + np.clip(np.median(along), 0.0, _DRAG) * drags
    return bool(np.median(np.linalg.norm(left, axis=1)) < _LIGHT * _EARTH)


def parabolas(times: Array, places: Array, noise: float) -> Array:
    """Accelerations [m/s^2] and velocities [m/s] of parabolas that fit, shape (w, 2, 3).

    Only those whose accelerations are well known.

    Args:
        times: Rising [s], shape (k,).
        places: Centres [m], shape (k, 3).
        noise: Standard deviation of each coordinate [m].
    """
    if len(times) < _LEAST:
        return np.zeros((0, 2, 3))
    count = max(_LEAST, round(_TIME / float(np.median(np.diff(times)))) + 1)
    starts = np.arange(0, len(times) - count + 1, max(count // 2, 1))
    pick = starts[:, None] + np.arange(count)
    t, p = times[pick], places[pick]
    span = np.ptp(t, axis=1)
    t = (t - t.mean(axis=1, keepdims=True)) / span[:, None]
    basis, triangle = np.linalg.qr(np.stack([np.ones_like(t), t, t**2], axis=-1))
    p = p - p.mean(axis=1, keepdims=True)
    parts = basis.transpose(0, 2, 1) @ p
    left = np.sqrt(((p - basis @ parts) ** 2).sum(axis=(1, 2)) / (3 * (count - 3)))
    # p = ... + (a T^2 / 2) t^2 with t in units of the span T
    curve = triangle[:, 2, 2, None]
    found = 2.0 * parts[:, 2] / curve / span[:, None] ** 2
    way = np.linalg.norm(np.diff(p, axis=1), axis=2).sum(axis=1)
    error = 2.0 * np.maximum(left, noise) / np.abs(curve[:, 0]) / span**2
    size = np.linalg.norm(found, axis=1)
    fits = (left <= 3.0 * noise + 1e-3 * way) & (error <= _KNOWN * size) & (size > 0)
    velocities = (p[:, -1] - p[:, 0]) / span[:, None]
    kept: Array = np.stack([found, velocities], axis=1)[fits]
    return kept


def _axis_option(fall: Array, scene: Scene) -> str:
    """` --up AXIS` where the fall is along an axis of the tracker other than gravity's."""
    if _cosine(fall, scene.gravity) >= _ALONG:
        return ''
    along = -fall / np.linalg.norm(fall)
    axis = int(np.argmax(np.abs(along)))
    if abs(along[axis]) < _AXIS or scene.up[2] < _AXIS:
        return ''
    # a sign would be read as an option without the equals sign
    return f' --up{"=-" if along[axis] < 0 else " "}{"xyz"[axis]}'


def _cosine(fall: Array, gravity: Sequence[float]) -> float:
    return float(fall @ np.asarray(gravity) / np.linalg.norm(fall) / np.linalg.norm(gravity))
