# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settings of the tracking filter, and how many frames they keep and use."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .environment import Environment
from .noise_estimate import MIN_DIFFERENCES, NOISE_FRAMES
from ..errors import UserError

# defaults: coast time [sqrt(r / g)] and largest speed of a new track [sqrt(g r)]
_COAST, _MAX_SPEED = 2.0, 50.0


@dataclass(frozen=True)
class TrackerSettings:
    """Settings of the tracking filter.

    Args:
        environment: Surfaces, gravity and radii.
        length: Number of frames from which motion is estimated.
        matched: Whether poses are associated with tracks; if not, they keep their order.
        noise: Standard deviation of each coordinate of a position [m]; None: estimated.
        coast_time: A track not seen for longer is deleted [s], but not within two frames.
        max_speed: Largest speed of a new track [m/s].
        radius: Radius of the largest sphere [m].
        memory: Frames of this time before the newest are kept as well [s].
        most: Of more spheres only the window is kept.
    """

    environment: Environment
    length: int
    matched: bool
    noise: float | None
    coast_time: float
    max_speed: float
    radius: float
    memory: float = 0.0
    most: float = np.inf

    @classmethod
    def of(
        cls,
        environment: Environment,
        radius: float,
        *,
        length: int,
        matched: bool,
        noise: float | None,
        coast_time: float | None,
        max_speed: float | None,
        memory: float,
        most: float,
    ) -> TrackerSettings:
        """Settings with defaults in place of None; the arguments are the fields.

        Raises:
            UserError: A number is negative or not finite.
        """
        for name, value in (
            ('noise', noise),
            ('coast_time', coast_time),
            ('max_speed', max_speed),
        ):
            if value is not None and not (value >= 0 and np.isfinite(value)):
                raise UserError(f'{name} is {value}, expected 0 or more')
        gravity = float(np.linalg.norm(environment.gravity)) or 1.0
        natural = float(np.sqrt(radius / gravity))  # time to fall half a radius [s]
        return cls(
            environment=environment,
            length=length,
            matched=matched,
            noise=noise,
            coast_time=_COAST * natural if coast_time is None else coast_time,
            max_speed=_MAX_SPEED * natural * gravity if max_speed is None else max_speed,
            radius=radius,
            memory=memory,
            most=most,
        )

    @property
    def fewest(self) -> int:
        """Number of frames kept at least; a late one is inserted among as many."""
        return max(self.length, NOISE_FRAMES)

    def used(self, stamps: NDArray[np.int64], spheres: int) -> int:
        """Number of the newest frames from which a start is estimated.

        Those of the window, of the memory, and so many that the noise of few spheres is known.
        """
        used = self.length
        if self.noise is None and not self.matched and spheres and self.length >= NOISE_FRAMES:
            used = max(used, -(-MIN_DIFFERENCES // (3 * spheres)) + NOISE_FRAMES - 1)
        if self.memory and len(stamps) and spheres <= self.most:
            oldest = int(stamps[-1]) - round(self.memory * 1e9)
            used = max(used, len(stamps) - int(stamps.searchsorted(oldest)))
        return min(used, len(stamps))
