# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Units and axes of a tracker: turned by options, and looked at by free fall.

Short parabolas through the samples give accelerations. Where enough of them are as large as each
other and point the same way, balls fall there: by their size the unit of length is found, by their
direction the axis that points up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..decoded_topic import DecodedTopic
from ...data.tracks import known_rotations, Track
from ...errors import UserError
from ...scenes.scene import Scene
from ...scenes.state import Array, quaternion_multiply

# rows: the scene's x, y, z by the tracker's axes, right-handed; the named axis becomes z
AXES: dict[str, tuple[tuple[int, int, int], ...]] = {
    'z': ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    'y': ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    'x': ((0, 1, 0), (0, 0, 1), (1, 0, 0)),
    '-z': ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
    '-y': ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    '-x': ((0, 1, 0), (0, 0, -1), (-1, 0, 0)),
}
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


def turned(track: Track, scale: float, up: str) -> Track:
    """The track in metres, with z up.

    Args:
        track: Track in the tracker's units and axes.
        scale: Metres in a unit of the tracker.
        up: Axis of the tracker that points up, of `AXES`.
    """
    matrix = np.array(AXES[up], dtype=np.float64)
    rotations = track.quaternions
    if rotations is not None:
        rotations = known_rotations(quaternion_multiply(_quaternion(matrix), rotations))
    return replace(track, positions=scale * track.positions @ matrix.T, quaternions=rotations)


def turned_frames(decoded: DecodedTopic, scale: float, up: str) -> DecodedTopic:
    """The frames of a topic in metres, with z up; arguments as in `turned`."""
    if (scale, up) == (1.0, 'z'):
        return decoded
    matrix = np.array(AXES[up], dtype=np.float64)
    turn = _quaternion(matrix)

    def found(poses: Array) -> Array:
        rotations = quaternion_multiply(turn, poses[:, 3:])
        return np.concatenate([scale * poses[:, :3] @ matrix.T, rotations], axis=1)

    frames = [replace(frame, poses=found(frame.poses)) for frame in decoded.frames]
    return replace(decoded, frames=frames)


def check_fall(
    tracks: Sequence[Track], scene: Scene, noise: float, where: str, remedy: str = 'give'
) -> None:
    """Compare free fall with gravity of the scene.

    Args:
        tracks: Tracks of one file, in metres and with z up as far as is known.
        scene: Gives gravity and radius.
        noise: Standard deviation of each coordinate.
        where: Begins the message.
        remedy: What comes before the options in the message.

    Raises:
        UserError: Balls fall with another acceleration, or along another axis; the message names
            the options that repair it.
    """
    gravity = float(np.linalg.norm(scene.gravity))
    fall = _free_fall(tracks, noise)
    if fall is not None and gravity:
        size = float(np.linalg.norm(fall))
        scales = [s for s in _UNITS if _LIGHT <= s * size / gravity <= _HEAVY]
        if size > 2 * gravity and scales:
            # millimetres before the others where drag leaves a doubt
            scale = min(scales, key=lambda s: abs(np.log(s * size / gravity)))
            raise UserError(
                f'{where}: balls fall with {size:.4g} a second squared, expected about '
                f'{gravity:.3g} m/s^2, so positions seem to be in {_UNITS[scale]}; {remedy} '
                f'--scale {scale:g}{_axis_option(fall, scene)}'
            )
        if _LIGHT <= size / gravity <= _HEAVY and _cosine(fall, scene.gravity) < _ALONG:
            option = _axis_option(fall, scene).strip()
            turn = f'{remedy} {option}' if option else "turn the scene's gravity and surfaces"
            raise UserError(
                f'{where}: balls fall along ({", ".join(f"{v / size:.2f}" for v in fall)}), '
                f'expected along ({", ".join(f"{v / gravity:.2f}" for v in scene.gravity)}) as '
                f'gravity of the scene; {turn}'
            )


def check_speed(tracks: Sequence[Track], scene: Scene, where: str) -> None:
    """Compare speeds with those of balls.

    Raises:
        UserError: They are larger; the message names the option that repairs it.
    """
    gravity = float(np.linalg.norm(scene.gravity))
    bound = max(_FAST, _FROUDE * float(np.sqrt(gravity * np.max(scene.radius))))
    if (speed := _usual_speed(tracks)) > bound:
        # millimetres are the most common, unless balls would hardly move
        scale = 0.001 if 0.001 * speed > _SLOW else 0.01
        raise UserError(
            f'{where}: balls move with {speed:.4g} m/s, expected under {bound:.4g} m/s; are '
            f'positions in {_UNITS[scale]}? then give --scale {scale:g}'
        )


def _free_fall(tracks: Sequence[Track], noise: float) -> Array | None:
    """Acceleration of falling balls [m/s^2], shape (3,); None where no fall is seen."""
    found = [np.zeros((0, 3))]
    for track in tracks:
        for sphere in range(len(track.spheres)):
            found.append(_accelerations(*track.samples(sphere), noise))
    values = np.concatenate(found)
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


def _accelerations(times: Array, places: Array, noise: float) -> Array:
    """Accelerations of parabolas that fit and are well known [m/s^2], shape (w, 3)."""
    if len(times) < _LEAST:
        return np.zeros((0, 3))
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
    kept: Array = found[fits]
    return kept


def _usual_speed(tracks: Sequence[Track]) -> float:
    """Speed that one step in a hundred exceeds [m/s]."""
    speeds = [np.zeros(1)]
    for track in tracks:
        for sphere in range(len(track.spheres)):
            times, places = track.samples(sphere)
            speeds.append(np.linalg.norm(np.diff(places, axis=0), axis=1) / np.diff(times))
    return float(np.quantile(np.concatenate(speeds), 0.99))


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


def _quaternion(matrix: Array) -> Array:
    """Quaternion (x, y, z, w) of a rotation by a multiple of a quarter turn about each axis."""
    # q q^T from the matrix: the column of its largest diagonal entry is a multiple of q
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    outer = np.array(
        [
            [1 + a - e - i, b + d, c + g, h - f],
            [b + d, 1 - a + e - i, f + h, c - g],
            [c + g, f + h, 1 - a - e + i, d - b],
            [h - f, c - g, d - b, 1 + a + e + i],
        ]
    )
    column = outer[int(np.argmax(np.diag(outer)))]
    unit: Array = column / np.linalg.norm(column)
    return unit
