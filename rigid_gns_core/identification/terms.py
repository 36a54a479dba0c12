# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The terms that a fit tries, in the order in which they build on each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .ladder import Rung, Setup
from .parameters import Laws
from .stretches import Stretch
from ..tracking.ball_contact import FREE
from ..tracking.ball_estimate import estimate_ball, forecast_ball, MOST_CONTACTS
from ..tracking.ball_path import path

# a law is fitted that so many stretches meet
_FEWEST = 3
# bandwidths of the prior that are tried [deviations of the features]
_BANDWIDTHS = (0.4, 0.2, 0.1)
_LIFT = 'air.lift_coefficient'


@dataclass(frozen=True)
class Met:
    """What balls meet in some stretches.

    Args:
        flights: Number of stretches in the air.
        impacts: Number of stretches with impacts, by group of surfaces.
        stays: Number of stretches on a surface, by group.
        surfaces: Surfaces with impacts.
    """

    flights: int
    impacts: tuple[int, ...]
    stays: tuple[int, ...]
    surfaces: tuple[int, ...]


def met_by(laws: Laws, found: Sequence[Stretch], noise: float) -> Met:
    """What balls meet, by paths as the scene has them, from the first frames of each stretch."""
    impacts, stays = [0] * len(laws.groups), [0] * len(laws.groups)
    group_of = {k: g for g, group in enumerate(laws.groups) for k in group}
    surfaces: dict[int, int] = {}
    flights = 0
    drift = np.array([noise, 1e-2, 0.02])
    for one in found:
        model = laws.models[min(one.sphere, len(laws.models) - 1)]
        flights += one.on == FREE
        if one.on != FREE:
            stays[group_of[one.on]] += 1
        lowest = [
            ((one.positions - plane[:3]) @ plane[9:12] - model.radius).min()
            for plane in model.planes
        ]
        for k, height in enumerate(lowest):
            step = np.linalg.norm(np.diff(one.positions, axis=0), axis=1).max()
            if k != one.on and height < 5 * noise + 0.5 * step:
                surfaces[k] = surfaces.get(k, 0) + 1
                impacts[group_of[k]] += 1
    touched = tuple(k for k, count in sorted(surfaces.items()) if count >= _FEWEST)
    return Met(flights, tuple(impacts), tuple(stays), touched)
