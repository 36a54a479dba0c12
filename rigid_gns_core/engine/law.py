# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The laws of one contact alone: coefficients, and where it ends up along its normal.

Normal impact is Newton's: it separates with e times the speed of approach. Friction is Coulomb's,
|tangential impulse| <= mu N; rolling friction takes a torque of at most rho r N. Both are in
steps.py.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .contacts import Contacts
from .world import UNIT_GRAVITY, World
from ..kernels.jit import compiled, in_place
from ..scenes.state import Array

# approach speeds below this do not bounce: as the teacher, 3 g dt / 240
RESTITUTION_THRESHOLD = 3.0 * UNIT_GRAVITY * 0.1 / 240.0


class Law(NamedTuple):
    """Coefficients of the contacts of one substep, shape (c,) each.

    restitution, friction: of the pair; rolling: rho r [lengths], 0 between spheres;
    inverse_effective_mass: change of separation velocity by a unit of normal impulse,
    1 / m_a + 1 / m_b; arm_a, arm_b: from centre to contact point; rotation_a, rotation_b:
    arm^2 / inertia, what turning adds to it across the normal.
    """

    restitution: Array
    friction: Array
    rolling: Array
    inverse_effective_mass: Array
    arm_a: Array
    arm_b: Array
    rotation_a: Array
    rotation_b: Array


class Target(NamedTuple):
    """What a contact would come to, alone, under what accelerates it now.

    active: whether the bodies touch at all; separation_velocity: at the end of the substep;
    flight_time: since the last bounce where they are apart then, else 0; impulse: normal impulse
    over effective mass; impulse_time: before the end, at which that impulse, acting at once, leads
    to the same place; remaining: what is left of the substep after the impact.
    """

    active: bool
    separation_velocity: float
    flight_time: float
    impulse: float
    impulse_time: float
    remaining: float


@compiled
def law_of(world: World, contacts: Contacts) -> Law:
    """Coefficients of contacts: those of a pair are products of its materials."""
    size = len(contacts.a)
    own = np.empty((8, size))
    law = Law(
        restitution=own[0],
        friction=own[1],
        rolling=own[2],
        inverse_effective_mass=own[3],
        arm_a=own[4],
        arm_b=own[5],
        rotation_a=own[6],
        rotation_b=own[7],
    )
    for k in range(size):
        a, b, plane, gap = contacts.a[k], contacts.b[k], contacts.plane[k], contacts.gap[k]
        if plane >= 0:
            restitution, friction = world.surface_restitution[plane], world.surface_friction[plane]
            law.rolling[k] = world.rolling_friction[a] * world.radius[a]
            law.arm_a[k], law.arm_b[k] = world.radius[a] + gap, 0.0
        else:
            restitution, friction = world.restitution[b], world.friction[b]
            law.rolling[k] = 0.0
            law.arm_a[k], law.arm_b[k] = world.radius[a] + 0.5 * gap, world.radius[b] + 0.5 * gap
        law.restitution[k] = world.restitution[a] * restitution
        law.friction[k] = world.friction[a] * friction
        law.inverse_effective_mass[k] = world.inverse_mass[a] + world.inverse_mass[b]
        law.rotation_a[k] = law.arm_a[k] * law.arm_a[k] * world.inverse_inertia[a]
        law.rotation_b[k] = law.arm_b[k] * law.arm_b[k] * world.inverse_inertia[b]
    return law


@in_place
def target_of(
    e: float,
    h: float,
    time: float,
    gap: float,
    approach_speed: float,
    acceleration: float,
    coupling: float,
) -> Target:
    """Return where one contact alone ends up along its normal, after all bounces of a substep.

    A sphere that falls with a bounces with e times the speed of each approach u: its flights take
    t_k = 2 e^k u / a, k = 1, 2, ..., a geometric series, so that the number of flights within the
    time T that remains is n = floor(log(1 - T a (1 - e) / (2 e u)) / log(e)), and the last one
    began 2 e u / a (1 - e^n) / (1 - e) after the impact, at e^(n+1) u. When the approach is slower
    than `RESTITUTION_THRESHOLD`, or the logarithm's argument is negative, it rests. So small
    bounces need no small substeps. (Series: any text on mechanics; e.g. Goldsmith, Impact, 1960.)

    Args:
        e: Restitution.
        h: Length of the substep.
        time: Of impact, on the free path.
        gap: Of a contact that is speculative, else 0.
        approach_speed: At the time of impact.
        acceleration: Relative, of free motion along the normal.
        coupling: Relative acceleration along the normal that other contacts make. It shifts the
            time of impact, or prevents it: a sphere that others hold does not fall.
    """
    acceleration += coupling
    before = max(time, 0.0)
    gap += 0.5 * coupling * before * before
    closing = approach_speed - coupling * before
    root = closing * closing - 2.0 * acceleration * gap
    sum_of = closing + math.sqrt(max(root, 1e-24))
    later, active = 0.0, before == 0 and gap == 0
    if gap != 0:
        later = 2.0 * gap / (sum_of if sum_of > 1e-12 else 1.0)
    if not active:
        active = root >= 0 and sum_of > 1e-12 and before + later <= h
    later = max(later, -before) if active else 0.0
    approach_speed = closing - acceleration * later
    remaining = max(h - before - later, 0.0)
    fall = max(-acceleration, 0.0)
    closing = max(approach_speed, 0.0)
    late = (before - time) * closing  # how far they went too deep
    fallen = closing * remaining + 0.5 * fall * remaining * remaining
    separation, height, flight_time, bounced = 0.0, 0.0, 0.0, False
    if approach_speed > RESTITUTION_THRESHOLD and e > 1e-3:
        one_less = min(max(1.0 - e, 1e-6), 1.0 - 1e-6)
        speed = max(e * approach_speed, 1e-12)
        left = 1.0 - remaining * fall * one_less / (2.0 * speed)
        if left > 0:
            log_e = math.log1p(-one_less)
            flights = max(math.floor(math.log(max(left, 1e-30)) / log_e), 0.0)
            most = math.ceil(math.log(RESTITUTION_THRESHOLD / approach_speed) / log_e)
            bounced = flights < most
            if bounced:
                damping = math.exp(flights * log_e)
                flight_time = remaining
                if flights > 0:
                    flight_time -= 2.0 * speed / max(fall, 1e-9) * (1.0 - damping) / one_less
                last = speed * damping
                separation = last - fall * flight_time
                height = last * flight_time - 0.5 * fall * flight_time * flight_time
    impulse = separation + closing + fall * remaining
    if bounced:
        late *= 1.0 + e
    impulse_time = (height + fallen + late) / max(impulse, 1e-9)
    return Target(
        active=active,
        separation_velocity=separation,
        flight_time=flight_time,
        impulse=impulse,
        impulse_time=impulse_time,
        remaining=remaining,
    )
