# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""How far spheres of a drawn start are apart, for tests of recipes and start states."""

from __future__ import annotations

import numpy as np
from rigid_gns_core.scenes.plane import closest_points
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.scenes.state import State


def gaps(scene: Scene, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Gaps [m] between spheres, inf on the diagonal, and those to the surfaces; (n, n), (n, s)."""
    radii = scene.per_sphere('radius', len(state))
    between = np.linalg.norm(state.positions[:, None] - state.positions, axis=2)
    between -= radii[:, None] + radii
    np.fill_diagonal(between, np.inf)
    points, _ = closest_points(scene.surfaces, state.positions)
    return between, np.linalg.norm(state.positions[:, None] - points, axis=2) - radii[:, None]


def assert_apart(scene: Scene, state: State, gap: float) -> None:
    """All surfaces are `gap` [m] apart, up to rounding."""
    between, to_surface = gaps(scene, state)
    assert between.min() >= gap - 1e-9
    assert to_surface.min() >= gap - 1e-9
    _, heights = closest_points(scene.surfaces, state.positions)
    # behind a bounded plane is a place as good as another, beyond the box is not
    assert heights[:, :5].min() > 0
