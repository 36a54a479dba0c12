# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Path of one ball through the scene: flight, impacts, sliding and rolling, at given times.

All that it depends on is in three arrays, so that slopes by finite differences are cheap:

- `flight`: see `FLIGHT`.
- `planes`, shape (planes, 14): point, rows of `Plane.axes`, half lengths.
- `laws`, shape (planes, laws): see `LAW`.
"""

from __future__ import annotations

import math

from .jit import entry, in_place
from ..kernels.vector import across, cross, dot, length, minus, plus, row, times, Vector
from ..scenes.state import Array

# gravity with buoyancy [m/s^2]; rho A / 2m with added mass [1/m]; C_d = C_d0 + slope S;
# C_l = a S / (S + b); decay of spin [1/s]; radius [m]; inertia factor
FLIGHT = ('gx', 'gy', 'gz', 'area', 'drag', 'drag_slope', 'lift', 'lift_half', 'wind_x',
          'wind_y', 'wind_z', 'spin_decay', 'radius', 'inertia')
# e(v) = e_fast - (e_fast - e_slow) exp(-v / speed); Coulomb; tangential restitution; deceleration
# of rolling [m/s^2] and its part proportional to speed [1/s]; spinning friction
LAW = ('e_slow', 'e_fast', 'speed', 'friction', 'tangential', 'rolling', 'rolling_slope',
       'spinning')
(AREA, DRAG, DRAG_SLOPE, LIFT, LIFT_HALF, WIND, DECAY, RADIUS, INERTIA) = (
    3, 4, 5, 6, 7, 8, 11, 12, 13)
# longest step [s]: two paths meet to 1e-6 m of those with steps of a tenth
LONGEST = 0.008
# a ball that leaves a surface more slowly stays on it [m/s]: it would rise by less than 0.02 mm
RESTING = 0.02
MAX_CONTACTS = 32
FREE = -1


@in_place
def acceleration(velocity: Vector, spin: Vector, flight: Array) -> Vector:
    """g - k C_d |u| u + k C_l |u|^2 (w x u) / |w x u|, u = v - wind, k = rho A / 2m."""
    u = minus(velocity, (flight[8], flight[9], flight[10]))
    speed = length(u)
    gravity = (flight[0], flight[1], flight[2])
    if flight[3] == 0.0 or speed == 0.0:
        return gravity
    turning = cross(spin, u)
    side = length(turning)
    ratio = flight[12] * side / (speed * speed)  # S = r w_perp / u
    drag = flight[3] * (flight[4] + flight[5] * ratio) * speed
    total = minus(gravity, times(drag, u))
    if side > 0.0 and flight[6] != 0.0:
        lift = flight[3] * flight[6] * ratio / (ratio + flight[7]) * speed * speed
        total = plus(total, times(lift / side, turning))
    return total


@in_place
def fly(p: Vector, v: Vector, w: Vector, h: float, flight: Array) -> tuple[Vector, Vector]:
    """Position and velocity after a step of the classical Runge-Kutta method of fourth order."""
    a = acceleration(v, w, flight)
    b = acceleration(plus(v, times(0.5 * h, a)), w, flight)
    c = acceleration(plus(v, times(0.5 * h, b)), w, flight)
    d = acceleration(plus(v, times(h, c)), w, flight)
    mean = times(1.0 / 3.0, plus(a, plus(b, c)))
    after = plus(p, times(h, plus(v, times(0.5 * h, mean))))
    total = plus(plus(a, d), times(2.0, plus(b, c)))
    return after, plus(v, times(h / 6.0, total))


@in_place
def normal_of(planes: Array, k: int) -> Vector:
    """Unit normal of a plane."""
    return planes[k, 9], planes[k, 10], planes[k, 11]


@in_place
def gap(planes: Array, k: int, p: Vector, radius: float) -> float:
    """Distance of the ball's surface from a plane [m]; infinite beside a bounded one."""
    d = (p[0] - planes[k, 0], p[1] - planes[k, 1], p[2] - planes[k, 2])
    along = d[0] * planes[k, 3] + d[1] * planes[k, 4] + d[2] * planes[k, 5]
    side = d[0] * planes[k, 6] + d[1] * planes[k, 7] + d[2] * planes[k, 8]
    if abs(along) > planes[k, 12] or abs(side) > planes[k, 13]:
        return math.inf
    return dot(d, normal_of(planes, k)) - radius


