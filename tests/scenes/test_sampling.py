# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start states: seeded, clear of everything, and refused in words where they cannot be."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rigid_gns_core.files.config import config_folder, ConfigError
from rigid_gns_core.scenes.placement import SamplingError
from rigid_gns_core.scenes.plane import closest_points
from rigid_gns_core.scenes.sampling import sample_start
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.scene_file import load_scene, load_start, write_start
from rigid_gns_core.scenes.start import Block, StartRecipe
from rigid_gns_core.scenes.state import State

from .apart import assert_apart, gaps


@pytest.mark.parametrize('path', sorted((config_folder() / 'scenes').glob('*.yaml')), ids=str)
def test_shipped_scenes_can_start(path: Path) -> None:
    scene, start = load_start(path)
    assert_apart(scene, sample_start(scene, start), 0.0 if start.blocks or start.at else start.gap)


def test_the_demonstration_scene_is_that_of_the_thesis() -> None:
    scene, start = load_start('box_154')
    assert start.spheres == 154
    assert scene.surfaces == Plane.box(60.0, 60.0)
    # every pair, walls included, has restitution 0.6
    assert np.square(scene.restitution) == pytest.approx(0.6, abs=1e-4)
    assert scene.surface_values('restitution') == pytest.approx(0.7746)


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


def test_given_places_are_kept() -> None:
    start = StartRecipe(
        blocks=(Block((2, 3, 2), (0.0, 0.0, 1.0), lean=(0.1, 0.2)),), at=((9.0, 0.0, 5.0),)
    )
    scene = Scene()
    state = sample_start(scene, start)
    assert start.spheres == len(state) == 13
    assert state.positions[0].tolist() == [0.0, 0.0, 1.0]
    assert state.positions[-1].tolist() == [9.0, 0.0, 5.0]
    between, _ = gaps(scene, state)
    # along x, y and from layer to layer, whatever the lean
    assert (np.abs(between[:12]) < 1e-9).sum() / 2 == 6 + 8 + 6
    assert between.min() > -1e-9


def test_the_scenes_of_figure_14_are_what_they_say() -> None:
    def load(name: str) -> tuple[Scene, np.ndarray, np.ndarray]:
        scene, start = load_start(name)
        state = sample_start(scene, start)
        return scene, state.positions, gaps(scene, state)[0]

    cubes, inclined = load('ood_a'), load('ood_b')
    assert len(cubes[1]) == 108 and np.array_equal(cubes[1], inclined[1])
    assert (np.abs(cubes[2]) < 1e-9).any(1).all()
    slopes = [np.degrees(np.arccos(plane.normal[2])) for plane in inclined[0].surfaces[5:]]
    assert slopes == pytest.approx([20.0, 4.0, 0.0], abs=0.01)
    _, positions, between = load('ood_c')
    assert positions[-2:, 2].tolist() == [113.0, 230.0]
    assert between[:50].min(1) == pytest.approx(0.005)
    # less than a diameter, more than nothing beside the sphere that they hit
    beside = np.linalg.norm(positions[-2:, :2] - positions[-4:-2, :2], axis=1)
    assert (beside > 0.5).all() and (beside < 1.9).all()
    _, positions, between = load('ood_d')
    assert set(positions[:, 2]) == {60.0} and between.min() == pytest.approx(3.0)


@pytest.mark.parametrize(
    ('start', 'message'),
    [
        (
            {'at': ((0.0, 0.0, 1.0), (9.0, 0.0, 0.9))},
            r'sphere 1 at \(9, 0, 0.9\) m .* in surface 0',
        ),
        (
            {'at': ((0.0, 0.0, 1.0), (0.0, 0.0, 2.9))},
            'sphere 1 .* starts 0.1 m deep in one before',
        ),
        (
            {'spheres': 4, 'layout': 'floor', 'length_x': 3.0, 'length_y': 0.0},
            'on a floor of 3 x 0',
        ),
        ({'spheres': 40, 'layout': 'blocks', 'length_x': 3.0, 'length_y': 3.0}, 'larger box'),
    ],
)
def test_occupied_places_are_named(start: dict[str, object], message: str) -> None:
    with pytest.raises(SamplingError, match=message):
        sample_start(Scene(), StartRecipe(**start))  # type: ignore[arg-type]


