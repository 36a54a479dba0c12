# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of an engine against closed forms, each with its error and its bound.

`run_checks` takes any callable with the signature of `teacher.simulate`. `rigid-gns closed-forms`
runs them on Bullet or on a model.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from .air import air_checks
from .bounces import Simulate
from .ceilings import ceiling_checks, strip_checks
from .check import Check
from .contact_laws import curve_checks, grip_checks
from .edges import edge_checks, topple_checks
from .enclosed import load_checks, room_checks
from .joints import joint_checks
from .many_spheres import collision_checks, pile_checks
from .moving_surfaces import moving_checks
from .obstacles import obstacle_checks
from .one_sphere import bounce_checks, incline_checks, level_checks, oblique_checks
from .resistance import resistance_checks
from .seams import seam_checks
from .shared_contacts import shared_checks
from .slow_impacts import slow_checks
from ..errors import UserError

__all__ = ['GROUPS', 'Check', 'run_checks']

GROUPS: dict[str, Callable[[Simulate, bool], Iterator[Check]]] = {
    'bounce': bounce_checks,
    'incline': incline_checks,
    'level': level_checks,
    'oblique': oblique_checks,
    'collision': collision_checks,
    'pile': pile_checks,
    'shared': shared_checks,
    'seam': seam_checks,
    'joint': joint_checks,
    'ceiling': ceiling_checks,
    'strip': strip_checks,
    'edge': edge_checks,
    'topple': topple_checks,
    'slow': slow_checks,
    'room': room_checks,
    'load': load_checks,
    'air': air_checks,
    'grip': grip_checks,
    'curve': curve_checks,
    'resistance': resistance_checks,
    'moving': moving_checks,
    'obstacle': obstacle_checks,
}


def run_checks(
    simulate: Simulate, quick: bool = False, groups: tuple[str, ...] = tuple(GROUPS)
) -> list[Check]:
    """Run all checks on an engine: a callable (scene, start, steps, dt) -> Trajectory.

    Args:
        simulate: The engine.
        quick: Fewer cases and shorter piles.
        groups: Names in `GROUPS`.

    Raises:
        UserError: A group is unknown.
    """
    if unknown := sorted(set(groups) - set(GROUPS)):
        raise UserError(f'unknown group of checks {unknown[0]!r}, allowed: {", ".join(GROUPS)}')
    return [check for name in groups for check in GROUPS[name](simulate, quick)]
