# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Flight of eight samples of a scene at once, as lanes, frame after frame, until each ends it.

Each lane computes what `flight.fly_one` does, to the bit. A sample leaves its lane before a frame
in which it might touch anything, be quiet, need many pieces of flight, or diverge: then the way
that all frames can go decides.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .clearance import is_clear, margin_of_flight, pass_clear
from .flight import position_on_path, share_of_spin, velocity_on_path
from .spheres import Spheres
from .world import gravity_of, World
from ..kernels.flight import flight_at, mean_accelerations_in_lanes, spin_after
from ..kernels.jit import compiled, in_place
from ..kernels.lanes import bits, choose, Lanes, larger, load, lowest_bit, Mask, store, WIDTH
from ..kernels.neighbours import Indices
from ..kernels.quaternions import Quaternion, turned_by
from ..kernels.vector import dot, length, minus, plus, times, Vector
from ..scenes.state import Array

# registers of a sphere: its state, and the margin of its flight; of its turn in a frame
_POSITION, _ROTATION, _VELOCITY, _SPIN, _MARGIN, _REGISTERS = 0, 3, 7, 10, 13, 14
_COSINE, _AXIS, _TURN = 0, 1, 4


class Formation(NamedTuple):
    """Samples that fly together, in registers of eight numbers.

    before, after: states of n spheres at both ends of a frame, shape (8 registers n,); turns: in
    a frame, shape (32 n,); samples: which samples, shape (8,).
    """

    before: Array
    after: Array
    turns: Array
    samples: Indices


@compiled
def new_formation(spheres: int) -> Formation:
    """Room for samples of so many spheres."""
    rows = np.zeros((2, WIDTH * _REGISTERS * spheres))
    turns, samples = np.zeros(WIDTH * _TURN * spheres), np.zeros(WIDTH, np.int64)
    return Formation(before=rows[0], after=rows[1], turns=turns, samples=samples)


@in_place
def fly_together(
    world: World,
    dt: float,
    sleeps: bool,
    threshold: Array,
    size: int,
    formation_out: Formation,
    frames_out: Spheres,
    done_out: Indices,
) -> None:
    """Fly samples on from the frames that they have, each as far as it only flies.

    Args:
        world: What does not move; no plane does.
        dt: Length of a frame.
        sleeps: Whether what is quiet may sleep.
        threshold: Speed below which a sphere is quiet, shape (n,).
        size: How many of the samples of the formation there are, at most 8.
        formation_out: Scratch, with the samples.
        frames_out: Start and frames of all samples, shapes (s, frames, n, k).
        done_out: How many of these each sample has, shape (s,).
    """
    samples, total, count = formation_out.samples, frames_out.positions.shape[1], len(threshold)
    before, after, turns = formation_out.before, formation_out.after, formation_out.turns
    flying = 0
    for lane in range(WIDTH):
        sample = samples[min(lane, size - 1)]
        done = done_out[sample]
        for i in range(count):
            _enter(frames_out, sample, done - 1, i, lane, before)
        if lane < size and done < total:
            flying |= 1 << lane
    for i in range(count):
        _find_turn(world, i, dt, before, turns)
    while flying:
        flying &= bits(_fly_frame(world, dt, sleeps, threshold, before, turns, after))
        left = flying
        while left:
            lane = lowest_bit(left)
            left &= left - 1
            sample = samples[lane]
            frame = done_out[sample]
            for i in range(count):
                _leave(after, i, lane, sample, frame, frames_out)
            done_out[sample] = frame + 1
            if frame + 1 == total:
                flying &= ~(1 << lane)
        before, after = after, before


@in_place
def _fly_frame(
    world: World,
    dt: float,
    sleeps: bool,
    threshold: Array,
    before: Array,
    turns_out: Array,
    after_out: Array,
) -> Mask:
    """Fly all lanes for a frame; whether that is all that each does in it."""
    after, going = after_out, dot(_vector(before, 0, _SPIN), _vector(before, 0, _SPIN)) >= 0.0
    for i in range(len(threshold)):
        p, v, w = (
            _vector(before, i, _POSITION),
            _vector(before, i, _VELOCITY),
            _vector(before, i, _SPIN),
        )
        if world.in_air:
            flight = flight_at(world.flight, i)
            whole, path, mean = mean_accelerations_in_lanes(v, w, flight, dt)
            q, u = position_on_path(p, v, path, dt), velocity_on_path(v, mean, dt)
            going = going & whole
            spin = spin_after(w, flight, dt)
        else:
            fall = times(dt, gravity_of(world))
            q, u, spin = plus(p, times(dt, plus(v, times(0.5, fall)))), plus(v, fall), w
        new = _rotation(before, i)
        new = _chosen(dot(w, w) > 0.0, _turned(new, turns_out, i), new)
        total = _sum(q) + (_sum(u) + _sum(spin)) + (new[0] + new[1] + (new[2] + new[3]))
        going = going & (total - total <= 0.0)  # finite
        light, margin = margin_of_flight(world, i, v, u, dt)
        going = going & light
        for plane in range(len(world.point)):
            going = going & is_clear(world, plane, p, q, margin)
        if sleeps:
            moving = larger(dot(u, u), world.radius[i] ** 2 * dot(spin, spin))
            going = going & (moving > (1.0 + 1e-9) * threshold[i] ** 2)  # not quiet
        for axis in range(3):
            _put(after, i, _POSITION + axis, q[axis])
            _put(after, i, _VELOCITY + axis, u[axis])
            _put(after, i, _SPIN + axis, spin[axis])
        for part in range(4):
            _put(after, i, _ROTATION + part, new[part])
        _put(after, i, _MARGIN, margin)
        if world.in_air and flight_at(world.flight, i).spin_decay != 0:
            _find_turn(world, i, dt, after, turns_out)  # else it stays
        for j in range(i):
            offset = minus(p, _vector(before, j, _POSITION))
            way = minus(minus(q, _vector(after, j, _POSITION)), offset)
            going = going & pass_clear(offset, way, margin + _row(after, j, _MARGIN))
    return going