@in_place
def restitution(speed: float, laws: Array, k: int) -> float:
    """Restitution at an approach speed: e_fast - (e_fast - e_slow) exp(-v / speed)."""
    if laws[k, 2] <= 0.0:
        return laws[k, 1]
    return laws[k, 1] - (laws[k, 1] - laws[k, 0]) * math.exp(-speed / laws[k, 2])


@in_place
def bounce(
    v: Vector, w: Vector, n: Vector, flight: Array, laws: Array, k: int
) -> tuple[Vector, Vector]:
    """Velocity and spin after an impact: restitution, Coulomb's law, tangential restitution.

    The contact point's tangential velocity u turns to -beta u, if friction suffices: the change of
    velocity is then (1 + beta) u kappa / (1 + kappa), kappa the inertia factor.
    """
    radius, kappa = flight[12], flight[13]
    approach = -dot(v, n)
    push = (1.0 + restitution(approach, laws, k)) * approach
    arm = times(-radius, n)
    slip = across(plus(v, cross(w, arm)), n)
    size = length(slip)
    v = plus(v, times(push, n))
    if size > 0.0:
        turn = min(laws[k, 3] * push, (1.0 + laws[k, 4]) * size * kappa / (1.0 + kappa))
        kick = times(-turn / size, slip)
        v = plus(v, kick)
        w = plus(w, times(1.0 / (kappa * radius * radius), cross(arm, kick)))
    return v, w


@in_place
def glide(
    v: Vector, w: Vector, n: Vector, h: float, flight: Array, laws: Array, k: int
) -> tuple[float, Vector, Vector, Vector, float]:
    """One step on a surface: time, displacement, velocity and spin after it, and normal pull.

    Sliding: mu N against the slip u, du/dt = -mu N (1 + 1/kappa) u/|u|, until the slip ends.
    Rolling: the tangential pull over 1 + kappa, less the rolling resistance, until it stops.
    The step ends where one of them does.
    """
    radius, kappa = flight[12], flight[13]
    free = acceleration(v, w, flight)
    pull = -dot(free, n)
    if pull <= 0.0:
        return 0.0, (0.0, 0.0, 0.0), v, w, pull
    along = plus(free, times(pull, n))
    arm = times(-radius, n)
    slip = plus(v, cross(w, arm))
    size = length(slip)
    friction = laws[k, 3] * pull
    spinning = dot(w, n)
    if laws[k, 7] > 0.0:
        spinning -= math.copysign(min(abs(spinning), h * laws[k, 7] * pull / radius), spinning)
    if size > 1e-7 * radius and friction > 0.0:
        direction = times(1.0 / size, slip)
        rate = friction * (1.0 + 1.0 / kappa) - dot(along, direction)
        end = rate > 0.0 and size < rate * h
        if end:
            h = size / rate
        a = minus(along, times(friction, direction))
        after = plus(v, times(h, a))
        if end:
            w = plus(times(1.0 / radius, cross(n, after)), times(spinning, n))
        else:
            turn = times(friction / (kappa * radius), cross(n, direction))
            w = plus(plus(w, times(h, turn)), times(spinning - dot(w, n), n))
        return h, times(0.5 * h, plus(v, after)), after, w, pull
    speed = length(v)
    slope = times(1.0 / (1.0 + kappa), along)
    resistance = laws[k, 5] + laws[k, 6] * speed
    if friction == 0.0:
        slope, resistance = along, 0.0
    if speed < 1e-9:
        if length(slope) <= resistance:
            return h, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), times(spinning, n), pull
        direction = times(1.0 / length(slope), slope)
    else:
        direction = times(1.0 / speed, v)
    a = minus(slope, times(resistance, direction))
    slowing = -dot(a, direction)
    stop = slowing > 0.0 and speed <= slowing * h
    if stop:
        h = max(speed / slowing, 1e-9)
    # the part proportional to speed at the middle of the step
    a = plus(a, times(0.5 * h * slowing * laws[k, 6], direction))
    after = (0.0, 0.0, 0.0) if stop else plus(v, times(h, a))
    if friction > 0.0:
        w = plus(times(1.0 / radius, cross(n, after)), times(spinning, n))
    return h, times(0.5 * h, plus(v, after)), after, w, pull


