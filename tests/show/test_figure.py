# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The picture of `rigid-gns evaluate`: any scene, and what a divergence leaves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from free_fall import falling
import numpy as np
import pytest
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.show.figure import write_figure

pytest.importorskip('matplotlib', reason='the figure needs matplotlib')

SCENE = Scene(surfaces=Plane.box(20.0, 20.0))


@pytest.mark.parametrize('gravity', [(0.0, 0.0, -9.81), (0.0, -5.0, -5.0)])
def test_figure_is_drawn_for_any_scene(tmp_path: Path, gravity: tuple[float, float, float]):
    ramp = Plane((0, 0, 5), (1, 0, 2), None, 8.0, 4.0)
    scene = Scene(surfaces=(Plane(), ramp), gravity=gravity)
    path = write_figure(tmp_path / 'new' / 'figure.png', falling(offset=0.2), falling(), scene)
    # width and height [pixels] in the header: a picture, not an empty canvas of one size
    width, height = (int.from_bytes(path.read_bytes()[i : i + 4]) for i in (16, 20))
    assert width == 1430 and height > 800


def test_figure_stops_where_the_prediction_diverges(tmp_path: Path):
    positions = falling().positions.copy()
    positions[5:] = np.nan
    diverged = replace(falling(), positions=positions)
    assert write_figure(tmp_path / 'a.png', diverged, falling(), SCENE).stat().st_size > 10_000
    positions[:] = np.nan
    with pytest.raises(ValueError, match='diverges at its start'):
        write_figure(tmp_path / 'b.png', replace(falling(), positions=positions), falling(), SCENE)
