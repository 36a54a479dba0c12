# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is told of a property that does not hold."""

from __future__ import annotations

from dataclasses import dataclass

PROPERTIES = (
    'finite',
    'turned',
    'mirrored',
    'permuted',
    'tiled',
    'substeps',
    'energy',
    'conserved',
    'momentum',
    'inside',
    'depth',
    'file',
)
"""Names of all properties; docs/fuzzing.md says what each is."""


@dataclass(frozen=True)
class Failure:
    """A property that a case breaks.

    Args:
        name: One of `PROPERTIES`.
        size: By how much; `bound`: what is allowed, in the same unit.
        bound: See `size`.
        text: Where: frame, sphere.
    """

    name: str
    size: float
    bound: float
    text: str
