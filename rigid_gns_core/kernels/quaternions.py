# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rotations as quaternions (x, y, z, w)."""

from __future__ import annotations

import math

from .jit import in_place
from .lanes import choose, Lanes, load, store, WIDTH
from .vector import cross, dot, length, plus, row, times, Vector
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
def turn_all(quaternions: Array, spins: Array, time: float, room_out: Array) -> None:
    """As `turn`, of all quaternions, eight at once: the same bits.

    Args:
        quaternions: Shape (n, 4); turned in place.
        spins: Angular velocities, world frame, shape (n, 3).
        time: How long.
        room_out: Scratch, shape (8 n,).
    """
    whole = len(quaternions) // WIDTH * WIDTH
    for first in range(0, whole, WIDTH):
        at = first * WIDTH
        for lane in range(WIDTH):
            for part in range(3):
                room_out[at + part * WIDTH + lane] = spins[first + lane, part]
            for part in range(4):
                room_out[at + (3 + part) * WIDTH + lane] = quaternions[first + lane, part]
        spin = _columns(room_out, at)
        q = _columns(room_out, at + 3 * WIDTH)
        scalar, speed = load(room_out, at + 6 * WIDTH), length(spin)
        half = 0.5 * speed * time
        axis, still = times(math.sin(half) / speed, spin), speed <= 0.0
        new = turned_by((q[0], q[1], q[2], scalar), math.cos(half), axis)
        store(room_out, at, choose(still, q[0], new[0]))
        store(room_out, at + WIDTH, choose(still, q[1], new[1]))
        store(room_out, at + 2 * WIDTH, choose(still, q[2], new[2]))
        store(room_out, at + 3 * WIDTH, choose(still, scalar, new[3]))
        for lane in range(WIDTH):
            for part in range(4):
                quaternions[first + lane, part] = room_out[at + part * WIDTH + lane]
    for i in range(whole, len(quaternions)):
        turn(quaternions, i, row(spins, i), time)


@in_place
def _columns(values: Array, at: int) -> tuple[Lanes, Lanes, Lanes]:
    return load(values, at), load(values, at + WIDTH), load(values, at + 2 * WIDTH)


@in_place
def turned_by(q: Quaternion, cosine: float, axis: Vector) -> Quaternion:
    """Unit quaternion of (axis, cosine) q; of one, or of eight as lanes."""
    old, scalar = (q[0], q[1], q[2]), q[3]
    new = plus(plus(times(cosine, old), times(scalar, axis)), cross(axis, old))
    real = cosine * scalar - dot(axis, old)
    norm = math.sqrt(dot(new, new) + real * real)
    return new[0] / norm, new[1] / norm, new[2] / norm, real / norm
