# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Impacts on surfaces: the flights before and after, fitted together, for each interval.

The flight before gives time and place of the contact. The flight after begins there, so that one
frame after the contact determines its velocity. The law of impact enters as a measurement of that
velocity, as uncertain as materials are; it counts where the frames after the contact are few.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from .impacts import after_impact, first_impact, Surfaces
from .jit import in_place
from .line_fit import fit_line
from .motion_models import Contact, FLIGHT, Hypotheses, Hypothesis, OUTLIER, try_contact
from .observations import Observations
from ..kernels.vector import across, dot, length, minus, plus, row, times, Vector
from ..scenes.state import Array

# prior of the velocity after an impact: standard deviations as parts of its change by the law
_NORMAL, _TANGENT = 0.1, 0.3
# a contact may be predicted outside of its interval by this many standard deviations of the
# flight, but at most by a part of the interval
SLACK, MOST_SLACK = 3.0, 0.25
# contacts are sought this many frames back, with flights of as many frames before them: earlier
# ones add little, and the cost would grow with the square of the window
_REACH = 10
# cost of a contact: where noise leaves open whether it has happened, it has not, as a rollout from
# there makes it happen
IMPACT = 8.0
# a frame nearer to its contact than this part of an interval tells less of the spin than the law
_SOON = 0.3


class MotionBefore(NamedTuple):
    """The cheapest motion before a contact.

    Args:
        cost: As in `Hypothesis`.
        origin: Position at time 0, as the sums have it [m].
        slope: Velocity at time 0 [m/s].
        middle: Mean time of its frames [s].
        span: Sum of their squared distances in time from `middle` [s^2].
        seen: Number of its frames.
        angle: Rotation vector at time 0 [rad].
        spin: Spin [rad/s].
    """

    cost: float
    origin: Vector
    slope: Vector
    middle: float
    span: float
    seen: float
    angle: Vector
    spin: Vector


@in_place
def motion_before(sums: Array, angle_sums: Array, sigma: float, frame: int) -> MotionBefore:
    """Cheapest motion through the frames before `frame`, which is at least the third."""
    first = max(0, frame - _REACH)
    cost, cheapest = math.inf, first
    for begin in range(first, frame - 1):
        line = fit_line(sums, begin, frame)
        own = line.misfit / sigma**2 + OUTLIER * sums[begin, 0]
        if line.seen > 1.5 and own < cost:
            cost, cheapest = own, begin
    line, spin = fit_line(sums, cheapest, frame), fit_line(angle_sums, cheapest, frame)
    return MotionBefore(
        cost, line.origin, line.slope, line.middle, line.span, line.seen, spin.origin, spin.slope
    )


@in_place
def variance_at(before: MotionBefore, time: float) -> float:
    """Variance of the position predicted for `time` [s], relative to that of a measurement."""
    return 1.0 / before.seen + (time - before.middle) ** 2 / before.span


@in_place
def try_surface_impacts(
    best: Hypotheses, i: int, window: Observations, surfaces: Surfaces, charge: float
) -> None:
    """Try an impact on a surface before each frame.

    Args:
        best: Hypotheses, replaced where one of these is cheaper.
        i: Index of the sphere.
        window: Observations of three frames or more.
        surfaces: Surfaces and gravity.
        charge: Added to the cost.
    """
    stamps, flight_sums, angle_sums = window.stamps, window.flight_sums[i], window.angle_sums[i]
    origin, radius, sigma = row(window.origin, i), window.radii[i], window.sigma[i]
    gravity = surfaces.gravity
    for frame in range(max(2, len(stamps) - _REACH), len(stamps)):
        before = motion_before(flight_sums, angle_sums, sigma, frame)
        if not before.cost + IMPACT + charge < best.cost[i]:
            continue  # the motion after it only adds to the cost
        begin, end = stamps[frame - 1], stamps[frame]
        middle = 0.5 * (begin + end)
        speed = length(plus(before.slope, times(middle, gravity)))
        doubt = SLACK * sigma * math.sqrt(variance_at(before, middle)) / max(speed, 1e-300)
        slack = min(doubt, MOST_SLACK * (end - begin))
        position = plus(origin, before.origin)
        hit = first_impact(
            surfaces, position, before.slope, radius, begin, begin - slack, end + slack
        )
        if hit.time == math.inf:
            continue
        when = min(max(hit.time, begin), end)
        incoming = plus(before.slope, times(when, gravity))
        law_velocity, spin = after_impact(incoming, before.spin, hit, radius, surfaces.inertia)
        change = minus(law_velocity, incoming)
        along, tangent = dot(change, hit.normal), length(across(change, hit.normal))
        drift = sigma**2 / before.span + (1e-6 * speed) ** 2  # never zero
        # where rotations are not tracked, the spin is unknown
        rotation_tracked = angle_sums[-1, 9] + angle_sums[-1, 10] + angle_sums[-1, 11] > 0
        unknown = tangent if rotation_tracked else hit.friction * abs(along)
        after = motion_after(
            flight_sums,
            frame,
            when,
            plus(before.origin, times(when, before.slope)),
            1.0 / variance_at(before, when),
            minus(law_velocity, times(when, gravity)),
            hit.normal,
            sigma**2 / (drift + (_NORMAL * along) ** 2 + 1e-30),
            sigma**2 / (drift + (_TANGENT * unknown) ** 2 + (0.02 * along) ** 2 + 1e-30),
            sigma,
        )
        contact = Contact(frame, when, plus(before.angle, times(when, before.spin)), spin)
        try_contact(best, i, joined(before, after, charge), FLIGHT, contact)


