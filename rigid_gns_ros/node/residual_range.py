# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Status of a residual network: whether it predicts what is like the tracks it learned from."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rigid_gns_core.messages.diagnostics import OK, Status, WARN
from rigid_gns_core.prediction.residual import range_counts, ResidualSimulator

from .recent import Recent, SPAN

if TYPE_CHECKING:
    from rigid_gns_core.forecasts.forecaster import Forecaster
    from rigid_gns_core.forecasts.predictor import Predictor
    from rigid_gns_core.rollout.rollout import Rollout

# share of the contacts left to the laws that is a warning
_UNLIKE = 0.1


class ResidualRange:
    """Counts contacts of predictions that are unlike those of the network's training.

    Args:
        model: Makes the forecasts; of others than a residual network nothing is said.
        predictor: Gives the forecast.
    """

    def __init__(self, model: Forecaster, predictor: Predictor) -> None:
        self._model, self._predictor = model, predictor
        self._contacts, self._faded, self._farthest = Recent(), Recent(), Recent()
        self._rollout: Rollout | None = None  # the one that was last counted
        self._counted = (0.0, 0.0)

    def note(self) -> None:
        """Count the contacts of the newest steps of the forecast."""
        forecast = self._predictor.forecast
        if forecast is None or (counts := range_counts(forecast.rollout)) is None:
            return
        if forecast.rollout is not self._rollout:
            self._rollout, self._counted = forecast.rollout, (0.0, 0.0)
        before, faded = self._counted
        self._contacts.add(counts.contacts - before)
        self._faded.add(counts.faded - faded)
        self._farthest.add(counts.farthest)
        self._counted = counts.contacts, counts.faded

    def status(self) -> list[Status]:
        """The status; none for other models."""
        simulator = self._model.simulator
        if not isinstance(simulator, ResidualSimulator):
            return []
        contacts, faded = self._contacts.sum, self._faded.sum
        level, message = OK, 'contacts are like those that the network was trained on'
        if not simulator.strength:
            left = 'laws with springs' if simulator.has_springs else 'laws alone'
            message = f'the network is switched off, as held-out tracks have chosen: {left}'
        elif faded > _UNLIKE * contacts:
            level = WARN
            message = (
                f'{100 * faded / contacts:.0f} % of the contacts of the last {SPAN:g} s are '
                'unlike those that the network was trained on, and left to the laws; train it on '
                'such tracks, too'
            )
        values = {
            'strength': f'{simulator.strength:g}',
            'contacts': f'{contacts:g}',
            'left to the laws': f'{faded:.4g}',
            'farthest from training [deviations]': f'{self._farthest.quantiles(1.0)[0]:.3g}'
            if len(self._farthest)
            else '',
        }
        return [Status(level, 'residual', message, values)]
