# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""One picture of spheres at one time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .camera import Camera
from ..surfaces import Quad, visible_quads
from ...scenes.scene import Scene
from ...scenes.state import Array

Image = NDArray[np.uint8]

OVERSAMPLING = 2  # rays per pixel and side
GAMMA = 2.2
GROUND, SLAB, ZENITH, HORIZON = '#f2f4f6', '#dcc9a4', '#cfdbe6', '#eef3f7'


@dataclass(frozen=True)
class Surroundings:
    """What is the same in all pictures of a scene.

    Args:
        quads: Rectangles as `raycast` takes them, shape (m, 4, 3).
        paints: Their colours in linear light, shape (m, 3).
        slabs: Those that throw shadows, shape (k, 4, 3).
        line: Distance of the lines on them [m].
        sun: Rows: two across the light, and towards the sun, shape (3, 3).
        up: Unit vector upwards, shape (3,).
    """

    quads: Array
    paints: Array
    slabs: Array
    line: float
    sun: Array
    up: Array

    @classmethod
    def of(cls, scene: Scene, low: Array, high: Array) -> Surroundings:
        """Surfaces of a scene; endless ones end around the box from `low` to `high` [m], (3,)."""
        found = visible_quads(scene, low, high)
        quads = np.array([_rectangle(quad) for quad in found]).reshape(-1, 4, 3)
        slabs = np.array([_rectangle(q) for q in found if not q.endless]).reshape(-1, 4, 3)
        paints = np.array([linear(GROUND if q.endless else SLAB) for q in found]).reshape(-1, 3)
        up = scene.up
        towards = up + 0.45 * _across(up, 0) - 0.35 * _across(up, 1)
        towards /= np.linalg.norm(towards)
        first = _across(towards, 0)
        sun = np.stack([first, np.cross(towards, first), towards])
        corners = np.concatenate([[low, high], *(quad.corners for quad in found)])
        line = _round(float(np.ptp(corners, axis=0).max()) / 12)
        return cls(quads, paints, slabs, line, sun, up)


def draw(
    camera: Camera,
    surroundings: Surroundings,
    positions: Array,
    quaternions: Array,
    radii: Array,
    colours: Array,
    *,
    width: int,
    height: int,
) -> Image:
    """Return a picture, RGB, shape (height, width, 3).

    Args:
        camera: Where it is taken from.
        surroundings: Surfaces and light.
        positions: Centres [m], shape (n, 3).
        quaternions: Rotations (x, y, z, w), shape (n, 4).
        radii: Radii [m], shape (n,).
        colours: In linear light, shape (n, 3).
        width: Of the picture [pixels].
        height: Of the picture [pixels].
    """
    from .raycast import cast_quads, cast_spheres, NOTHING, shade

    rows, columns = OVERSAMPLING * height, OVERSAMPLING * width
    depth = np.full((rows, columns), np.inf)
    shown = np.full((rows, columns), NOTHING, dtype=np.int64)
    share = np.linspace(0.0, 1.0, rows)[:, None, None]
    image = (1 - share) * linear(ZENITH) + share * linear(HORIZON)
    image = np.ascontiguousarray(np.broadcast_to(image, (rows, columns, 3)))
    view = np.concatenate([camera.eye[None], camera.axes])
    positions = np.ascontiguousarray(positions)
    cast_spheres(depth, shown, view, camera.slope, positions, radii)
    cast_quads(depth, shown, view, camera.slope, surroundings.quads)
    shade(
        image,
        depth,
        shown,
        view,
        camera.slope,
        positions,
        np.ascontiguousarray(np.swapaxes(rotation_matrices(quaternions), 1, 2)),
        radii,
        colours,
        surroundings.quads,
        surroundings.paints,
        surroundings.line,
        surroundings.slabs,
        surroundings.sun,
        surroundings.up[None],
    )
    # the mean of the rays of a pixel in linear light, then as screens take it
    mean = image.reshape(height, OVERSAMPLING, width, OVERSAMPLING, 3).mean(axis=(1, 3))
    picture: Image = np.rint(255 * mean ** (1 / GAMMA)).astype(np.uint8)
    return picture


def _rectangle(quad: Quad) -> Array:
    corner, one, other = quad.corners[0], quad.corners[1], quad.corners[3]
    one, other = one - corner, other - corner
    return np.stack([corner, one / (one @ one), other / (other @ other), quad.normal])


def rotation_matrices(quaternions: Array) -> Array:
    """Matrices of unit quaternions (x, y, z, w), shape (n, 3, 3)."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def linear(colour: str) -> Array:
    """`#rrggbb` in linear light, shape (3,)."""
    return (np.array([int(colour[at : at + 2], 16) for at in (1, 3, 5)]) / 255.0) ** GAMMA


def _across(vector: Array, which: int) -> Array:
    """One of two unit vectors at right angles to a vector and to each other."""
    helper = np.eye(3)[int(np.argmin(np.abs(vector)))]
    first = np.cross(helper, vector)
    first /= np.linalg.norm(first)
    return first if which == 0 else np.cross(vector, first) / np.linalg.norm(vector)


def _round(length: float) -> float:
    """Return the next of 1, 2, 5, 10, ... above a length."""
    decade = 10.0 ** np.floor(np.log10(length))
    return float(next(f * decade for f in (1.0, 2.0, 5.0, 10.0) if f * decade >= length))