@in_place
def first_root(p: Vector, v: Vector, after: Vector, w: Vector, h: float, level: float,
               planes: Array, k: int, flight: Array) -> float:
    """Time in (0, h] at which the ball touches a plane: secant steps, kept in a bracket."""
    radius = flight[12]
    n = normal_of(planes, k)
    low, high = 0.0, h
    at_low = level
    offset = dot((planes[k, 0], planes[k, 1], planes[k, 2]), n) + radius
    at_high = dot(after, n) - offset
    t = h
    for _ in range(40):
        t = low + (high - low) * at_low / (at_low - at_high) if at_low > at_high else high
        q, u = fly(p, v, w, t, flight)
        value = dot(q, n) - offset
        if abs(value) < 1e-12 or high - low < 1e-12:
            break
        speed = dot(u, n)
        newton = t - value / speed if speed < 0.0 else -1.0
        if value > 0.0:
            low, at_low = t, value
        else:
            high, at_high = t, value
        if low < newton < high:
            q, u = fly(p, v, w, newton, flight)
            value = dot(q, n) - offset
            t = newton
            if abs(value) < 1e-12:
                break
            if value > 0.0:
                low, at_low = t, value
            else:
                high, at_high = t, value
    return t


@in_place
def touched(planes: Array, p: Vector, q: Vector, q_v: Vector, radius: float, on: int) -> int:
    """First plane that a step from p to q leads into, or FREE."""
    best, first = FREE, math.inf
    for k in range(len(planes)):
        if k == on:
            continue
        n = normal_of(planes, k)
        end = gap(planes, k, q, radius)
        if not end < 0.0 or dot(q_v, n) >= 0.0:
            continue
        begin = gap(planes, k, p, radius)
        if begin == math.inf:
            begin = end - dot(minus(q, p), n)
        if begin < -radius:  # the centre is behind
            continue
        share = begin / (begin - end) if begin > 0.0 else 0.0
        if share < first:
            best, first = k, share
    return best


