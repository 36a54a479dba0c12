# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""visualization_msgs/MarkerArray as CDR bytes: spheres, paths and surfaces for RViz2 and Foxglove.

One list of spheres for each radius, one line strip for each path, two triangles for each surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .cdr import Writer
from ..scenes.state import Array

SPHERE, LINE_STRIP, SPHERE_LIST, TRIANGLE_LIST = 2, 4, 7, 11  # visualization_msgs/Marker
Color = tuple[float, float, float, float]  # red, green, blue, opacity; 0 to 1


@dataclass(frozen=True)
class Marker:
    """One visualization_msgs/Marker; points are in the frame of the message.

    Args:
        namespace: With `id`, identifies the marker that a later one replaces.
        id: See `namespace`.
        kind: SPHERE, LINE_STRIP, SPHERE_LIST or TRIANGLE_LIST.
        scale: Line width, diameter of the spheres [m], or 1 for triangles; of a SPHERE its three.
        color: Colour of all points.
        points: Positions [m], shape (k, 3); of a SPHERE none.
        pose: Position [m] and quaternion (x, y, z, w) of a SPHERE; others have no own.
    """

    namespace: str
    id: int
    kind: int
    scale: float | tuple[float, float, float]
    color: Color
    points: Array
    pose: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def sphere_markers(
    namespace: str, positions: ArrayLike, radii: ArrayLike, color: Color
) -> list[Marker]:
    """Markers of spheres at centres [m], shape (n, 3), with radii [m], shape (n,)."""
    places, sizes = np.asarray(positions, dtype=np.float64), np.asarray(radii)
    return [
        Marker(namespace, index, SPHERE_LIST, 2 * float(radius), color, places[sizes == radius])
        for index, radius in enumerate(np.unique(sizes))
    ]


def path_markers(
    namespace: str, ids: Sequence[int], positions: Array, width: float, color: Color
) -> list[Marker]:
    """Markers of the paths of n spheres over k times [m], shape (k, n, 3), `width` [m] wide."""
    return [
        Marker(namespace, int(sphere), LINE_STRIP, width, color, positions[:, index])
        for index, sphere in enumerate(ids)
    ]


def ellipsoid_markers(
    namespace: str, positions: Array, covariances: Array, size: float, color: Color
) -> list[Marker]:
    """Markers of ellipsoids of `size` standard deviations about centres.

    Args:
        namespace: See `Marker`.
        positions: Centres [m], shape (m, 3).
        covariances: Shape (m, 3, 3) [m^2].
        size: Half an axis over the deviation along it.
        color: Colour.
    """
    values, axes = np.linalg.eigh(covariances)
    found = []
    for index, (place, own, turn) in enumerate(zip(positions, values, axes, strict=True)):
        if np.linalg.det(turn) < 0:
            turn = turn * [1.0, 1.0, -1.0]
        x, y, z = np.maximum(2.0 * size * np.sqrt(np.maximum(own, 0.0)), 1e-6).tolist()
        pose = (*place.tolist(), *_quaternion(turn))
        found.append(Marker(namespace, index, SPHERE, (x, y, z), color, np.zeros((0, 3)), pose))
    return found


def _quaternion(turn: Array) -> tuple[float, float, float, float]:
    """Quaternion (x, y, z, w) of a rotation matrix: the largest row of q q^T."""
    xx, yy, zz = turn[0, 0], turn[1, 1], turn[2, 2]
    square = np.array(
        [
            [xx - yy - zz, 0.0, 0.0, 0.0],
            [turn[0, 1] + turn[1, 0], yy - xx - zz, 0.0, 0.0],
            [turn[0, 2] + turn[2, 0], turn[1, 2] + turn[2, 1], zz - xx - yy, 0.0],
            [
                turn[2, 1] - turn[1, 2],
                turn[0, 2] - turn[2, 0],
                turn[1, 0] - turn[0, 1],
                xx + yy + zz,
            ],
        ]
    )
    x, y, z, w = np.linalg.eigh(square)[1][:, -1].tolist()  # reads the lower half
    return x, y, z, w


def surface_markers(namespace: str, corners: Sequence[Array], color: Color) -> list[Marker]:
    """Markers of rectangles by their corners in order [m], shape (4, 3) each."""
    return [
        Marker(namespace, index, TRIANGLE_LIST, 1.0, color, four[[0, 1, 2, 2, 3, 0]])
        for index, four in enumerate(corners)
    ]


def encode_markers(
    stamp_ns: int, frame_id: str, lifetime_ns: int, markers: Sequence[Marker]
) -> bytes:
    """CDR bytes of a message; markers stay for `lifetime_ns` [ns] after reception, 0: for ever."""
    writer = Writer()
    writer.numbers('I', len(markers))
    for marker in markers:
        writer.header(stamp_ns, frame_id)
        writer.text('namespace', marker.namespace)
        writer.numbers('iii', marker.id, marker.kind, 0)  # 0: add or modify
        size = marker.scale
        if isinstance(size, tuple):
            scale = size
        else:
            scale = (size, 0.0, 0.0) if marker.kind == LINE_STRIP else (size, size, size)
        writer.numbers('d' * 10, *marker.pose, *scale)
        writer.numbers('ffff', *marker.color)
        writer.stamp(lifetime_ns)
        writer.numbers('B', 0)  # not locked to the frame
        writer.numbers('I', len(marker.points))
        writer.floats(marker.points)
        writer.align(4)
        writer.raw(_TAIL)
    return writer.cdr


def _tail() -> bytes:
    """Fields after the points, all empty: colours, texture, text, mesh; aligned to four bytes."""
    writer = Writer()
    writer.numbers('I', 0)  # colors
    writer.text('texture_resource', '')
    writer.header(0, '')
    writer.text('texture.format', '')
    writer.numbers('II', 0, 0)  # texture.data, uv_coordinates
    writer.text('text', '')
    writer.text('mesh_resource', '')
    writer.text('mesh_file.filename', '')
    writer.numbers('I', 0)  # mesh_file.data
    writer.numbers('B', 0)
    return writer.cdr[4:]


_TAIL = _tail()
