# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The tracking window by the node's parameters, for the node and for replayed recordings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from .forecaster import Forecaster
from .node_parameters import with_defaults
from ..tracking.usable_frames import WINDOW_GAP
from ..tracking.window import TrackingWindow

# frames further apart than this many model steps, and than WINDOW_GAP, are not fitted together
WINDOW_GAP_STEPS = 10


def longest_gap(model: Forecaster) -> float:
    """Longest time between two frames that are fitted together [s]."""
    return max(WINDOW_GAP_STEPS * model.native_dt, WINDOW_GAP)


def window_of(
    model: Forecaster,
    parameters: Mapping[str, Any],
    *,
    check: Callable[[int], None] = lambda _: None,
    on_gap: Callable[[float], None] = lambda _: None,
) -> TrackingWindow:
    """Tracking window by the parameters of the simulator, declared or recorded on ~/scene.

    Args:
        model: Gives scene and time step.
        parameters: Parameters by name; missing ones have their defaults.
        check: See `TrackingWindow`.
        on_gap: See `TrackingWindow`.

    Raises:
        UserError: A parameter is of another type, or out of range.
    """
    parameters = with_defaults(parameters)

    def given(name: str) -> float | None:
        return float(parameters[name]) or None  # 0: the default

    return TrackingWindow(
        frame_id=str(parameters['frame_id']),
        length=int(parameters['velocity_window']),
        max_spheres=int(parameters['max_spheres']),
        gravity=model.scene.gravity,
        max_gap=longest_gap(model),
        radius=model.radius,
        check=check,
        on_gap=on_gap,
        scene=model.scene,
        matched=bool(parameters['match_spheres']),
        noise=given('tracking_noise'),
        coast_time=given('coast_time'),
        max_speed=given('max_speed'),
    )
