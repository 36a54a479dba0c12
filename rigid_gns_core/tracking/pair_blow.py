# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A blow of two balls that estimates go through: the state of one after it, by both before it.

With n from the first centre to the second, approach speed g, slip u of the points that touch,
s = m_2 / (m_1 + m_2) and kappa = I / (m r^2), the first ball's changes are

    dv_n = -(1 + e) s g n
    dv_t = -min(mu |dv_n|, (1 + beta) |u| / (1 + 1/kappa_1 + (m_1 / m_2) (1 + 1/kappa_2))) u / |u|
    dw   = n x dv_t / (kappa_1 r_1)
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import NamedTuple

import numpy as np

from .ball_contact import restitution
from .ball_path import start_of
from .jit import compiled, entry, in_place
from .path_slopes import path_and_slopes
from ..kernels.neighbours import Indices
from ..kernels.vector import across, cross, dot, length, minus, plus, Vector
from ..kernels.vector import times as scaled
from ..scenes.scene import Scene
from ..scenes.state import Array

# columns of pairs: restitution_slow, restitution, restitution_speed, friction,
# tangential_restitution of `ContactLaw`, and m_2 / (m_1 + m_2)
FRICTION, GRIP, SHARE, PAIR = 3, 4, 5, 6

# what the laws do not know of a blow, as parts of the approach speed: of velocity, and of spin as
# a speed at the equator; and at least [m/s]
_VELOCITY, _SPIN, _LEAST = 0.03, 0.1, 0.01
# and of a place [m], so that no covariance is singular
_PLACE = 1e-5
# steps of differences of places, velocities [m, m/s] and spins [rad/s]
_STEPS = (1e-6, 1e-5, 1e-3)
# the time of a blow is found to this [s]
_SOON = 1e-4


class Crossed(NamedTuple):
    """State of a ball at a blow, just after it.

    time: of the blow [s], infinite: there is none; mean: position, velocity, angular velocity,
    shape (9,); covariance: shape (9, 9).
    """

    time: float
    mean: Array
    covariance: Array


@compiled
def not_crossed() -> Crossed:
    """No blow."""
    return Crossed(math.inf, np.zeros(9), np.zeros((9, 9)))


def pair_rows(scene: Scene, spheres: Sequence[int], count: int) -> Array:
    """Laws of each two of some of `count` spheres, by number: see `PAIR`, shape (n, n, PAIR).

    Without a contact law they are smooth: the friction of two balls is seldom known as the product
    of what they have with surfaces.
    """
    rows = np.zeros((len(spheres), len(spheres), PAIR))
    law, mass = scene.sphere_contact, scene.per_sphere('mass', count)[list(spheres)]
    if law is None:
        own = scene.per_sphere('restitution', count)[list(spheres)]
        rows[..., :FRICTION] = np.outer(own, own)[..., None]
        rows[..., 2] = 1.0
    else:
        curve = law.curve
        rows[..., :GRIP] = curve.slow, curve.fast, curve.speed, law.friction
        rows[..., GRIP] = law.tangential_restitution
    rows[..., SHARE] = mass / (mass[:, None] + mass)
    return rows


@in_place
def _part(both: Array, ball: int, first: int) -> Vector:
    """Position, velocity or angular velocity of one of two balls, by its first column."""
    return (both[ball, first], both[ball, first + 1], both[ball, first + 2])


@in_place
def _until_touch(both: Array, reach: float) -> float:
    """Time until two balls that move evenly touch [s], negative where they have; else infinite."""
    apart = minus(_part(both, 1, 0), _part(both, 0, 0))
    slip = minus(_part(both, 1, 3), _part(both, 0, 3))
    along, square = dot(apart, slip), dot(slip, slip)
    inside = along * along - square * (dot(apart, apart) - reach * reach)
    if along >= 0.0 or inside <= 0.0:
        return math.inf
    return (-along - math.sqrt(inside)) / square


