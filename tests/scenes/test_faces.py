# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Half-spaces have one face; strips and plates have two, and do nothing beyond their ends."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose
import pytest
from rigid_gns_core import Plane, Scene
from rigid_gns_core.scenes.plane import distances
from rigid_gns_core.scenes.sampling import sample_start
from rigid_gns_core.scenes.start import StartRecipe

INF = np.inf
SHELF = Plane((0.0, 0.0, 5.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), 4.0)  # a strip along y


@pytest.mark.parametrize(
    ('lengths', 'half_space'),
    [((INF, INF), True), ((2.0, INF), False), ((INF, 2.0), False), ((2.0, 2.0), False)],
)
def test_a_plane_without_an_end_is_a_half_space(lengths, half_space) -> None:
    plane = Plane((0.0, 0.0, 5.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), *lengths)
    assert plane.is_half_space == half_space
    assert plane.half_lengths.tolist() == [0.5 * length for length in lengths]
    behind = -3.0 if half_space else 3.0
    assert_allclose(distances((plane,), [(0.5, 0.5, 8.0), (0.5, 0.5, 2.0)]), [[3.0], [behind]])


def test_distance_to_a_strip_is_that_to_its_nearest_point() -> None:
    places = [(1.0, 900.0, 5.5), (-1.0, -900.0, 4.0), (5.0, 0.0, 9.0), (5.0, 7.0, 1.0)]
    assert_allclose(distances((SHELF,), places)[:, 0], [0.5, 1.0, 5.0, 5.0])
    turned = Plane(SHELF.point, (0.0, 0.0, -1.0), SHELF.direction, SHELF.length_x)
    assert_allclose(distances((turned,), places), distances((SHELF,), places))


def test_no_surfaces_or_no_places() -> None:
    assert distances((), np.zeros((3, 3))).shape == (3, 0)
    assert distances((SHELF,), np.zeros((0, 3))).shape == (0, 1)


@pytest.mark.parametrize('normal', [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])
def test_spheres_start_on_both_sides_of_a_strip(normal) -> None:
    shelf = Plane((0.0, 0.0, 3.0), normal, (1.0, 0.0, 0.0), 20.0)
    given = StartRecipe(at=((0.0, 0.0, 1.0), (0.0, 0.0, 4.0), (10.8, 0.0, 3.7)))
    assert len(sample_start(Scene(surfaces=(Plane(), shelf)), given)) == 3
    with pytest.raises(ValueError, match='sphere 0 .* in surface 1'):
        sample_start(Scene(surfaces=(Plane(), shelf)), StartRecipe(at=((0.0, 0.0, 2.1),)))
    fence = Plane((0.0, 0.0, 0.0), (np.sin(0.3), 0.0, np.cos(0.3)), length_y=8.0)
    thrown = StartRecipe(spheres=40, length_x=30.0, length_y=30.0, height=(-15.0, 15.0))
    places = sample_start(Scene(surfaces=(fence,)), thrown).positions
    heights = (places - fence.point) @ np.asarray(fence.normal)
    assert heights.min() < -1.0 and heights.max() > 1.0
    assert distances((fence,), places).min() >= 1.1  # radius and gap
