# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Obstacles are drawn where they are, closed and facing outwards."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from free_fall import falling
import numpy as np
import pytest
from rigid_gns_core import Obstacle, Plane, Scene
from rigid_gns_core.show.obstacles import quads_of
from rigid_gns_core.show.surfaces import visible_quads

PLACED: dict[str, Any] = {'point': (0.3, -0.2, 0.5), 'axis': (0.4, -0.3, 1.0)}
SOLIDS = (
    (Obstacle('sphere', radius=0.8, **PLACED), 4.0 / 3.0 * np.pi * 0.8**3),
    (Obstacle('cylinder', radius=0.7, length=1.4, **PLACED), np.pi * 0.7**2 * 1.4),
    (Obstacle('ring', radius=1.2, thickness=0.3, **PLACED), 2.0 * np.pi**2 * 1.2 * 0.15**2),
    (
        Obstacle('tube', radius=1.2, length=1.4, thickness=0.2, **PLACED),
        2.0 * np.pi * 1.2 * (1.4 * 0.2 + np.pi * 0.1**2),
    ),
)


@pytest.mark.parametrize(('obstacle', 'volume'), SOLIDS, ids=lambda of: getattr(of, 'shape', ''))
def test_quadrangles_enclose_the_solid(obstacle: Obstacle, volume: float) -> None:
    quads = quads_of(obstacle)
    distance, _ = obstacle.closest(quads.reshape(-1, 3))
    np.testing.assert_allclose(distance, 0.0, atol=1e-12)
    # by Gauss: positive where they face outwards; 16 sides of a circle have 97 % of its area
    a, b, c, d = quads.transpose(1, 0, 2)
    inside = sum(np.sum(x * np.cross(y, z)) for x, y, z in ((a, b, c), (a, c, d))) / 6.0
    assert 0.87 * volume < inside < volume


def test_boxes_are_plates_and_all_are_in_view(tmp_path: Path) -> None:
    box = Obstacle('box', size=(1.0, 2.0, 0.6), **PLACED)
    scene = Scene(surfaces=Plane(), obstacles=(box, SOLIDS[0][0]), radius=0.1)
    quads = visible_quads(scene, np.full(3, -1.0), np.full(3, 1.0))
    assert len(quads) == 1 + 6 + len(quads_of(SOLIDS[0][0]))
    corners = np.array([quad.corners for quad in quads[1:7]])
    np.testing.assert_allclose(box.closest(corners.reshape(-1, 3))[0], 0.0, atol=1e-12)
    pytest.importorskip('matplotlib', reason='the figure needs matplotlib')
    from rigid_gns_core.show.figure import write_figure

    path = tmp_path / 'figure.png'
    bare = write_figure(path, falling(), falling(), Scene(surfaces=Plane())).read_bytes()
    drawn = write_figure(path, falling(), falling(), Scene(surfaces=Plane(), obstacles=(box,)))
    assert drawn.read_bytes() != bare