@entry
def path(start: Array, begin: float, stamps: Array, flight: Array, planes: Array, laws: Array,
         on: int, states_out: Array, contacts_out: Array) -> tuple[int, int]:
    """Path of a ball from a start at a time, at later stamps.

    Args:
        start: Position, velocity, angular velocity, shape (9,).
        begin: Time of the start [s].
        stamps: Times [s], not decreasing, shape (m,).
        flight, planes, laws: See the module.
        on: Plane on which the ball rests at the start; -1: none.
        states_out: States at the stamps, shape (m, 9).
        contacts_out: Time, plane, approach speed of each impact, shape (most, 3).

    Returns:
        Number of impacts, and the plane on which the ball ends.
    """
    p, v, w = (start[0], start[1], start[2]), (start[3], start[4], start[5]), (
        start[6], start[7], start[8])
    radius, decay = flight[12], flight[11]
    now, count = begin, 0
    longest = LONGEST
    for i in range(len(stamps)):
        guard = 0
        while now < stamps[i] and guard < 10000:
            guard += 1
            h = min(stamps[i] - now, longest)
            longest = LONGEST
            if on >= 0:
                n = normal_of(planes, on)
                v = across(v, n)
                taken, shift, after, turned, pull = glide(v, w, n, h, flight, laws, on)
                q = plus(p, shift)
                if pull <= 0.0 or gap(planes, on, q, radius) > 1e-3:
                    on = FREE
                    continue
                hit = touched(planes, p, q, after, radius, on)
                if hit >= 0:
                    m = normal_of(planes, hit)
                    begin_gap = max(gap(planes, hit, p, radius), 0.0)
                    end_gap = gap(planes, hit, q, radius)
                    if begin_gap == math.inf:
                        begin_gap = max(end_gap - dot(shift, m), 0.0)
                    share = begin_gap / (begin_gap - end_gap)
                    # on the parabola p + v t + a t^2 / 2, two Newton steps
                    a = times(1.0 / taken, minus(after, v)) if taken > 0.0 else (0.0, 0.0, 0.0)
                    t = share * taken
                    for _ in range(3):
                        speed = dot(m, plus(v, times(t, a)))
                        if speed < 0.0:
                            t -= (begin_gap + t * dot(m, plus(v, times(0.5 * t, a)))) / speed
                    t = min(max(t, 0.0), taken)
                    part = t / taken if taken > 0.0 else 1.0
                    p = plus(p, times(t, plus(v, times(0.5 * t, a))))
                    v = plus(v, times(t, a))
                    w = plus(w, times(part, minus(turned, w)))
                    now += t
                    if count < len(contacts_out):
                        contacts_out[count, 0], contacts_out[count, 1] = now, hit
                        contacts_out[count, 2] = -dot(v, m)
                    count += 1
                    v, w = bounce(v, w, m, flight, laws, hit)
                    rise = dot(v, n)
                    if rise > RESTING:
                        on = FREE
                        longest = rise / pull
                    continue
                p, v, w = q, after, turned
                now += taken
                continue
            q, after = fly(p, v, w, h, flight)
            hit = touched(planes, p, q, after, radius, FREE)
            if hit >= 0:
                n = normal_of(planes, hit)
                offset = dot((planes[hit, 0], planes[hit, 1], planes[hit, 2]), n) + radius
                level = dot(p, n) - offset
                t = 0.0
                if level > 0.0:
                    t = first_root(p, v, q, w, h, level, planes, hit, flight)
                p, v = fly(p, v, w, t, flight)
                w = times(math.exp(-decay * t), w)
                now += t
                if count < len(contacts_out):
                    contacts_out[count, 0], contacts_out[count, 1] = now, hit
                    contacts_out[count, 2] = -dot(v, n)
                count += 1
                if dot(v, n) < 0.0:
                    v, w = bounce(v, w, n, flight, laws, hit)
                rise = dot(v, n)
                pull = -dot(acceleration(v, w, flight), n)
                if pull > 0.0 and rise < RESTING:
                    on = hit
                elif pull > 0.0:
                    longest = rise / pull
                continue
            p, v = q, after
            w = times(math.exp(-decay * h), w)
            now += h
        states_out[i, 0], states_out[i, 1], states_out[i, 2] = p
        states_out[i, 3], states_out[i, 4], states_out[i, 5] = v
        states_out[i, 6], states_out[i, 7], states_out[i, 8] = w
    return count, on


@entry
def path_and_slopes(start: Array, steps: Array, begin: float, stamps: Array, flight: Array,
                    planes: Array, laws: Array, on: int, states_out: Array, slopes_out: Array,
                    contacts_out: Array, work: Array) -> tuple[int, int]:
    """As `path`, with slopes of the states over the start by central differences.

    Args:
        steps: Half widths of the differences, shape (9,).
        slopes_out: Shape (9, m, 9): over each part of the start.
        work: Shape (2, m, 9) and contacts are overwritten.
    """
    moved = start.copy()
    for j in range(9):
        if steps[j] <= 0.0:
            slopes_out[j] = 0.0
            continue
        moved[j] = start[j] + steps[j]
        path(moved, begin, stamps, flight, planes, laws, on, work[0], contacts_out)
        moved[j] = start[j] - steps[j]
        path(moved, begin, stamps, flight, planes, laws, on, work[1], contacts_out)
        moved[j] = start[j]
        scale = 0.5 / steps[j]
        for i in range(len(stamps)):
            for c in range(9):
                slopes_out[j, i, c] = scale * (work[0, i, c] - work[1, i, c])
    return path(start, begin, stamps, flight, planes, laws, on, states_out, contacts_out)