@in_place
def _find_turn(world: World, i: int, dt: float, registers: Array, turns_out: Array) -> None:
    """Find the turn of sphere i in a frame, as `quaternions.turn` does."""
    spin, place = _vector(registers, i, _SPIN), WIDTH * _TURN * i
    if world.in_air:
        spin = times(share_of_spin(flight_at(world.flight, i).spin_decay, dt), spin)
    speed = length(spin)
    half = 0.5 * speed * dt
    axis = times(math.sin(half) / speed, spin)
    store(turns_out, place + WIDTH * _COSINE, math.cos(half))
    for k in range(3):
        store(turns_out, place + WIDTH * (_AXIS + k), axis[k])


@in_place
def _turned(q: Quaternion, turns: Array, i: int) -> Quaternion:
    """Rotation of sphere i after its turn."""
    place = WIDTH * _TURN * i
    axis = (
        load(turns, place + WIDTH * _AXIS),
        load(turns, place + WIDTH * (_AXIS + 1)),
        load(turns, place + WIDTH * (_AXIS + 2)),
    )
    return turned_by(q, load(turns, place + WIDTH * _COSINE), axis)


@in_place
def _chosen(mask: Mask, yes: Quaternion, no: Quaternion) -> Quaternion:
    return (
        choose(mask, yes[0], no[0]),
        choose(mask, yes[1], no[1]),
        choose(mask, yes[2], no[2]),
        choose(mask, yes[3], no[3]),
    )


@in_place
def _sum(vector: Vector) -> Lanes:
    return vector[0] + vector[1] + vector[2]


@in_place
def _row(registers: Array, i: int, register: int) -> Lanes:
    return load(registers, WIDTH * (_REGISTERS * i + register))


@in_place
def _vector(registers: Array, i: int, register: int) -> Vector:
    return (
        _row(registers, i, register),
        _row(registers, i, register + 1),
        _row(registers, i, register + 2),
    )


@in_place
def _rotation(registers: Array, i: int) -> Quaternion:
    x, y, z = _vector(registers, i, _ROTATION)
    return x, y, z, _row(registers, i, _ROTATION + 3)


@in_place
def _put(registers_out: Array, i: int, register: int, value: Lanes) -> None:
    store(registers_out, WIDTH * (_REGISTERS * i + register), value)


@in_place
def _enter(frames: Spheres, sample: int, frame: int, i: int, lane: int, out: Array) -> None:
    """Put sphere i of a sample, as it is in a frame, into its lane."""
    place = WIDTH * _REGISTERS * i + lane
    for k in range(3):
        out[place + WIDTH * (_POSITION + k)] = frames.positions[sample, frame, i, k]
        out[place + WIDTH * (_VELOCITY + k)] = frames.velocities[sample, frame, i, k]
        out[place + WIDTH * (_SPIN + k)] = frames.angular_velocities[sample, frame, i, k]
    for k in range(4):
        out[place + WIDTH * (_ROTATION + k)] = frames.quaternions[sample, frame, i, k]


@in_place
def _leave(
    registers: Array, i: int, lane: int, sample: int, frame: int, frames_out: Spheres
) -> None:
    """Write sphere i of a lane into a frame of its sample."""
    place = WIDTH * _REGISTERS * i + lane
    for k in range(3):
        frames_out.positions[sample, frame, i, k] = registers[place + WIDTH * (_POSITION + k)]
        frames_out.velocities[sample, frame, i, k] = registers[place + WIDTH * (_VELOCITY + k)]
        frames_out.angular_velocities[sample, frame, i, k] = registers[place + WIDTH * (_SPIN + k)]
    for k in range(4):
        frames_out.quaternions[sample, frame, i, k] = registers[place + WIDTH * (_ROTATION + k)]
