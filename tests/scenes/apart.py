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
