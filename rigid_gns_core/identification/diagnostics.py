# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a fit leaves, over what it depends on, for a look at the laws' forms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .first_look import shown_bounces
from .joint_fit import Fitted
from .parameters import Laws
from .stretches import Stretch
from ..scenes.state import Array
from ..tracking.ball_path import path
from ..tracking.ball_window import MOST_CONTACTS


@dataclass(frozen=True)
class Diagnostics:
    """Residuals and bounces of a fit.

    Args:
        times: Time of each frame since its stretch began [s], shape (frames,).
        residuals: Its distance from the path that fits best [m], shape (frames,).
        ratios: Spin ratio S in each of the frames, shape (frames,).
        bounces: Approach speed [m/s] and restitution of bounces, by parabolas on both sides, for
            each group of surfaces, shape (bounces, 2).
    """

    times: Array
    residuals: Array
    ratios: Array
    bounces: tuple[Array, ...]


def diagnostics_of(laws: Laws, fitted: Fitted, found: Sequence[Stretch]) -> Diagnostics:
    """Residuals of a fit to stretches, and their bounces."""
    models = laws.models_at(fitted.values)
    times, residuals, ratios = [], [], []
    for start, one in zip(fitted.starts, found, strict=True):
        model = models[min(one.sphere, len(models) - 1)]
        states = np.zeros((len(one.times), 9))
        path(
            start,
            one.times[0],
            one.times,
            model.ball,
            model.planes,
            model.laws,
            one.on,
            states,
            np.zeros((MOST_CONTACTS, 3)),
        )
        times.append(one.times - one.times[0])
        residuals.append(np.linalg.norm(states[:, :3] - one.positions, axis=1))
        u = states[:, 3:6] - model.ball[0, 3:6]
        turning = np.linalg.norm(np.cross(states[:, 6:], u), axis=1)
        ratios.append(model.radius * turning / np.maximum((u**2).sum(axis=1), 1e-12))
    bounces = tuple(shown_bounces(laws, found, group) for group in range(len(laws.groups)))
    return Diagnostics(
        times=np.concatenate(times),
        residuals=np.concatenate(residuals),
        ratios=np.concatenate(ratios),
        bounces=bounces,
    )