@in_place
def _after(both: Array, balls: Array, law: Array, after_out: Array) -> float:
    """State of the first of two balls after they meet, shape (9,), told for the time of `both`.

    Args:
        both: States before, shape (2, 9).
        balls: Rows of `ball_path`, shape (2, 16).
        law: See `PAIR`, shape (1, PAIR).
        after_out: The state.

    Returns:
        Approach speed; infinite: they do not meet.
    """
    time = _until_touch(both, balls[0, 7] + balls[1, 7])
    if time == math.inf:
        return math.inf
    p, v, w = _part(both, 0, 0), _part(both, 0, 3), _part(both, 0, 6)
    q, u, x = _part(both, 1, 0), _part(both, 1, 3), _part(both, 1, 6)
    touch = plus(minus(q, p), scaled(time, minus(u, v)))
    n = scaled(1.0 / length(touch), touch)
    approach, share = dot(minus(v, u), n), law[0, SHARE]
    change = (1.0 + restitution(approach, law, 0)) * share * approach
    own, other = scaled(balls[0, 7], n), scaled(balls[1, 7], n)
    slip = across(minus(plus(v, cross(w, own)), minus(u, cross(x, other))), n)
    size = length(slip)
    rubbed = (0.0, 0.0, 0.0)
    if size > 0.0:
        held = 1.0 + 1.0 / balls[0, 15] + (1.0 - share) / share * (1.0 + 1.0 / balls[1, 15])
        rub = min(law[0, FRICTION] * change, (1.0 + law[0, GRIP]) * size / held)
        rubbed = scaled(-rub / size, slip)
    after = plus(minus(v, scaled(change, n)), rubbed)
    # on the way from the blow it was at the new velocity already
    place = plus(p, scaled(time, minus(v, after)))
    turned = plus(w, scaled(1.0 / (balls[0, 15] * balls[0, 7]), cross(n, rubbed)))
    for c in range(3):
        after_out[c], after_out[3 + c], after_out[6 + c] = place[c], after[c], turned[c]
    return approach


@compiled
def _carried(
    ball: Array,
    planes: Array,
    laws: Array,
    state: Array,
    covariance: Array,
    on: int,
    begin: float,
    time: float,
    state_out: Array,
    covariance_out: Array,
) -> None:
    """State of a ball at a later time, and its covariance by the slopes of its path."""
    start, change = np.zeros(9), np.zeros((9, 9))
    start_of(state, planes, on, ball[0, 7], start, change)
    states, slopes = np.zeros((1, 9)), np.zeros((1, 9, 9))
    stamps, contacts = np.array([time]), np.zeros((1, 3))
    path_and_slopes(
        start, np.ones(9), begin, stamps, ball, planes, laws, on, states, slopes, contacts
    )
    slope = slopes[0] @ change
    state_out[:] = states[0]
    covariance_out[:] = slope @ covariance @ slope.T


@entry
def cross_blow(
    balls: Array,
    planes: Array,
    laws: Array,
    law: Array,
    states: Array,
    covariances: Array,
    on: Indices,
    lasts: Array,
    until: float,
    mean_out: Array,
    covariance_out: Array,
) -> float:
    """State of the first of two balls just after they meet.

    Args:
        balls: Rows of `ball_path`, shape (2, 16).
        planes: See there.
        laws: Of each ball, shape (2, planes, 8).
        law: Of the pair, see `PAIR`, shape (1, PAIR).
        states: Estimates before the blow, shape (2, 9).
        covariances: Their covariances, shape (2, 9, 9).
        on: Surfaces that they are on, or FREE, shape (2,).
        lasts: Times of the estimates [s], shape (2,).
        until: Time before which they have met [s].
        mean_out: The state, shape (9,).
        covariance_out: Its covariance, shape (9, 9).

    Returns:
        Time of the blow [s]; infinite: by these states there is none.
    """
    reach = balls[0, 7] + balls[1, 7]
    both, spread = np.zeros((2, 9)), np.zeros((2, 9, 9))
    soonest = max(lasts[0], lasts[1])
    time, left = soonest, math.inf
    for _ in range(4):
        for k in range(2):
            _carried(
                balls[k : k + 1], planes, laws[k], states[k], covariances[k], on[k], lasts[k],
                time, both[k], spread[k],
            )  # fmt: skip
        left = _until_touch(both, reach)
        met = min(max(time + left, soonest), until)
        if abs(met - time) < _SOON or left == math.inf:
            break
        time = met
    approach = _after(both, balls, law, mean_out)
    if approach == math.inf or abs(left) > 0.1 * reach / max(approach, 1e-9):
        return math.inf
    moved, after = both.copy(), np.zeros(9)
    covariance_out[:] = 0.0
    slope = np.zeros((9, 9))
    for k in range(2):
        for j in range(9):
            step = _STEPS[j // 3]
            moved[k, j] += step
            if _after(moved, balls, law, after) == math.inf:
                return math.inf
            for i in range(9):
                slope[i, j] = (after[i] - mean_out[i]) / step
            moved[k, j] = both[k, j]
        covariance_out += slope @ spread[k] @ slope.T
    for c in range(3):
        covariance_out[c, c] += _PLACE**2
        covariance_out[3 + c, 3 + c] += (_LEAST + _VELOCITY * approach) ** 2
        covariance_out[6 + c, 6 + c] += ((_LEAST + _SPIN * approach) / balls[0, 7]) ** 2
    return time
