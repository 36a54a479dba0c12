# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What forecasts of left-out tracks missed, by what their starts looked like."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .values import checked_number
from ..errors import UserError

# numbers that tell what a start looks like, and parts of its correction: of velocity and spin
FEATURES, PARTS = 10, 6


@dataclass(frozen=True)
class Correction:
    """Correction of estimated starts in flight, as a sum of kernels; see `start_correction`.

    Args:
        windows: Rows of features, and of weights of the correction's parts.
        scales: Unit of distance of each feature.
        bandwidth: Distance at which a start counts as alike [scales].
        floor: Standard deviation that velocities, and speeds at the equator by spin, have beside
            those of the estimate [m/s].

    Raises:
        UserError: There are no windows, rows have not 16 numbers, or a value is out of range.
    """

    windows: tuple[tuple[float, ...], ...]
    scales: tuple[float, ...]
    bandwidth: float
    floor: float

    def __post_init__(self) -> None:
        lengths = {len(row) for row in self.windows}
        if lengths != {FEATURES + PARTS} or len(self.scales) != FEATURES:
            raise UserError(
                f'a correction has rows of {sorted(lengths)} numbers and {len(self.scales)} '
                f'scales, expected rows of {FEATURES + PARTS} and {FEATURES} scales; fit it anew '
                'by `rigid-gns calibrate`'
            )
        if not np.isfinite(self.windows).all():
            raise UserError('windows of a correction hold a number that is not finite')
        for scale in self.scales:
            checked_number('a scale of a correction', scale, above=True)
        for name in ('bandwidth', 'floor'):
            value = checked_number(f'{name} of a correction', getattr(self, name), above=True)
            object.__setattr__(self, name, value)

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        """Hash, made once, as that of `Spins`."""
        return hash((self.windows, self.scales, self.bandwidth, self.floor))
