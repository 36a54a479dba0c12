# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Hard cases of light spheres that carry heavy ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .case import Case, usual_scene
from ...closed_form.enclosed import triangle_of_spheres
from ...scenes.plane import Plane
from ...scenes.state import State

LOADED_DEPTH = 5e-3
"""Deepest penetration allowed under a load [diameters], 1e-2 radii."""


def _column(_: int) -> Case:
    mass = (1.0, 10.0, 1e2, 1e3, 1e4, 1e5)
    places = np.array([(0.01 * (-1.0) ** k, 0.0, 1.0 + 2.0 * k) for k in range(len(mass))])
    return Case(
        'heavy_column',
        '6 spheres in a shaft of 2.02 r, each 10 times as heavy as the one below',
        usual_scene(Plane.box(2.02, 2.02), mass=mass),
        State(positions=places),
        100,
        rests=True,
        closed=True,
        deepest=LOADED_DEPTH,
    )


def _on_three(_: int) -> Case:
    walls, three = triangle_of_spheres()
    top = np.array([[0.0, 0.0, 1.0 + np.sqrt(4.0 - 4.0 / 3.0) + 0.5]])
    return Case(
        'heavy_on_three',
        '1e6 kg fall by 0.5 r on 3 spheres of 1 kg that touch on the floor, between walls',
        usual_scene((Plane(), *walls), mass=(1.0, 1.0, 1.0, 1e6)),
        State(positions=np.r_[three, top]),
        100,
        rests=True,
        deepest=LOADED_DEPTH,
    )


LOAD_CASES: tuple[Callable[[int], Case], ...] = (_column, _on_three)
"""Makers of the cases, from a seed, in the order of the table."""
