# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Options of the laws."""

from __future__ import annotations

from dataclasses import dataclass

from ..files.config import check_least


@dataclass(frozen=True)
class LawsOptions:
    """Options of the laws, for measurements rather than for use.

    Args:
        guard: Limit the energy of every island.
        sleep: Let islands at rest sleep.
        substeps: K, substeps of a frame in which something may touch.
        rounds: M, iterations of the solver in a substep.
    """

    guard: bool = True
    sleep: bool = True
    substeps: int = 8
    rounds: int = 4

    def __post_init__(self) -> None:
        check_least(self, 1, 'substeps', 'rounds')


@dataclass(frozen=True)
class ResidualConfig:
    """Sizes of a residual network.

    Args:
        width: W, numbers by which a side of a contact is known.
        vectors: K, vectors that a body gathers from its contacts.
    """

    width: int = 48
    vectors: int = 8

    def __post_init__(self) -> None:
        check_least(self, 1, 'width', 'vectors')
