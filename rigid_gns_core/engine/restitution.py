# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Restitution of a pair at an approach speed, by its contact law or its materials."""

from __future__ import annotations

from .world import FAST, given_law, MIDDLE, SLOW, World
from ..kernels.jit import in_place


@in_place
def restitution_at(slow: float, fast: float, middle: float, speed: float) -> float:
    """Restitution at an approach speed u: e_fast + (e_slow - e_fast) u_0 / (u_0 + u)."""
    if slow == fast:
        return slow
    return fast + (slow - fast) * middle / (middle + max(speed, 0.0))


@in_place
def curve_of(world: World, given: int) -> tuple[float, float, float]:
    """Restitution of a contact law: e_slow, e_fast and u_0."""
    return world.laws[given, SLOW], world.laws[given, FAST], world.laws[given, MIDDLE]


@in_place
def restitution_on_plane(world: World, i: int, plane: int, speed: float) -> float:
    """Restitution of a sphere on a plane at an approach speed."""
    given = given_law(world, plane)
    if given >= 0:
        slow, fast, middle = curve_of(world, given)
        return restitution_at(slow, fast, middle, speed)
    return world.restitution[i] * world.laws[plane, SLOW]
