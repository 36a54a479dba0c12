# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random scenes and starts by seed, and properties of their motion that need no reference."""

from .comparisons import Engines
from .failure import Failure, PROPERTIES
from .properties import check
from .run import engines_of, fuzz, Tally
from .scenes import Case, draw_case, KINDS

__all__ = [
    'KINDS',
    'PROPERTIES',
    'Case',
    'Engines',
    'Failure',
    'Tally',
    'check',
    'draw_case',
    'engines_of',
    'fuzz',
]
