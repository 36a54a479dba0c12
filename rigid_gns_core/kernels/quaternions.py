# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rotations as quaternions (x, y, z, w)."""

from __future__ import annotations

import math

from .jit import in_place
from .vector import cross, dot, length, plus, times, Vector
from ..scenes.state import Array

Quaternion = tuple[float, float, float, float]


@in_place
def turn(quaternions: Array, i: int, spin: Vector, time: float) -> None:
    """Turn quaternion i for `time` at an angular velocity in the world frame: q <- exp(w t) q."""
    speed = length(spin)
    if speed == 0:
        return
    half = 0.5 * speed * time
    cosine, axis = math.cos(half), times(math.sin(half) / speed, spin)
    q = quaternions[i, 0], quaternions[i, 1], quaternions[i, 2], quaternions[i, 3]
    new = turned_by(q, cosine, axis)
    for k in range(4):
        quaternions[i, k] = new[k]


@in_place
def turned_by(q: Quaternion, cosine: float, axis: Vector) -> Quaternion:
    """Unit quaternion of (axis, cosine) q; of one, or of eight as lanes."""
    old, scalar = (q[0], q[1], q[2]), q[3]
    new = plus(plus(times(cosine, old), times(scalar, axis)), cross(axis, old))
    real = cosine * scalar - dot(axis, old)
    norm = math.sqrt(dot(new, new) + real * real)
    return new[0] / norm, new[1] / norm, new[2] / norm, real / norm
