# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Checks of an engine against closed forms, each with its error and its bound.

`run_checks` takes any callable with the signature of `teacher.simulate`. `rigid-gns closed-forms`
runs them on Bullet or on a model.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from .bounces import Simulate
from .check import Check
from .many_spheres import collision_checks, pile_checks
from .one_sphere import bounce_checks, incline_checks, level_checks, oblique_checks

__all__ = ['GROUPS', 'Check', 'run_checks']

GROUPS: dict[str, Callable[[Simulate, bool], Iterator[Check]]] = {
    'bounce': bounce_checks,
    'incline': incline_checks,
    'level': level_checks,
    'oblique': oblique_checks,
    'collision': collision_checks,
    'pile': pile_checks,
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
        ValueError: A group is unknown.
    """
    if unknown := sorted(set(groups) - set(GROUPS)):
        raise ValueError(f'unknown group of checks {unknown[0]!r}, allowed: {", ".join(GROUPS)}')
    return [check for name in groups for check in GROUPS[name](simulate, quick)]
