# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rotations as quaternions (x, y, z, w)."""

from __future__ import annotations

import math

from .jit import in_place
from .vector import cross, dot, length, plus, times, Vector
from ..scenes.state import Array


@in_place
def turn(quaternions: Array, i: int, spin: Vector, time: float) -> None:
    """Turn quaternion i for `time` at an angular velocity in the world frame: q <- exp(w t) q."""
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
