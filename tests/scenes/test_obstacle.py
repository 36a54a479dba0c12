# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Obstacles: closest points, what a scene of planes has of them, starts beside them, errors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.testing import assert_allclose
import pytest
from rigid_gns_core import load_scene, Obstacle, Plane, Scene, UserError
from rigid_gns_core.scenes.plane import closest_points
from rigid_gns_core.scenes.sampling import sample_start
from rigid_gns_core.scenes.start import StartRecipe

PLACED: dict[str, Any] = {'point': (0.3, -0.2, 0.5), 'axis': (0.4, -0.3, 1.0)}
SHAPES = (
    Obstacle('sphere', radius=0.8, **PLACED),
    Obstacle('box', size=(1.0, 2.0, 0.6), direction=(1.0, 1.0, 0.0), **PLACED),
    Obstacle('cylinder', radius=0.7, length=1.4, **PLACED),
    Obstacle('ring', radius=1.2, thickness=0.3, **PLACED),
    Obstacle('ring', radius=1.2, **PLACED),
    Obstacle('tube', radius=1.2, length=1.4, thickness=0.2, **PLACED),
)
# to the nearest of the points below
GRID = 0.03


def surface(obstacle: Obstacle) -> np.ndarray:
    """Points of the surface at most `GRID` apart [m], shape (m, 3), made shape by shape."""
    turns = np.linspace(0.0, 2.0 * np.pi, 300)
    if obstacle.shape == 'box':
        u = np.linspace(-0.5, 0.5, 80)
        x, y = np.meshgrid(u, u)
        faces = [
            np.insert(np.stack([x.ravel(), y.ravel()], 1), axis, side, axis=1)
            for axis in range(3)
            for side in (-0.5, 0.5)
        ]
        local = np.concatenate(faces) * obstacle.size
    else:
        radius, half = obstacle.radius, (obstacle.length or 0.0) / 2
        wall, z = (obstacle.thickness or 0.0) / 2, np.linspace(-half, half, 80)
        circle = np.array([np.cos(turns), np.sin(turns)])
        if obstacle.shape == 'sphere':
            outline = [radius * circle]
        elif obstacle.shape == 'cylinder':
            s = np.linspace(0.0, radius, 80)
            outline = [[0.0 * z + radius, z], [s, 0.0 * s + half], [s, 0.0 * s - half]]
        else:
            outline = [[0.0 * z + radius + side * wall, z] for side in (-1, 1)]
            for end in (-1, 1):  # the half of a round rim that is outside
                rim = wall * circle[:, end * circle[1] >= 0]
                outline.append([radius + rim[0], end * half + rim[1]])
        s, h = np.concatenate([np.array(part) for part in outline], axis=1)
        ring = np.stack([np.cos(turns), np.sin(turns)], 1)
        local = np.concatenate(
            [s[:, None, None] * ring, np.broadcast_to(h[:, None, None], (len(s), 300, 1))], axis=2
        ).reshape(-1, 3)
    return np.asarray(obstacle.point) + local @ obstacle.axes


@pytest.mark.parametrize('obstacle', SHAPES, ids=lambda o: f'{o.shape} {o.thickness}')
def test_closest_point_against_points_of_the_surface(obstacle: Obstacle) -> None:
    rng = np.random.default_rng(0)
    places = obstacle.point + rng.normal(size=(60, 3)) * rng.choice([0.2, 1.5], (60, 1))
    distance, normal = obstacle.closest(places)
    points = surface(obstacle)
    nearest = np.array([np.linalg.norm(points - place, axis=1).min() for place in places])
    assert_allclose(np.abs(distance), nearest, atol=GRID)
    assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-12)
    # a step along the normal is one away from the surface, also from inside
    moved, _ = obstacle.closest(places + 1e-6 * normal)
    assert_allclose(moved - distance, 1e-6, atol=1e-9)
    onto = places - distance[:, None] * normal
    assert_allclose(obstacle.closest(onto)[0], 0.0, atol=1e-12)


