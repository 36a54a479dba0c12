# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Windows of the node's tracking, as the tests of tracking make them."""

from __future__ import annotations

from typing import Any

from rigid_gns_core.tracking.window import TrackingWindow


def tracking_window(**values: Any) -> TrackingWindow:
    """Window of six frames of balls of 20 mm, where `values` say nothing else; see there."""
    given: dict[str, Any] = {
        'frame_id': 'world',
        'length': 6,
        'max_spheres': 10,
        'gravity': (0.0, 0.0, -9.81),
        'max_gap': 1.25,
        'radius': 0.02,
        'check': lambda _: None,
        'on_gap': lambda _: None,
    }
    return TrackingWindow(**(given | values))
