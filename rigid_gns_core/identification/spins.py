# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Spins that a joint fit found, as a prior for other windows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .joint_fit import Fitted
from .parameters import Laws
from .problem import SpinPrior
from .stretches import Stretch
from ..tracking.ball_contact import FREE
from ..tracking.ball_path import path
from ..tracking.ball_window import MOST_CONTACTS
from ..tracking.spin_windows import heading
from ..tracking.start_prior import StartPrior

# a window begins every so often, and has so much of its stretch before it [s]
_EVERY, _LEFT = 0.1, 0.1
# least standard deviation of a learned spin, as a speed at the equator [m/s]
_FLOOR = 0.12


def broad_prior(radius: float) -> SpinPrior:
    """Prior of a spin of which nothing is known."""
    prior = StartPrior.of_any_spin(radius)
    return lambda _, guess: prior.at(guess[:3], guess[3:])


def learned_prior(
    laws: Laws, fitted: Fitted, found: Sequence[Stretch], bandwidth: float
) -> tuple[StartPrior, NDArray[np.int64]]:
    """Prior from the spins of all stretches, and the track of each of its windows."""
    features, spins, covariances, tracks = [], [], [], []
    models = laws.models_at(fitted.values)
    for k, one in enumerate(found):
        model = models[min(one.sphere, len(models) - 1)]
        stamps = np.arange(one.times[0], max(one.times[-1] - _LEFT, one.times[0] + 1e-9), _EVERY)
        states, contacts = np.zeros((len(stamps), 9)), np.zeros((MOST_CONTACTS, 3))
        path(
            fitted.starts[k],
            one.times[0],
            stamps,
            model.ball,
            model.planes,
            model.laws,
            one.on,
            states,
            contacts,
        )
        for state in states:
            spin = state[6:].copy()
            if one.on != FREE:
                spin -= np.cross(model.planes[one.on, 9:12], state[3:6]) / model.radius
            turn = heading(state[3], state[4])
            features.append(state[:6])
            spins.append(turn.T @ spin)
            covariances.append(turn.T @ fitted.spin_covariances[k] @ turn)
            tracks.append(one.track)
    prior = StartPrior(
        np.array(features),
        np.array(spins),
        np.array(covariances),
        bandwidth,
        floor=_FLOOR / laws.models[0].radius,
    )
    return prior, np.array(tracks)
