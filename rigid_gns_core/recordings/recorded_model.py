# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Models and tracking windows outside a node, as the simulator makes them. No ROS needed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..files.checkpoint import CheckpointError
from ..forecasts.forecaster import Forecaster
from ..forecasts.parameters import SIMULATOR
from ..forecasts.window_setup import window_of
from ..prediction.load import load_simulator
from ..tracking.window import TrackingWindow


def tracking_window(model: Forecaster, parameters: Mapping[str, Any]) -> TrackingWindow:
    """Return the window of a simulator with these parameters, others at their defaults."""
    defaults = {spec.name: spec.default for spec in SIMULATOR}
    return window_of(
        model, {**defaults, **parameters}, check=lambda _: None, on_gap=lambda _: None
    )


def find_recorded_model(recorded: dict[str, Any], given: str | None, where: str) -> str:
    """Name or path of the model that a bag was recorded with, told by its card.

    Args:
        recorded: What the simulator said on ~/scene.
        given: Name or path instead of the recorded one.
        where: For messages.

    Raises:
        CheckpointError: It is not here, or is another one of the same name.
    """
    parameters = recorded.get('parameters', {})
    names = [given] if given is not None else [parameters.get('model', ''), recorded.get('model')]
    expected = _mark(recorded.get('model_card', {}))
    seen = []
    for name in [str(name) for name in names if name is not None]:
        try:
            simulator = load_simulator(name)
        except CheckpointError:
            continue
        found = _mark(simulator.card)
        if expected in ('', found):
            return name
        seen.append(f'{simulator.name} with {found}')
    wanted = expected or 'an empty card'
    raise CheckpointError(
        f'{where}: was recorded with model {recorded.get("model", "unknown")}, {wanted}; '
        f'here: {", ".join(seen) or "no such model"}; name its file with --model'
    )


def _mark(card: Mapping[str, Any]) -> str:
    """Return what tells a model from others: weights, or options of the laws; '' if unknown."""
    if 'weights_sha256' in card:
        return f'weights {card["weights_sha256"][:12]}...'
    if 'options' in card:
        return 'options ' + ', '.join(
            f'{name} {card["options"][name]}' for name in sorted(card['options'])
        )
    return ''
