"""Start states: seeded, clear of everything, and refused in words where they cannot be."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rigid_gns_core.config import ConfigError, config_folder
from rigid_gns_core.plane import closest_points
from rigid_gns_core.recipe import DataRecipe, load_recipe
from rigid_gns_core.sampling import SamplingError, StartRecipe, load_scene, sample_start
from rigid_gns_core.scene import Plane, Scene
from rigid_gns_core.state import State

SMOKE = DataRecipe(
    trajectories=3, seed=5, steps=4, spheres=(5, 10), height=(0.0, 5.0), box_side=(6.0, 10.0)
)


def assert_apart(scene: Scene, state: State, gap: float) -> None:
    """All surfaces are `gap` [m] apart, up to rounding."""
    radii = scene.per_sphere('radius', len(state))
    distance = np.linalg.norm(state.positions[:, None] - state.positions, axis=2)
    distance -= radii[:, None] + radii
    np.fill_diagonal(distance, np.inf)
    assert distance.min() >= gap - 1e-9
    points, heights = closest_points(scene.surfaces, state.positions)
    to_surface = np.linalg.norm(state.positions[:, None] - points, axis=2) - radii[:, None]
    assert to_surface.min() >= gap - 1e-9
    assert heights.min() > 0


@pytest.mark.parametrize('name', ['thesis', 'gns', 'gns_test', 'smoke'])
def test_shipped_recipes_draw_spheres_that_are_apart(name: str) -> None:
    recipe = load_recipe(name)
    for index in range(3):
        scene, state = recipe.draw(index)
        assert recipe.spheres[0] <= len(state) <= recipe.spheres[1]
        assert_apart(scene, state, recipe.gap)
        assert np.all(state.velocities == 0)


@pytest.mark.parametrize('path', sorted((config_folder() / 'scenes').glob('*.yaml')), ids=str)
def test_shipped_scenes_can_start(path: Path) -> None:
    scene, start = load_scene(path)
    assert_apart(scene, sample_start(scene, start), start.gap)


def test_the_demonstration_scene_is_that_of_the_thesis() -> None:
    scene, start = load_scene('box_154')
    assert start.spheres == 154
    assert scene.surfaces == Plane.box(60.0, 60.0)
    # every pair, walls included, has restitution 0.6
    assert np.square(scene.restitution) == pytest.approx(0.6, abs=1e-4)
    assert scene.surface_values('restitution') == pytest.approx(0.7746)


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


def test_spheres_of_different_size_and_a_ramp() -> None:
    ramp = Plane((0.0, 0.0, 0.0), (np.sin(0.3), 0.0, np.cos(0.3)), length_x=8.0, length_y=8.0)
    radii = tuple(np.linspace(0.2, 1.0, 40))
    scene = Scene(surfaces=(*Plane.box(12.0, 12.0), ramp), radius=radii)
    start = StartRecipe(spheres=40, height=(0.0, 10.0), gap=0.02)
    state = sample_start(scene, start)
    distance = np.linalg.norm(state.positions[:, None] - state.positions, axis=2)
    distance -= np.add.outer(radii, radii)
    np.fill_diagonal(distance, np.inf)
    assert distance.min() >= 0.02 - 1e-9
    points, _ = closest_points(scene.surfaces, state.positions)
    assert (np.linalg.norm(state.positions[:, None] - points, axis=2).min(1) >= radii).all()


def test_open_ground_needs_lengths() -> None:
    with pytest.raises(SamplingError, match='along x; give length_x in start'):
        sample_start(Scene(), StartRecipe(spheres=2))
    start = StartRecipe(spheres=20, length_x=8.0, length_y=30.0)
    positions = sample_start(Scene(), start).positions
    assert np.abs(positions[:, 0]).max() <= 4.0
    assert 4.0 < np.abs(positions[:, 1]).max() <= 15.0


@pytest.mark.parametrize(
    ('scene', 'message'),
    [
        (Scene(surfaces=Plane.box(5.0, 5.0)), r'only \d+ of 300 spheres .* use fewer spheres'),
        (Scene(surfaces=Plane.box(2.1, 5.0)), 'no room for a sphere of radius 1 m .* along x'),
    ],
)
def test_too_little_room_is_said(scene: Scene, message: str) -> None:
    with pytest.raises(SamplingError, match=message):
        sample_start(scene, StartRecipe(spheres=300, height=(0.0, 20.0)))


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'spheres': (10, 1)}, r'spheres is \[10, 1\], expected'),
        ({'spheres': (0, 4)}, 'lowest at least 1'),
        ({'steps': 0}, 'steps is 0, expected at least 1'),
        ({'dt': -0.1}, 'dt is -0.1'),
        ({'box_side': (0.0, 3.0)}, 'do not fit into a box of side 3 m'),
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


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('start: {spheres: 2}', "missing key 'scene'"),
        ('scene: {radius: -1}', 'radius is -1, expected greater than 0'),
        ('scene: {}\nstart: {speres: 2}', "unknown key 'speres'"),
        ('scene: 3', 'scene is 3, expected a mapping'),
        ('scenes: {}', "unknown key 'scenes'"),
    ],
)
def test_a_wrong_scene_file_is_named(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / 'wrong.yaml'
    file.write_text(text)
    with pytest.raises(ConfigError, match=f'wrong.yaml.*{message}'):
        load_scene(file)


def test_an_unknown_scene_lists_the_shipped_ones() -> None:
    with pytest.raises(ConfigError, match='shipped: .*box_154'):
        load_scene('nowhere')
