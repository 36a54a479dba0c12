# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Baseline of tracking_filter.py: a fit of one motion through the whole window."""

from __future__ import annotations

import numpy as np
from rigid_gns_core.scenes.state import Array, rotation_between


def plain_fit(
    times: Array, positions: Array, quaternions: Array, gravity: Array
) -> tuple[Array, Array]:
    """Velocities [m/s] and spins [rad/s] of flight, or of uniform motion where it fits better."""
    stamps = times - times[-1]
    fall = 0.5 * stamps[:, None, None] ** 2 * gravity
    velocities, misfit = _slope(stamps, positions - fall)
    if len(stamps) > 2:
        uniform, uniform_misfit = _slope(stamps, positions)
        velocities = np.where((uniform_misfit < misfit)[:, None], uniform, velocities)
    else:
        velocities = velocities.copy()
    turned = np.zeros_like(positions)
    turned[1:] = np.cumsum(rotation_between(quaternions[:-1], quaternions[1:]), axis=0)
    return velocities, _slope(stamps, turned)[0]


def _slope(times: Array, values: Array) -> tuple[Array, Array]:
    centred = (times - times.mean())[:, None, None]
    offsets = values - values.mean(axis=0)
    slope = (centred * offsets).sum(axis=0) / (centred**2).sum()
    return slope, ((offsets - centred * slope) ** 2).sum(axis=(0, 2))
