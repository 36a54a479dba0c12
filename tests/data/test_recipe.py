# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recipes of data sets: what they draw, the same every time, and what they refuse."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rigid_gns_core.data.recipe import DataRecipe, load_recipe, recipe_hash
from rigid_gns_core.files.config import ConfigError
from rigid_gns_core.scenes.scene import Plane

from ..scenes.apart import assert_apart, gaps

SMOKE = DataRecipe(
    trajectories=3, seed=5, steps=4, spheres=(5, 10), height=(0.0, 5.0), box_side=(6.0, 10.0)
)
_BOXES = DataRecipe(
    trajectories=4,
    seed=100,
    steps=4,
    spheres=(4, 40),
    height=(1.0, 30.0),
    box_side=(6.0, 25.0),
    restitution=(0.0, 0.975),
    friction=(0.0, 1.0),
    rolling_friction=(0.0, 0.06),
)
_FLOOR = replace(
    _BOXES,
    spheres=(5, 30),
    box_side=(10.0, 25.0),
    layers=0.5,
    layout='floor',
    gap=0.0,
    speed=(0.0, 15.0),
    spin=(0.0, 5.0),
    moving=0.4,
)
_BLOCKS = replace(
    _BOXES,
    spheres=(8, 64),
    height=(1.0, 12.0),
    box_side=(18.0, 30.0),
    layout='blocks',
    speed=(0.0, 2.0),
)
DENSE = {
    'boxes': _BOXES,
    'piles': replace(
        _BOXES, spheres=(20, 80), height=(1.0, 22.0), box_side=(4.5, 9.4), layers=4.0
    ),
    'floor': _FLOOR,
    'blocks': _BLOCKS,
    'mixed': replace(
        _BOXES,
        spheres=(4, 30),
        height=(0.0, 10.0),
        box_side=(5.0, 15.0),
        gap=0.02,
        radius=(0.1, 1.0),
        mass=(0.1, 1.0),
        vary='sphere',
        speed=(0.0, 5.0),
    ),
    'rest': replace(_BLOCKS, spheres=(8, 40), height=(0.0, 0.0), speed=(0.0, 0.5), moving=0.1),
}

# hash of the recipe: middle of a wall [m], friction, sums of x, y and z [m]
BEFORE = {
    'fea659237a8e66b7': [40.647381, 0.5, 206.058491, -90.28402, 11834.731532],
    '45bd6338cb978434': [40.647381, 0.146892, -159.214199, -60.827838, 11716.88353],
    '28762a995a669b3f': [4.601816, 0.5, 0.192906, 1.542446, 24.799341],
    'c005b28f17958fde': [4.601816, 0.146892, 3.177838, -2.727002, 24.010957],
}


@pytest.mark.parametrize('name', ['thesis', 'gns', 'gns_test', 'smoke'])
def test_shipped_recipes_draw_spheres_that_are_apart(name: str) -> None:
    recipe = load_recipe(name)
    for index in range(3):
        scene, state = recipe.draw(index)
        assert recipe.spheres[0] <= len(state) <= recipe.spheres[1]
        assert_apart(scene, state, recipe.gap)
        assert np.all(state.velocities == 0)


def test_old_recipes_draw_what_they_drew() -> None:
    """Values of the code as it was before radii, layouts and speeds could be drawn."""
    found = {}
    for name in ('thesis', 'smoke'):
        recipe = load_recipe(name)
        for drawn in (recipe, replace(recipe, friction=(0.1, 0.9))):
            scene, state = drawn.draw(1)
            values = [scene.surfaces[2].point[0], scene.friction, *state.positions.sum(0)]
            found[recipe_hash(drawn)] = np.round(values, 6).tolist()
    assert found == BEFORE


def test_a_draw_depends_on_seed_and_index_alone() -> None:
    scene, state = SMOKE.draw(2)
    again = replace(SMOKE, trajectories=50).draw(2)
    assert again[0] == scene
    assert np.array_equal(again[1].positions, state.positions)
    for other in (SMOKE.draw(1), replace(SMOKE, seed=6).draw(2)):
        assert other[0] != scene


