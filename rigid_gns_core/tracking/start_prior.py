# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Distribution of the spin at the start of a window, learned from other windows.

A launcher or a player gives spins that go with places and velocities. The prior of a window is
the mean and covariance of the spins of windows that looked alike, by a Gaussian kernel of the
distance of (p, v) in deviations of all, shrunk towards those of all windows:

    k_i = exp(-d_i^2 / 2 b^2),   mean = (sum_i k_i w_i + a w_all) / (sum_i k_i + a)

Spins are told in axes along the horizontal velocity, since a shot aimed elsewhere spins alike.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .jit import plain
from .spin_windows import spin_at, SpinWindows
from ..scenes.state import Array
from ..scenes.tracker import Spins

# standard deviation of the speed at the equator, of a spin of which nothing is known [m/s]
_BROAD = 1.2
# a spin is known where the trace of its covariance is below this [rad^2/s^2]
_KNOWN = 300.0


@dataclass(frozen=True)
class StartPrior:
    """Windows of known spin.

    Args:
        features: Position [m] and velocity [m/s] at the start of each window, shape (k, 6).
        spins: Angular velocity there [rad/s] in axes along the velocity, shape (k, 3); of a ball
            on a surface what comes to that of rolling.
        covariances: Of the spins, shape (k, 3, 3).
        bandwidth: b, in standard deviations of the features; infinite: all windows count alike.
        shrinkage: a, in windows.
        floor: Least standard deviation of a prior [rad/s].
    """

    features: Array
    spins: Array
    covariances: Array
    bandwidth: float = 0.5
    shrinkage: float = 0.3
    floor: float = 5.0

    @classmethod
    def of(cls, spins: Spins) -> StartPrior:
        """Prior from the spins that a scene keeps."""
        rows = np.array(spins.windows)
        covariances = np.empty((len(rows), 3, 3))
        first, second = np.triu_indices(3)
        covariances[:, first, second] = covariances[:, second, first] = rows[:, 9:]
        own = (spins.bandwidth, spins.shrinkage, spins.floor)
        return cls(rows[:, :6], rows[:, 6:9], covariances, *own)

    @classmethod
    def of_any_spin(cls, radius: float) -> StartPrior:
        """Prior of a ball of which nothing is known: speeds at its equator of about 1 m/s."""
        one = np.eye(3)[None] * (_BROAD / radius) ** 2
        return cls(np.zeros((1, 6)), np.zeros((1, 3)), one, np.inf, floor=0.0)

    @cached_property
    def scales(self) -> Array:
        """Unit of distance of each feature, shape (6,): its deviation; not below 1 cm, 1 dm/s."""
        return np.maximum(self.features.std(axis=0), [0.01] * 3 + [0.1] * 3)

    @cached_property
    def windows(self) -> SpinWindows:
        """The same for compiled code."""
        spread = np.trace(self.covariances, axis1=1, axis2=2) + _KNOWN
        share = 1.0 / spread / (1.0 / spread).sum()  # those of little known spin count less
        mean = share @ self.spins
        apart = self.spins - mean
        covariance = np.einsum('i,ia,ib->ab', share, apart, apart)
        covariance += np.einsum('i,iab->ab', share, self.covariances)
        return SpinWindows(
            features=plain(self.features),
            spins=plain(self.spins),
            covariances=plain(self.covariances),
            counted=plain(_KNOWN / spread),
            scales=plain(self.scales),
            mean=plain(mean),
            covariance=plain(covariance),
            bandwidth=float(self.bandwidth),
            shrinkage=float(self.shrinkage),
            floor=float(self.floor),
        )

    def at(
        self, position: Array, velocity: Array, left_out: Array | None = None
    ) -> tuple[Array, Array]:
        """Mean [rad/s], shape (3,), and covariance, shape (3, 3), of the spin of a window.

        Args:
            position: At its start [m], shape (3,).
            velocity: There [m/s], shape (3,).
            left_out: Windows that do not count, as a mask of shape (k,).
        """
        counted = self.windows.counted
        if left_out is not None:
            counted = np.where(left_out, 0.0, counted)
        mean, covariance = np.zeros(3), np.zeros((3, 3))
        spin_at(self.windows, counted, np.concatenate([position, velocity]), mean, covariance)
        return mean, covariance
