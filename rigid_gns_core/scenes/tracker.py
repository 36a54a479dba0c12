# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is known of a tracker and of the balls' spins: learned from tracks, used to estimate."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .correction import Correction
from .regions import Regions
from .values import checked_number
from ..errors import UserError

# of a tracker
_NOT_NEGATIVE = ('drift', 'impact', 'forecast_drift', 'forecast_impact', 'forecast_acceleration')
# position, velocity and spin at the start of a window, and the spin's covariance, its upper half
_COLUMNS = 15


@dataclass(frozen=True)
class Spins:
    """Spins of balls at the starts of windows, as other windows showed them.

    Args:
        windows: Rows of position [m], velocity [m/s], spin [rad/s] in axes along the horizontal
            velocity, across it and up, and the spin's covariance (xx, xy, xz, yy, yz, zz). Of a
            ball on a surface the spin is what comes to that of rolling.
        bandwidth: Distance at which a window counts as alike [deviations of all]; infinite: all
            count the same.
        shrinkage: Weight of the mean of all [windows].
        floor: Least standard deviation of a spin [rad/s].

    Raises:
        UserError: There are no windows, rows have not 15 numbers, or a value is out of range.
    """

    windows: tuple[tuple[float, ...], ...]
    bandwidth: float = np.inf
    shrinkage: float = 0.3
    floor: float = 0.0

    def __post_init__(self) -> None:
        lengths = {len(row) for row in self.windows}
        if lengths != {_COLUMNS}:
            raise UserError(
                f'windows of spins have rows of {sorted(lengths)} numbers, expected rows of '
                f'{_COLUMNS}; fit them anew by `rigid-gns calibrate`'
            )
        if not np.isfinite(self.windows).all():
            raise UserError('windows of spins hold a number that is not finite')
        if not self.bandwidth > 0:
            raise UserError(f'bandwidth of spins is {self.bandwidth:g}, expected more than 0')
        for name in ('shrinkage', 'floor'):
            value = checked_number(f'{name} of spins', getattr(self, name))
            object.__setattr__(self, name, value)

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        """Hash, made once: scenes are keys of what is kept for them, several times a forecast."""
        return hash((self.windows, self.bandwidth, self.shrinkage, self.floor))


@dataclass(frozen=True)
class Tracker:
    """Noise of a tracker, what the laws leave open beside it, and the prior of spins.

    The path of a ball is that of the laws and a drift: the double integral of white acceleration,
    and a kick of the velocity at each impact.

    Args:
        noise: Standard deviation of a coordinate of a position [m].
        drift: Spectral density q of the acceleration [m^2/s^3].
        impact: Standard deviation of a kick over the approach speed.
        spread: Factor on the covariance of an estimate, so that regions hold what they should.
        forecast_drift: As `drift`, of forecasts.
        forecast_impact: As `impact`, of forecasts.
        memory: Frames of this time before the last count [s].
        spins: Prior of spins; None: any spin is likely.
        forecast_acceleration: Standard deviation of an acceleration on each axis, the same all
            along a forecast [m/s^2]: what laws that are slightly wrong leave.
        correction: Of estimates in flight, learned from what forecasts of other tracks missed;
            None: none was worth it.
        regions: Factors on the radii of regions of forecasts; None: those of a normal
            distribution.

    Raises:
        UserError: A value is out of range.
    """

    noise: float
    drift: float = 0.01
    impact: float = 0.02
    spread: float = 1.0
    forecast_drift: float = 0.01
    forecast_impact: float = 0.02
    memory: float = 0.4
    spins: Spins | None = None
    forecast_acceleration: float = 0.0
    correction: Correction | None = None
    regions: Regions | None = None

    def __post_init__(self) -> None:
        for name in ('noise', 'spread', 'memory'):
            value = checked_number(f'{name} of a tracker', getattr(self, name), above=True)
            object.__setattr__(self, name, value)
        for name in _NOT_NEGATIVE:
            value = checked_number(f'{name} of a tracker', getattr(self, name))
            object.__setattr__(self, name, value)
