# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Impacts on surfaces: a flight in and out, fitted together, for each interval of a window.

The flight before says when and where the surface is met. The flight after begins there: with one
frame after the contact its velocity is known already. The law of impact enters as a measurement of
that velocity, as uncertain as materials are, which counts where the frames after it are few.
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

# prior of an impact: standard deviations, as parts of the changes that the law says
_NORMAL, _TANGENT = 0.1, 0.3
# a contact may be found a little outside of its two frames: standard deviations of the flight, but
# at most a part of the interval
SLACK, MOST_SLACK = 3.0, 0.25
# contacts are sought so many frames back, and the flights before them so long: what was earlier
# adds little, and cost would grow with the square of the window
_REACH = 10
# charge for a contact: at the moment of one it is better not yet to have happened, as a model then
# makes it happen
IMPACT = 8.0
# nearer to its contact than this part of an interval, a frame tells less of spin than the law does
_SOON = 0.3


class MotionBefore(NamedTuple):
    """The motion before a contact, the longest that fits.

    Args:
        cost: As in `Hypothesis`.
        origin: Place at time 0, as the sums have it [m].
        slope: [m/s].
        middle: Mean time of its frames [s].
        span: Sum of squared distances in time from it [s^2].
        seen: Number of frames that show it.
        angle: Rotation vector at time 0 [rad].
        spin: [rad/s].
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
def motion_before(sums: Array, turns: Array, sigma: float, frame: int) -> MotionBefore:
    """Return the cheapest motion through frames before `frame`, which is at least the third."""
    first = max(0, frame - _REACH)
    cost, cheapest = math.inf, first
    for begin in range(first, frame - 1):
        line = fit_line(sums, begin, frame)
        own = line.misfit / sigma**2 + OUTLIER * sums[begin, 0]
        if line.seen > 1.5 and own < cost:
            cost, cheapest = own, begin
    line, spin = fit_line(sums, cheapest, frame), fit_line(turns, cheapest, frame)
    return MotionBefore(
        cost, line.origin, line.slope, line.middle, line.span, line.seen, spin.origin, spin.slope
    )


@in_place
def variance_at(before: MotionBefore, time: float) -> float:
    """Variance of a place on the motion before, in units of that of a measurement."""
    return 1.0 / before.seen + (time - before.middle) ** 2 / before.span


@in_place
def try_surface_impacts(
    best: Hypotheses, i: int, window: Observations, surfaces: Surfaces, extra: float
) -> None:
    """Try an impact in front of each frame.

    Args:
        best: Takes those that cost least.
        i: Of the sphere.
        window: Three frames or more.
        surfaces: And gravity.
        extra: Charge.
    """
    stamps, flights, turns = window.stamps, window.flights[i], window.turns[i]
    origin, radius, sigma = row(window.origin, i), window.radii[i], window.sigma[i]
    gravity = surfaces.gravity
    for frame in range(max(2, len(stamps) - _REACH), len(stamps)):
        before = motion_before(flights, turns, sigma, frame)
        if not before.cost + IMPACT + extra < best.cost[i]:
            continue  # what comes after costs something too
        begin, end = stamps[frame - 1], stamps[frame]
        middle = 0.5 * (begin + end)
        speed = length(plus(before.slope, times(middle, gravity)))
        doubt = SLACK * sigma * math.sqrt(variance_at(before, middle)) / max(speed, 1e-300)
        slack = min(doubt, MOST_SLACK * (end - begin))
        place = plus(origin, before.origin)
        hit = first_impact(surfaces, place, before.slope, radius, begin - slack, end + slack)
        if hit.time == math.inf:
            continue
        when = min(max(hit.time, begin), end)
        incoming = plus(before.slope, times(when, gravity))
        law, spin = after_impact(incoming, before.spin, hit, radius)
        change = minus(law, incoming)
        along, tangent = dot(change, hit.normal), length(across(change, hit.normal))
        drift = sigma**2 / before.span + (1e-6 * speed) ** 2  # never without any doubt
        # of a spin that no tracker follows nothing is known
        turned = turns[-1, 9] + turns[-1, 10] + turns[-1, 11] > 0
        unknown = tangent if turned else hit.friction * abs(along)
        after = motion_after(
            flights,
            frame,
            when,
            plus(before.origin, times(when, before.slope)),
            1.0 / variance_at(before, when),
            minus(law, times(when, gravity)),
            hit.normal,
            sigma**2 / (drift + (_NORMAL * along) ** 2 + 1e-30),
            sigma**2 / (drift + (_TANGENT * unknown) ** 2 + (0.02 * along) ** 2 + 1e-30),
            sigma,
        )
        contact = Contact(frame, when, plus(before.angle, times(when, before.spin)), spin)
        try_contact(best, i, joined(before, after, extra), FLIGHT, contact)


@in_place
def joined(before: MotionBefore, after: Hypothesis, extra: float) -> Hypothesis:
    """Return the motions before and after a contact, as one hypothesis."""
    cost = before.cost + after.cost + IMPACT + extra
    return Hypothesis(
        cost, after.origin, after.slope, after.frames + int(before.seen), after.error
    )


@in_place
def motion_after(
    sums: Array,
    frame: int,
    when: float,
    place: Vector,
    weight: float,
    expected: Vector,
    normal: Vector,
    along: float,
    across: float,
    sigma: float,
) -> Hypothesis:
    """Return the line through the frames from `frame` on, the contact, and an expected slope.

    Args:
        sums: Of places, less the known acceleration.
        frame: The first after the contact.
        when: Time of the contact [s].
        place: Less the known acceleration, at the contact [m].
        weight: Of this in units of a frame's.
        expected: Slope [m/s].
        normal: Of the contact.
        along: Weight of the expected slope along the normal [s^2].
        across: The same in the other directions [s^2].
        sigma: Noise [m].
    """
    count = sums[-1, 0] - sums[frame, 0]
    ones = count + weight
    first = sums[-1, 1] - sums[frame, 1] + weight * when
    span = sums[-1, 2] - sums[frame, 2] + weight * when**2 - first**2 / ones
    own = times(weight, place)
    value = plus(_since(sums, frame, 3), own)
    power = _since(sums, frame, 9)
    total = power[0] + power[1] + power[2] + dot(own, place) - dot(value, value) / ones
    moment = plus(_since(sums, frame, 6), times(when, own))
    covariance = minus(moment, times(first / ones, value))
    part, goal = dot(covariance, normal), dot(expected, normal)
    normal_slope = (part + along * goal) / (span + along)
    # residuals of places and of the slope, at the best slope
    total += (
        normal_slope**2 * span - 2.0 * normal_slope * part + along * (normal_slope - goal) ** 2
    )
    rest, aim = minus(covariance, times(part, normal)), minus(expected, times(goal, normal))
    level = times(1.0 / (span + across), plus(rest, times(across, aim)))
    off = minus(level, aim)
    total += dot(level, level) * span - 2.0 * dot(level, rest) + across * dot(off, off)
    slope = plus(level, times(normal_slope, normal))
    origin = times(1.0 / ones, minus(value, times(first, slope)))
    cost = max(total, 0.0) / sigma**2 if count > 0.5 else math.inf
    return Hypothesis(
        cost, origin, slope, int(count), sigma / math.sqrt(span + min(along, across))
    )


@in_place
def _since(sums: Array, frame: int, column: int) -> Vector:
    """Return sums of three columns over the frames from `frame` on."""
    return (
        sums[-1, column] - sums[frame, column],
        sums[-1, column + 1] - sums[frame, column + 1],
        sums[-1, column + 2] - sums[frame, column + 2],
    )


@in_place
def spin_since(best: Hypotheses, i: int, window: Observations) -> Vector:
    """Spin of sphere i, seen once since its contact [rad/s]."""
    stamps, turned = window.stamps, window.turned[i]
    largest = 0.0
    for frame in range(len(turned)):
        for axis in range(3):
            largest = max(largest, abs(turned[frame, axis]))
    if largest <= 1e-9:  # nobody tracks it
        return 0.0, 0.0, 0.0
    last, frame = window.last[i], best.begin[i]
    since = stamps[last] - best.times[i]
    if since <= _SOON * (stamps[frame] - stamps[frame - 1]):
        return row(best.laws, i)
    return times(1.0 / since, minus(row(turned, last), row(best.angles, i)))
