# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stretches, laws, noise and priors of a joint fit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from typing import Self

import numpy as np
from numpy.typing import NDArray

from .parameters import Laws
from .stretches import Stretch
from ..scenes.state import Array
from ..tracking.ball_estimate import first_guess, prior_of_start
from ..tracking.ball_model import BallModel
from ..tracking.start_guess import ALL, WITHOUT_SPIN

SpinPrior = Callable[[Stretch, Array], tuple[Array, Array]]


class Problem:
    """What is fitted.

    Args:
        laws: Laws as functions of parameters.
        found: Stretches.
        noise: s, q, kappa of `model_error`.
        prior: Mean and covariance of the spin of a stretch's start, of the stretch and its first
            guess; None: balls do not spin in the air, and roll on a surface.
    """

    def __init__(
        self, laws: Laws, found: Sequence[Stretch], noise: Array, prior: SpinPrior | None
    ) -> None:
        self.laws, self.found, self.noise = laws, found, noise
        self.varied = WITHOUT_SPIN if prior is None else ALL
        self.guesses, self.means, self.precisions = [], [], []
        for one in found:
            model = self.model_of(one, laws.models)
            guess = first_guess(model, one.times, one.positions, one.on)
            spin = None if prior is None else prior(one, guess)
            mean, precision = prior_of_start(model, guess, one.on, spin)
            self.guesses.append(np.concatenate([guess, mean[6:]]))
            self.means.append(mean)
            self.precisions.append(precision)
        self.weights = [np.ones(len(one.times)) for one in found]

    @staticmethod
    def model_of(one: Stretch, models: Sequence[BallModel]) -> BallModel:
        """Laws of the ball of a stretch."""
        return models[min(one.sphere, len(models) - 1)]

    def part(self, chosen: NDArray[np.int64]) -> Self:
        """The same with some of the stretches, by their numbers."""
        own = copy(self)
        for name in ('found', 'guesses', 'means', 'precisions', 'weights'):
            setattr(own, name, [getattr(self, name)[k] for k in chosen])
        return own
