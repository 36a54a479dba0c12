# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""How the teacher runs Bullet; `docs/teacher.md` gives the reason for every default."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import UserError


class TeacherError(UserError):
    """Bullet cannot simulate this scene, or not with these settings."""


@dataclass(frozen=True)
class TeacherSettings:
    """How Bullet is run.

    Args:
        substeps: Steps of Bullet per `dt`.
        solver_iterations: Most sweeps over all contacts in a substep; piles need many.
        solver_tolerance: The sweeps end once no contact's velocity changes by this many times g
            times the substep; 0: never.
        bounce_threshold: Approach speeds below this many times g times the substep do not bounce,
            so that piles come to rest.
        contact_erp: Part of a penetration that is removed in a substep, by position alone.
        rolling_updates: Times per `dt` that rolling friction acts on spheres that roll; 0: that of
            Bullet, up to the square root of 2 too strong, at twice the speed.
    """

    substeps: int = 240
    solver_iterations: int = 50
    solver_tolerance: float = 1e-3
    bounce_threshold: float = 3.0
    contact_erp: float = 0.2
    rolling_updates: int = 12

    def __post_init__(self) -> None:
        for name, low, high in (
            ('substeps', 1, 100_000),
            ('solver_iterations', 1, 100_000),
            ('solver_tolerance', 0.0, 1.0),
            ('bounce_threshold', 0.0, 1e6),
            ('contact_erp', 0.0, 1.0),
            ('rolling_updates', 0, 100_000),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise TeacherError(f'{name} of the teacher is {value}, expected {low} to {high}')