def test_the_thesis_recipe_draws_every_number_of_spheres() -> None:
    recipe = load_recipe('thesis')
    counts = np.array([len(recipe.draw(index)[1]) for index in range(16)])
    # mean of an even draw from 1 to 300, within 3 standard errors of 87 / sqrt(16)
    assert abs(counts.mean() - 150.5) < 3 * 87 / np.sqrt(16)
    assert counts.min() < 75 and counts.max() > 225


def test_the_ground_holds_the_spheres_in_the_layers_allowed() -> None:
    recipe = replace(SMOKE, spheres=(40, 40), box_side=(0.0, 20.0), height=(0.0, 50.0), layers=1.0)
    for index in range(5):
        walls = recipe.draw(index)[0].surfaces[1:]
        area = abs(4 * walls[0].point[0] * walls[2].point[1])
        assert area >= 40 * (2 * recipe.radius + recipe.gap) ** 2 * (1 - 1e-9)


def test_materials_are_drawn_from_a_range() -> None:
    recipe = replace(SMOKE, friction=(0.1, 0.9))
    friction = [recipe.draw(index)[0].friction for index in range(5)]
    assert len(set(friction)) == 5
    assert all(0.1 <= float(np.asarray(value)) <= 0.9 for value in friction)


@pytest.mark.parametrize('name', DENSE)
def test_dense_recipes_draw_spheres_that_are_not_inside_others(name: str) -> None:
    recipe = DENSE[name]
    for index in range(4):
        scene, state = recipe.draw(index)
        assert recipe.spheres[0] <= len(state) <= recipe.spheres[1]
        assert_apart(scene, state, 0.0)
        again = recipe.draw(index)
        assert again[0] == scene
        assert np.array_equal(again[1].velocities, state.velocities)


def test_radii_and_masses_are_drawn_evenly_in_the_logarithm() -> None:
    recipe = replace(
        SMOKE, spheres=(200, 200), radius=(0.1, 1.0), mass=(0.5, 2.0), box_side=(30.0, 30.0)
    )
    scene, state = recipe.draw(0)
    assert_apart(scene, state, recipe.gap)
    for name, low, high in (('radius', 0.1, 1.0), ('mass', 0.5, 2.0)):
        drawn = scene.per_sphere(name, 200)
        assert low <= drawn.min() < 1.1 * low and high / 1.1 < drawn.max() <= high
        # the middle of the logarithms, within 4 standard errors
        error = np.log(high / low) / np.sqrt(12 * 200)
        assert abs(np.log(drawn).mean() - np.log(low * high) / 2) < 4 * error
    dense = replace(recipe, mass=8.0, density=True).draw(0)[0]
    radii = dense.per_sphere('radius', 200)
    assert dense.per_sphere('mass', 200) == pytest.approx(8.0 * radii**3)


def test_materials_vary_by_trajectory_or_by_sphere_and_surface() -> None:
    recipe = replace(SMOKE, restitution=(0.2, 0.9), rolling_friction=(0.0, 0.1), vary='sphere')
    scene, state = recipe.draw(0)
    for name in ('restitution', 'rolling_friction'):
        assert len(set(scene.per_sphere(name, len(state)))) == len(state)
    surfaces = scene.surface_values('restitution')
    assert len(set(surfaces)) == 5 and surfaces.min() >= 0.2 and surfaces.max() <= 0.9
    # a number stays the same for all
    assert scene.friction == 0.5 and (scene.surface_values('friction') == 0.5).all()
    scene, _ = replace(recipe, vary='trajectory').draw(0)
    assert isinstance(scene.restitution, float)
    assert (scene.surface_values('restitution') == scene.restitution).all()


def test_a_floor_holds_every_sphere_and_lets_some_touch() -> None:
    recipe = replace(
        SMOKE, spheres=(30, 30), layout='floor', gap=0.0, box_side=(25.0, 25.0), radius=(0.3, 1.0)
    )
    scene, state = recipe.draw(0)
    assert_apart(scene, state, 0.0)
    assert np.array_equal(state.positions[:, 2], scene.per_sphere('radius', 30))
    touching = (np.abs(gaps(scene, state)[0]) < 1e-9).any(1)
    assert 4 < touching.sum() < 28
    scene, state = replace(recipe, gap=0.2).draw(0)
    between, to_surface = gaps(scene, state)
    assert between.min() >= 0.2 and to_surface[:, 1:].min() >= 0.2
    assert np.abs(to_surface[:, 0]).max() < 1e-12