def test_a_box_is_six_plates() -> None:
    box = SHAPES[1]
    scene = Scene(surfaces=(), obstacles=(box, SHAPES[0])).of_fixed_surfaces()
    assert scene.obstacles == (SHAPES[0],) and len(scene.surfaces) == 6
    places = box.point + 2.0 * np.random.default_rng(1).normal(size=(100, 3))
    points, heights = closest_points(scene.surfaces, places)
    outside = (heights > 0).any(axis=1)
    apart = np.linalg.norm(places[:, None] - points, axis=2).min(axis=1)
    assert_allclose(box.closest(places)[0], np.where(outside, apart, -apart), atol=1e-12)


def test_starts_keep_clear_of_obstacles() -> None:
    scene = Scene(surfaces=Plane.box(4.0, 4.0), radius=0.2, obstacles=SHAPES[:3])
    recipe = StartRecipe(spheres=40, height=(0.2, 2.5), gap=0.05)
    state = sample_start(scene, recipe, np.random.default_rng(0))
    for obstacle in scene.obstacles:
        assert obstacle.closest(state.positions)[0].min() > 0.25 - 1e-9


def test_scene_file(tmp_path: Path) -> None:
    file = tmp_path / 'bin.yaml'
    file.write_text(
        'scene:\n'
        '  radius: 0.02\n'
        '  obstacles:\n'
        '  - {shape: tube, point: [0, 0, 0.1], radius: 0.15, length: 0.2, thickness: 0.004}\n'
        '  - {shape: box, size: [0.4, 0.3, 0.1], contact: {restitution: 0.5, friction: 0.2}}\n'
    )
    tube, box = load_scene(file).obstacles
    assert (tube.radius, tube.length, tube.thickness) == (0.15, 0.2, 0.004)
    assert box.size == (0.4, 0.3, 0.1) and box.contact is not None
    assert Scene.from_mapping(load_scene(file).to_mapping()) == load_scene(file)
    assert 'obstacles' not in Scene().to_mapping()


@pytest.mark.parametrize(
    ('given', 'said'),
    [
        ({'shape': 'cone'}, "shape of an obstacle is 'cone', expected one of sphere, box"),
        ({'shape': 'sphere'}, 'radius of a sphere is not given'),
        ({'shape': 'box', 'size': (1, 0, 1)}, r'size of a box is .* expected more than 0'),
        ({'shape': 'sphere', 'radius': 1, 'length': 1}, 'a sphere has none; leave it out'),
        ({'shape': 'ring', 'radius': -1}, 'radius of a ring is -1.0, expected more than 0'),
        ({'shape': 'ring', 'radius': 1, 'thickness': -1}, 'thickness .* expected at least 0'),
        ({'shape': 'ring', 'radius': 1, 'thickness': 2}, 'expected less than twice its radius'),
        ({'shape': 'tube', 'radius': 1, 'length': np.inf}, 'length of a tube is inf, expected'),
        ({'shape': 'sphere', 'radius': np.nan}, 'radius of a sphere is nan, expected'),
        ({'shape': 'cylinder', 'radius': 1, 'length': 1, 'axis': (0, 0, 0)}, 'axis of a cylinder'),
        ({'shape': 'sphere', 'radius': 1, 'friction': -1}, 'friction is -1, expected at least 0'),
    ],
)
def test_refused(given: dict[str, Any], said: str) -> None:
    with pytest.raises(UserError, match=said):
        Obstacle(**given)
    with pytest.raises(UserError, match=r'scene.obstacles\[0\]'):
        Scene.from_mapping({'obstacles': [given]})


def test_scenes_take_obstacles_only() -> None:
    with pytest.raises(UserError, match='obstacles holds'):
        Scene(obstacles=(Plane(),))  # type: ignore[arg-type]
    with pytest.raises(UserError, match="unknown key 'sort', allowed: shape, point"):
        Scene.from_mapping({'obstacles': [{'sort': 'box'}]})
    assert Scene(obstacles=SHAPES[0]).obstacles == (SHAPES[0],)  # type: ignore[arg-type]
    assert replace(SHAPES[3].scaled(2.0), point=SHAPES[3].point).thickness == 0.6