def test_layouts_that_do_not_fit_the_scene_are_named() -> None:
    start = StartRecipe(spheres=3, layout='blocks', length_x=20.0, length_y=20.0)
    with pytest.raises(
        SamplingError, match=r'blocks need equal radii, but these go from 0.5 to 1'
    ):
        sample_start(Scene(radius=(1.0, 0.5, 1.0)), start)
    with pytest.raises(SamplingError, match='no level ground'):
        sample_start(Scene(surfaces=()), start)


@pytest.mark.parametrize(
    ('start', 'message'),
    [
        ({'at': ((0.0, 0.0, 1.0),), 'spheres': 2}, 'spheres is 2, but blocks and at hold 1'),
        (
            {'at': ((0.0, 0.0, 1.0),), 'quaternions': ((0.0, 0.0, 0.0, 1.0),) * 2},
            'quaternions has 2 values for 1 centres',
        ),
        ({'at': ((0.0, 0.0, 1.0),), 'layout': 'floor'}, "layout is 'floor', but blocks or at"),
        ({'spheres': 0}, 'spheres is 0'),
        ({'speed': (-1.0, 2.0)}, r'speed is \[-1, 2\], expected'),
        ({'spin': (2.0, 1.0)}, r'spin is \[2, 1\], expected'),
        ({'moving': 1.5}, 'moving is 1.5, expected a share from 0 to 1'),
    ],
)
def test_a_start_out_of_range_is_refused(start: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        StartRecipe(**start)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ('block', 'message'),
    [
        ({'count': (1, 0, 1)}, r'count of a block is \[1, 0, 1\], expected at least 1'),
        ({'pitch': 0.0}, 'pitch of a block is 0 m'),
        ({'corner': (0.0, np.nan, 1.0)}, 'corner of a block'),
        ({'lean': (2.0, 1.0)}, 'lean of a block is .* less than its pitch, 2 m'),
    ],
)
def test_a_block_out_of_range_is_refused(block: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        replace(Block((1, 1, 1), (0.0, 0.0, 1.0)), **block)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ('scene', 'message'),
    [
        (Scene(surfaces=Plane.box(5.0, 5.0)), r'only \d+ of 300 spheres .* use fewer spheres'),
        (Scene(surfaces=Plane.box(2.1, 5.0)), 'no room for a sphere of radius 1 m .* along x'),
    ],
)
def test_too_little_room_is_named(scene: Scene, message: str) -> None:
    with pytest.raises(SamplingError, match=message):
        sample_start(scene, StartRecipe(spheres=300, height=(0.0, 20.0)))


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


def test_given_motion_is_written_and_read_back(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    scene = Scene(surfaces=Plane.box(20.0, 20.0), radius=(1.0, 0.5))
    start = State(
        positions=[(0.1, 0.2, 3.0), (4.0, -3.0, 1.0)],
        velocities=rng.normal(size=(2, 3)),
        angular_velocities=rng.normal(size=(2, 3)),
    )
    file = tmp_path / 'made' / 'start.yaml'
    write_start(file, scene, start, 'two lines\nof remark')
    assert file.read_text(encoding='utf-8').startswith('# two lines\n# of remark\nscene:\n')
    again, recipe = load_start(file)
    assert again == scene
    state = sample_start(again, recipe)
    for name in ('positions', 'velocities', 'angular_velocities'):
        np.testing.assert_array_equal(getattr(state, name), getattr(start, name))
    half = StartRecipe(at=((0, 0, 3),), velocities=((1, 0, 0),))
    assert np.array_equal(sample_start(Scene(), half).angular_velocities, np.zeros((1, 3)))


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        ({'velocities': ((1, 0, 0),)}, 'velocities has 1 values for 0 centres in at'),
        ({'at': ((0, 0, 2),), 'velocities': ((1, 0, 0),) * 2}, 'has 2 values for 1 centres'),
        ({'at': ((0, 0, 2),), 'velocities': ((np.inf, 0, 0),)}, 'expected finite numbers'),
        (
            {'at': ((0, 0, 2),), 'angular_velocities': ((1, 0, 0),), 'spin': (1.0, 2.0)},
            'angular_velocities and speed or spin',
        ),
    ],
)
def test_given_motion_is_checked(values: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        StartRecipe(**values)
