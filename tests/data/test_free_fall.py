# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Speeds that tell units, where stamps jitter."""

from __future__ import annotations

import numpy as np
import pytest
from rigid_gns_core import Scene
from rigid_gns_core.data.free_fall import misfit_of_speed, step_speeds

SCENE = Scene(radius=0.02, mass=0.0027)


@pytest.mark.parametrize(('scale', 'fits'), [(1.0, True), (1000.0, False)])
def test_two_near_stamps_are_no_other_unit(scale: float, fits: bool) -> None:
    """3 m/s at 240 Hz with 3 ms of jitter: steps of 12 mm, some of them in 0.1 ms."""
    rng = np.random.default_rng(0)
    stamps = np.arange(2000) / 240 + rng.normal(0.0, 3e-3, 2000)
    places = np.zeros((2000, 3))
    places[:, 0] = scale * 3.0 * np.arange(2000) / 240
    order = np.argsort(stamps)
    misfit = misfit_of_speed(step_speeds(stamps[order], places[order]), SCENE)
    assert (misfit is None) == fits
    if misfit is not None:
        assert misfit.option == '--scale 0.001'
