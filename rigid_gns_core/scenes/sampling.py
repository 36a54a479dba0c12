# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start states from a recipe and its seed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .placement import place_spheres
from .scene import Scene
from .start import StartRecipe
from .state import Array, State


def sample_start(
    scene: Scene, recipe: StartRecipe, rng: np.random.Generator | None = None
) -> State:
    """Place spheres, and set them in motion where the recipe says so.

    Random places are found by dart throwing: one too near to anything is thrown again.

    Args:
        scene: Surfaces to keep clear of, and radii.
        recipe: How many spheres, where, and how fast.
        rng: Source of all draws; None: a generator with the recipe's seed.

    Raises:
        SamplingError: There is no room, the region has no bound, or a given place is occupied;
            the message says which, and what to change.
    """
    rng = np.random.default_rng(recipe.seed) if rng is None else rng
    radii = scene.per_sphere('radius', recipe.spheres)
    positions = place_spheres(scene, recipe, radii, rng)
    if recipe.speed == recipe.spin == (0.0, 0.0):
        still = (0.0, 0.0, 0.0)
        velocities, spins = (
            _given(values, recipe.spheres, still)
            for values in (recipe.velocities, recipe.angular_velocities)
        )
    else:
        moves = rng.random((recipe.spheres, 1)) < recipe.moving
        velocities, spins = (
            moves * _vectors(size, recipe.spheres, rng, level)
            for size, level in ((recipe.speed, recipe.layout != 'scattered'), (recipe.spin, False))
        )
    return State(
        positions=positions,
        quaternions=_given(recipe.quaternions, recipe.spheres, (0.0, 0.0, 0.0, 1.0)),
        velocities=velocities,
        angular_velocities=spins,
    )


def _given(values: Sequence[tuple[float, ...]], count: int, default: tuple[float, ...]) -> Array:
    """Given values, or the default for each of `count` spheres, shape (count, k)."""
    return np.array(values or [default] * count, dtype=np.float64)


def _vectors(
    size: tuple[float, float], count: int, rng: np.random.Generator, level: bool
) -> Array:
    """Vectors of random size and direction, horizontal ones where `level`; shape (count, 3)."""
    sizes = rng.uniform(*size, (count, 1))
    directions = rng.normal(size=(count, 3))
    if level:
        directions[:, 2] = 0.0
    norms: Array = np.linalg.norm(directions, axis=1, keepdims=True)
    return sizes * directions / norms