@in_place
def joined(before: MotionBefore, after: Hypothesis, charge: float) -> Hypothesis:
    """Hypothesis of the motions before and after a contact together."""
    cost = before.cost + after.cost + IMPACT + charge
    return Hypothesis(
        cost, after.origin, after.slope, after.frames + int(before.seen), after.error
    )


@in_place
def motion_after(
    sums: Array,
    frame: int,
    when: float,
    position: Vector,
    contact_weight: float,
    expected: Vector,
    normal: Vector,
    normal_weight: float,
    tangent_weight: float,
    sigma: float,
) -> Hypothesis:
    """Line through the frames from `frame` on, the contact, and an expected slope.

    Args:
        sums: Prefix sums of positions without the known acceleration.
        frame: First frame after the contact.
        when: Time of the contact [s].
        position: Position at the contact without the known acceleration [m].
        contact_weight: Weight of that position in units of a measurement's.
        expected: Expected slope [m/s].
        normal: Normal of the contact.
        normal_weight: Weight of the expected slope along the normal [s^2].
        tangent_weight: Weight of the expected slope across the normal [s^2].
        sigma: Noise of a coordinate [m].
    """
    count = sums[-1, 0] - sums[frame, 0]
    ones = count + contact_weight
    first = sums[-1, 1] - sums[frame, 1] + contact_weight * when
    span = sums[-1, 2] - sums[frame, 2] + contact_weight * when**2 - first**2 / ones
    own = times(contact_weight, position)
    value = plus(_since(sums, frame, 3), own)
    power = _since(sums, frame, 9)
    total = power[0] + power[1] + power[2] + dot(own, position) - dot(value, value) / ones
    moment = plus(_since(sums, frame, 6), times(when, own))
    covariance = minus(moment, times(first / ones, value))
    part, goal = dot(covariance, normal), dot(expected, normal)
    normal_slope = (part + normal_weight * goal) / (span + normal_weight)
    # residuals of positions and of the slope, at the best slope
    total += (
        normal_slope**2 * span
        - 2.0 * normal_slope * part
        + normal_weight * (normal_slope - goal) ** 2
    )
    rest, aim = minus(covariance, times(part, normal)), minus(expected, times(goal, normal))
    level = times(1.0 / (span + tangent_weight), plus(rest, times(tangent_weight, aim)))
    off = minus(level, aim)
    total += dot(level, level) * span - 2.0 * dot(level, rest) + tangent_weight * dot(off, off)
    slope = plus(level, times(normal_slope, normal))
    origin = times(1.0 / ones, minus(value, times(first, slope)))
    cost = max(total, 0.0) / sigma**2 if count > 0.5 else math.inf
    return Hypothesis(
        cost,
        origin,
        slope,
        int(count),
        sigma / math.sqrt(span + min(normal_weight, tangent_weight)),
    )


@in_place
def _since(sums: Array, frame: int, column: int) -> Vector:
    """Sums of three columns over the frames from `frame` on."""
    return (
        sums[-1, column] - sums[frame, column],
        sums[-1, column + 1] - sums[frame, column + 1],
        sums[-1, column + 2] - sums[frame, column + 2],
    )


@in_place
def never_turns(angles: Array) -> bool:
    """Whether a sphere has one rotation throughout, which tells nothing of its spin.

    Args:
        angles: Rotation vectors since the first frame [rad], shape (frames, 3).
    """
    largest = 0.0
    for frame in range(len(angles)):
        for axis in range(3):
            largest = max(largest, abs(angles[frame, axis]))
    return largest <= 1e-9


@in_place
def spin_since(best: Hypotheses, i: int, window: Observations) -> Vector:
    """Spin of sphere i where one frame follows its last contact [rad/s]."""
    stamps, angles = window.stamps, window.angles[i]
    if never_turns(angles):
        return 0.0, 0.0, 0.0
    last, frame = window.last[i], best.begin[i]
    since = stamps[last] - best.contact_times[i]
    if since <= _SOON * (stamps[frame] - stamps[frame - 1]):
        return row(best.spins_after, i)
    return times(1.0 / since, minus(row(angles, last), row(best.angles, i)))