def test_blocks_touch_within_and_keep_apart() -> None:
    recipe = replace(
        SMOKE, spheres=(40, 40), layout='blocks', gap=0.3, radius=0.5, box_side=(25.0, 25.0)
    )
    hanging = 0
    for index in range(5):
        scene, state = recipe.draw(index)
        between, to_surface = gaps(scene, state)
        touches = np.abs(between) < 1e-9
        assert (touches | (between >= 0.3 - 1e-9)).all()
        assert touches.any(1).all()
        assert to_surface.min() >= -1e-9 and to_surface[:, 1:].min() >= 0.3 - 1e-9
        hanging += (to_surface[:, 0] > 3.0).any()
    assert hanging > 0
    for index in range(5):
        positions = replace(recipe, height=(0.0, 0.0)).draw(index)[1].positions
        assert positions[:, 2] == pytest.approx(0.5 + np.round(positions[:, 2] - 0.5))
        assert positions[:, 2].min() == 0.5


def test_a_share_of_the_spheres_moves() -> None:
    recipe = replace(
        SMOKE, spheres=(200, 200), box_side=(60.0, 60.0), speed=(1.0, 3.0), spin=(2.0, 5.0)
    )
    for layout in ('scattered', 'floor'):
        start = replace(recipe, layout=layout).draw(0)[1]
        speed = np.linalg.norm(start.velocities, axis=1)
        spin = np.linalg.norm(start.angular_velocities, axis=1)
        assert 1.0 <= speed.min() < 1.1 and 2.9 < speed.max() <= 3.0
        assert spin.min() >= 2.0 and spin.max() <= 5.0
        # no direction is preferred: mean of 200 of length 2, within 4 standard errors
        assert np.abs(start.velocities.mean(0)).max() < 4 * 2.1 / np.sqrt(2 * 200)
        assert (np.abs(start.velocities[:, 2]).max() == 0) == (layout == 'floor')
        assert np.abs(start.angular_velocities[:, 2]).max() > 1.0
    start = replace(recipe, moving=0.25).draw(0)[1]
    moves = (start.velocities != 0).any(1)
    assert abs(moves.mean() - 0.25) < 4 * np.sqrt(0.25 * 0.75 / 200)
    assert np.array_equal(moves, (start.angular_velocities != 0).any(1))


def test_without_walls_there_is_the_ground_alone() -> None:
    for layout in ('scattered', 'floor'):
        scene, state = replace(SMOKE, walls=False, layout=layout).draw(0)
        assert scene.surfaces == (Plane(),)
        assert np.abs(state.positions[:, :2]).max() <= 5.0


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'spheres': (10, 1)}, r'spheres is \[10, 1\], expected'),
        ({'spheres': (0, 4)}, 'lowest at least 1'),
        ({'steps': 0}, 'steps is 0, expected at least 1'),
        ({'dt': -0.1}, 'dt is -0.1'),
        ({'box_side': (0.0, 3.0)}, 'do not fit into a box of side 3 m'),
        ({'radius': (0.1, 3.0)}, 'spheres of radius 3 m in 2 layers do not fit'),
        ({'radius': (0.0, 1.0)}, 'radius is 0, expected a positive number'),
        ({'mass': (2.0, 1.0)}, r'mass is \[2, 1\], expected'),
        ({'speed': (2.0, 1.0)}, r'speed is \[2, 1\], expected'),
        ({'moving': -0.1}, 'moving is -0.1, expected a share'),
        ({'radius': (0.5, 1.0), 'layout': 'blocks'}, 'blocks need equal radii'),
    ],
)
def test_a_recipe_out_of_range_is_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        replace(SMOKE, **change)  # type: ignore[arg-type]


def test_a_recipe_file_builds_on_another(tmp_path: Path) -> None:
    file = tmp_path / 'mine.yaml'
    file.write_text('base: smoke\nseed: 9\n')
    assert load_recipe(file) == replace(load_recipe('smoke'), seed=9)
    file.write_text(f'base: {file}\n')
    with pytest.raises(ConfigError, match='base leads back'):
        load_recipe(file)
    file.write_text('base: smoke\nspheers: 3\n')
    with pytest.raises(ConfigError, match="mine.yaml: unknown key 'spheers', allowed: traj"):
        load_recipe(file)
