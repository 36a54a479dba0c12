# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a user may choose of a model that is loaded."""

from __future__ import annotations

from dataclasses import dataclass

from ..files.config import check_least


@dataclass(frozen=True)
class LawsOptions:
    """What a user may change of the laws; for measurements rather than for use.

    Args:
        guard: Hold the energy of every island down.
        sleep: Let islands at rest sleep.
        substeps: K, substeps of a frame in which something may touch.
        rounds: M, rounds of the contact solver in a substep.
    """

    guard: bool = True
    sleep: bool = True
    substeps: int = 8
    rounds: int = 4

    def __post_init__(self) -> None:
        check_least(self, 1, 'substeps', 'rounds')
