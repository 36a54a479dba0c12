# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The floor of chaos: the worst of two errors, the least floor, and moved starts."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from rigid_gns_core.scenes.state import State
from rigid_gns_core.studies.chaos_floor import half_and_twice, least_floor, over_floor, worst
from rigid_gns_core.teacher.settings import TeacherSettings


@pytest.fixture(scope='module')
def chaos_draws() -> ModuleType:
    path = Path(__file__).parents[2] / 'benchmarks' / 'chaos_draws.py'
    spec = importlib.util.spec_from_file_location('chaos_draws', path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_worse_of_both_is_the_floor() -> None:
    half = {'mse': 2.0, 'predictability_time': 3.0, 'spin_error': None, 'resting_drift': None}
    twice = {'mse': 1.0, 'predictability_time': 4.0, 'spin_error': 0.5, 'resting_drift': None}
    assert worst([half, twice]) == {
        'mse': 2.0,
        'predictability_time': 3.0,
        'spin_error': 0.5,
        'resting_drift': None,
    }


def test_the_least_floor_is_half_a_radius() -> None:
    radii = np.array([1.0, 3.0])
    assert least_floor('mse_30', radii) == least_floor('chamfer', radii) == 0.25 * 5.0
    assert least_floor('position_error', radii) == 0.5 * 2.0
    assert least_floor('spin_error', radii) is None
    assert over_floor(3.0, 2.0, 0.5) == 1.5
    assert over_floor(3.0, 0.1, 0.5) == 6.0
    assert over_floor(3.0, None, 0.5) is over_floor(3.0, 2.0, None) is None
    assert over_floor(float('inf'), 2.0, 0.5) == float('inf')


def test_draws_are_a_millimetre_off_and_never_lower(chaos_draws: ModuleType) -> None:
    start = State(positions=np.arange(30.0).reshape(10, 3))
    moved = chaos_draws.moved
    one, other = moved(start, 0), moved(start, 1)
    for draw in (one, other):
        way = draw.positions - start.positions
        assert np.linalg.norm(way, axis=1) == pytest.approx(chaos_draws.MOVED)
        assert (way[:, 2] >= 0).all()
    assert not np.allclose(one.positions, other.positions, atol=1e-6)
    assert np.array_equal(one.positions, moved(start, 0).positions)


def test_only_the_substeps_differ() -> None:
    half, twice = half_and_twice(TeacherSettings(substeps=25, solver_iterations=7))
    assert (half.substeps, twice.substeps) == (12, 50)
    assert half.solver_iterations == twice.solver_iterations == 7
    assert half_and_twice(TeacherSettings(substeps=1))[0].substeps == 1
