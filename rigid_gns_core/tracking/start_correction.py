# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Correction of an estimated start by what forecasts of like starts missed.

Laws, noise and spins are fitted to all tracks; what they leave differs from start to start, but
like ones leave alike. A start in flight with velocity v, spin w and covariance P of both becomes

    (v, w) + sqrt(P + f^2) c(x),    c(x) = sum_i k(x, x_i) a_i,
    k(x, y) = exp(-sum_j ((x_j - y_j) / s_j)^2 / (2 b^2 J))

with spins as speeds at the equator, in axes along the horizontal velocity, and J features x. So it
is told in standard deviations of the estimate: what is well known is hardly moved, and a start
unlike all that were seen is not moved at all. `identification.correction_fit` finds the a_i.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..scenes.correction import Correction, FEATURES
from ..scenes.state import Array

# least deviation of a spin that is told apart, as a speed at the equator [m/s]
_LEAST = 0.01


@dataclass(frozen=True)
class StartCorrection:
    """Starts that were seen, and what each adds.

    Args:
        features: See `features_of`, shape (k, 10).
        weights: a_i, shape (k, 6).
        scales: s_j, shape (10,).
        bandwidth: b.
        floor: f [m/s].
    """

    features: Array
    weights: Array
    scales: Array
    bandwidth: float
    floor: float

    @classmethod
    def of(cls, correction: Correction) -> StartCorrection:
        """The correction that a scene keeps."""
        rows = np.array(correction.windows)
        own = (correction.bandwidth, correction.floor)
        return cls(rows[:, :FEATURES], rows[:, FEATURES:], np.array(correction.scales), *own)

    def corrected(self, states: Array, covariances: Array, radii: Array) -> Array:
        """States of balls in flight with their velocities and spins corrected, shape (n, 9).

        Args:
            states: Position, velocity, angular velocity, shape (n, 9).
            covariances: Of these, shape (n, 9, 9).
            radii: Of the balls [m], shape (n,).
        """
        features = features_of(states, covariances, radii)
        alike = kernel(features / self.scales, self.features / self.scales, self.bandwidth)
        roots = roots_of(states, covariances, radii, self.floor)
        moved = states.copy()
        moved[:, 3:] += np.einsum('nab,nb->na', roots, alike @ self.weights)
        return moved


def kernel(first: Array, second: Array, bandwidth: float) -> Array:
    """Likeness of features in units of their scales, shapes (n, j), (k, j) to (n, k)."""
    apart = ((first[:, None] - second) ** 2).mean(axis=-1)
    return np.asarray(np.exp(-0.5 * apart / bandwidth**2))


def features_of(states: Array, covariances: Array, radii: Array) -> Array:
    """What starts look like, shape (n, 10), in metres and seconds.

    Position, velocity, spin as the speed at the equator in axes along the horizontal velocity, and
    the logarithm of how well that is known, which tells short windows from long ones, and those
    with a bounce.
    """
    turns = headings(states[:, 3:6])
    spins = np.einsum('nba,nb->na', turns, states[:, 6:]) * radii[:, None]
    square = np.trace(covariances[:, 6:, 6:], axis1=1, axis2=2) * radii**2
    known = 0.5 * np.log(square + _LEAST**2)
    return np.concatenate([states[:, :6], spins, known[:, None]], axis=1)


def roots_of(states: Array, covariances: Array, radii: Array, floor: float) -> Array:
    """Change of (v, w) [m/s, rad/s] in world axes by one unit of each part, shape (n, 6, 6)."""
    turns = headings(states[:, 3:6])
    own = np.zeros((len(states), 6, 6))  # from the axes of the correction to those of the world
    own[:, :3, :3] = turns
    own[:, 3:, 3:] = turns / radii[:, None, None]
    back = np.zeros_like(own)
    back[:, :3, :3] = turns.transpose(0, 2, 1)
    back[:, 3:, 3:] = turns.transpose(0, 2, 1) * radii[:, None, None]
    inner = back @ covariances[:, 3:, 3:] @ back.transpose(0, 2, 1)
    values, axes = np.linalg.eigh(inner)
    sizes = np.sqrt(np.maximum(values, 0.0) + floor**2)
    return np.asarray(own @ (axes * sizes[:, None, :]) @ axes.transpose(0, 2, 1))


def headings(velocities: Array) -> Array:
    """Columns along the horizontal velocity, across it, up; as `spin_windows.heading`."""
    along, across = velocities[:, 0], velocities[:, 1]
    size = np.hypot(along, across)
    still = size == 0.0
    c = np.where(still, 1.0, along / np.where(still, 1.0, size))
    s = np.where(still, 0.0, across / np.where(still, 1.0, size))
    turns = np.zeros((len(velocities), 3, 3))
    turns[:, 0, 0] = turns[:, 1, 1] = c
    turns[:, 1, 0], turns[:, 0, 1] = s, -s
    turns[:, 2, 2] = 1.0
    return turns
