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

"""Where a picture is taken from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...scenes.state import Array


@dataclass(frozen=True)
class Camera:
    """A pinhole.

    Args:
        eye: Where it is [m], shape (3,).
        axes: Rows: right, up, forwards; unit vectors, shape (3, 3).
        slope: Half the height of the picture over its distance.
    """

    eye: Array
    axes: Array
    slope: float

    @classmethod
    def around(
        cls,
        low: Array,
        high: Array,
        up: Array,
        *,
        azimuth: float = -60.0,
        elevation: float = 24.0,
        zoom: float = 1.0,
        aspect: float = 1.0,
        fov: float = 32.0,
    ) -> Camera:
        """Return a camera that sees a box.

        Args:
            low: Least corner [m], shape (3,).
            high: Greatest corner [m], shape (3,).
            up: Unit vector upwards, shape (3,).
            azimuth: Where it stands, around the vertical, from x [degrees].
            elevation: How far above the level [degrees], -89 to 89.
            zoom: Nearer by this factor.
            aspect: Width of the picture over its height.
            fov: Angle from the upper to the lower edge [degrees].

        Raises:
            ValueError: The elevation or the zoom is out of range.
        """
        if not -89 <= elevation <= 89:
            raise ValueError(f'elevation is {elevation:g} degrees, expected -89 to 89')
        if not (np.isfinite(zoom) and zoom > 0):
            raise ValueError(f'zoom is {zoom:g}, expected more than 0')
        level = np.cross(np.eye(3)[1] if abs(up[1]) < 0.9 else np.eye(3)[0], up)
        level /= np.linalg.norm(level)
        turn, rise = np.radians([azimuth, elevation])
        outwards = np.cos(rise) * (np.cos(turn) * level + np.sin(turn) * np.cross(up, level))
        outwards = outwards + np.sin(rise) * up
        right = np.cross(up, outwards)
        right /= np.linalg.norm(right)
        axes = np.stack([right, np.cross(outwards, right), -outwards])
        slope = float(np.tan(np.radians(fov) / 2))
        # the corners of the box are just within the picture
        centre = 0.5 * (low + high)
        corners = np.stack(np.meshgrid(*np.stack([low, high], axis=1), indexing='ij'), axis=-1)
        local = (corners.reshape(-1, 3) - centre) @ axes.T
        reach = np.maximum(np.abs(local[:, 0]) / aspect, np.abs(local[:, 1])) / slope
        distance = float(np.max(reach - local[:, 2])) / zoom
        return cls(centre + distance * outwards, axes, slope)
