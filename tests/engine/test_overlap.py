# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""Overlaps are undone by position alone, and the centre of mass stays."""

import numpy as np
import pytest
from rigid_gns_core import load_simulator, Plane, Scene, State
from rigid_gns_core.engine.world import world_of

from . import calls

FREE = Scene(surfaces=(), gravity=(0.0, 0.0, 0.0))


def pushed(scene, positions):
    still = np.zeros_like(positions)
    return calls.pushed_out(world_of(scene, len(positions)), positions, still, 0.1)


def depths(positions, radius):
    """Overlaps of pairs, shape (n, n)."""
    apart = np.linalg.norm(positions[:, None] - positions, axis=-1)
    np.fill_diagonal(apart, np.inf)
    return np.maximum(np.add.outer(radius, radius) - apart, 0.0)


@pytest.mark.parametrize('seed', range(4))
def test_a_pair_parts_along_its_normal_by_inverse_masses(seed):
    rng = np.random.default_rng(seed)
    mass, radius = rng.uniform(0.2, 5.0, 2), rng.uniform(0.3, 1.0, 2)
    scene = Scene(surfaces=(), gravity=(0.0, 0.0, 0.0), mass=tuple(mass), radius=tuple(radius))
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    depth = 0.3 * radius.min()
    positions = np.array([[0.0, 0, 0], way * (radius.sum() - depth)])
    moved = pushed(scene, positions) - positions
    share = (1.0 / mass) / (1.0 / mass).sum()
    np.testing.assert_allclose(moved, np.outer(depth * share * [-1, 1], way), atol=1e-12)


@pytest.mark.parametrize('seed', range(4))
def test_a_crowd_comes_apart_and_its_centre_of_mass_stays(seed):
    rng = np.random.default_rng(seed)
    grid = 1.9 * np.stack(np.meshgrid(*[np.arange(3)] * 3), -1).reshape(-1, 3)
    positions = grid + rng.uniform(-0.05, 0.05, grid.shape)
    mass, radius = rng.uniform(0.5, 2.0, 27), np.ones(27)
    scene = Scene(surfaces=(), gravity=(0.0, 0.0, 0.0), mass=tuple(mass))
    last, moved = depths(positions, radius).max(), positions
    for _ in range(200):
        moved = pushed(scene, moved)
    assert depths(moved, radius).max() < 1e-3 * last
    np.testing.assert_allclose(mass @ moved, mass @ positions, rtol=0, atol=1e-11)


def test_what_does_not_overlap_is_left_alone():
    positions = np.array([[0.0, 0, 1.0], [2.0, 0, 1.0], [0.0, 2.5, 1.2]])
    np.testing.assert_array_equal(pushed(Scene(), positions), positions)


def test_rounding_does_not_change_how_overlaps_are_undone():
    ends = [
        pushed(Scene(), np.array([[0.0, 0, height], [0.0, 0, 2.999]]))
        for height in (1.0, np.nextafter(1.0, 0.0))
    ]
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)


def rolled(scene, positions, steps):
    stepper = load_simulator().stepper(scene, State(positions=positions))
    return [stepper.step() for _ in range(steps)]


@pytest.mark.parametrize(
    ('positions', 'scene'),
    [
        ([[0.0, 0, 5], [1.0, 0.3, 5]], FREE),
        ([[0.0, 0, 5], [0.0, 0, 5]], FREE),
        ([[0.0, 0, 5]] * 5, FREE),
        ([[0.0, 0, 0.0]], Scene()),
        ([[0.0, 0, -3.0]], Scene()),
        ([[0.0, 0, 1], [0.0, 0, 1]], Scene()),
    ],
    ids=['overlap', 'same point', 'five in one', 'half below', 'below', 'same on the floor'],
)
def test_overlapping_starts_are_pushed_apart_at_rest(positions, scene):
    for state in rolled(scene, positions, 3):
        assert depths(state.positions, np.ones(len(state))).max() < 1e-5
        if scene.surfaces:
            assert state.positions[:, 2].min() > 1.0 - 1e-5
        assert np.abs(state.velocities).max() < 1e-9
        assert np.abs(state.angular_velocities).max() < 1e-9


def test_a_crowded_start_in_a_box_comes_apart():
    positions = np.random.default_rng(0).uniform(-1.5, 1.5, (8, 3)) + [0, 0, 1]
    state = rolled(Scene(surfaces=Plane.box(8, 8)), positions, 15)[-1]
    assert depths(state.positions, np.ones(8)).max() < 0.1
    assert state.positions[:, 2].min() > 0.9
