# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters that are allowed, but not together worth much: said at the start."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def odd_parameters(parameters: Mapping[str, Any]) -> list[str]:
    """Sentences on parameters that have no effect, or not the one that is meant."""
    found = []
    if parameters['crossing_planes'] and not parameters['horizon']:
        found.append(
            'crossing_planes are given, but horizon is 0: no crossing is forecast; set horizon'
        )
    if parameters['moving_surfaces'] and parameters['start'] == 'first':
        found.append(
            'moving_surfaces are given, but start is first: predictions keep their motion at the '
            'first frames; set start:=every'
        )
    return found
