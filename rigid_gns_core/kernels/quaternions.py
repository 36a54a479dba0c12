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

"""Rotations as quaternions (x, y, z, w)."""

from __future__ import annotations

import math

from .jit import in_place
from .vector import cross, dot, length, plus, times, Vector
from ..scenes.state import Array


@in_place
def turn(quaternions: Array, i: int, spin: Vector, time: float) -> None:
    """Turn quaternion i at an angular velocity for some time, exactly; world frame."""
    speed = length(spin)
    if speed == 0:
        return
    half = 0.5 * speed * time
    cosine, sine = math.cos(half), math.sin(half)
    axis = times(sine / speed, spin)
    old = (quaternions[i, 0], quaternions[i, 1], quaternions[i, 2])
    scalar = quaternions[i, 3]
    new = plus(plus(times(cosine, old), times(scalar, axis)), cross(axis, old))
    real = cosine * scalar - dot(axis, old)
    norm = math.sqrt(dot(new, new) + real * real)
    for k in range(3):
        quaternions[i, k] = new[k] / norm
    quaternions[i, 3] = real / norm
