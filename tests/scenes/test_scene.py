# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Planes, materials and the mapping that goes into YAML, HDF5 and bags."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import json

import numpy as np
from numpy.testing import assert_allclose
import pytest
from rigid_gns_core import Air, ContactLaw, load_scene, Obstacle, Plane, Scene, State, UserError
from rigid_gns_core.scenes.plane import closest_points

EXACT = 1e-12  # a handful of roundings of numbers up to 100


def test_box_encloses_its_inside() -> None:
    box = Plane.box(60.0, 40.0)
    assert len(box) == 5
    inside = np.array([[0.0, 0.0, 1.0], [29.0, 19.0, 50.0], [-29.0, -19.0, 0.5]])
    points, heights = closest_points(box, inside)
    expected = np.stack(
        [inside[:, 2], inside[:, 0] + 30, 30 - inside[:, 0], inside[:, 1] + 20, 20 - inside[:, 1]],
        axis=1,
    )
    assert_allclose(heights, expected, atol=EXACT)
    # where the foot of the perpendicular lies on a plane, the distance is the height
    distance = np.linalg.norm(inside[:, None] - points, axis=-1)
    assert_allclose(distance, expected, atol=EXACT)


def test_box_of_finite_height_ends_there() -> None:
    box = Plane.box(10.0, 10.0, height=2.0)
    points, _ = closest_points(box, np.array([[0.0, 0.0, 7.0]]))
    assert_allclose(points[0, 1:, 2], 2.0, atol=EXACT)
    assert_allclose(points[0, 1:, :2], [[-5, 0], [5, 0], [0, -5], [0, 5]], atol=EXACT)


@pytest.mark.parametrize('seed', range(5))
def test_axes_are_a_right_handed_frame(seed: int) -> None:
    generator = np.random.default_rng(seed)
    axes = Plane((0, 0, 0), generator.normal(size=3), generator.normal(size=3)).axes
    assert_allclose(axes @ axes.T, np.eye(3), atol=EXACT)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert_allclose(Plane((0, 0, 0), axes[2]).axes[2], axes[2], atol=EXACT)


@pytest.mark.parametrize('seed', range(5))
def test_closest_point_against_a_fine_grid(seed: int) -> None:
    generator = np.random.default_rng(seed)
    plane = Plane(
        generator.normal(size=3), generator.normal(size=3), generator.normal(size=3), 2.0, 3.0
    )
    position = plane.point + 3 * generator.normal(size=3)
    points, heights = closest_points((plane,), position[None])
    u, v = np.meshgrid(np.linspace(-1.0, 1.0, 201), np.linspace(-1.5, 1.5, 301))
    grid = plane.point + np.stack([u, v], -1).reshape(-1, 2) @ plane.axes[:2]
    nearest = np.linalg.norm(grid - position, axis=1).min()
    found = np.linalg.norm(points[0, 0] - position)
    assert found <= nearest + EXACT
    assert found >= nearest - 0.01  # the grid's spacing
    assert heights[0, 0] == pytest.approx((position - plane.point) @ np.asarray(plane.normal))


@pytest.mark.parametrize('lean', [1.0, 1e-3])
def test_a_plane_made_of_its_own_values_is_equal(lean: float) -> None:
    generator = np.random.default_rng(0)
    for _ in range(100):
        normal = generator.normal(size=3)
        plane = Plane(normal=normal, direction=normal + lean * generator.normal(size=3))
        assert replace(plane) == plane
        assert abs(np.dot(plane.normal, plane.direction)) < EXACT


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ({'normal': (0, 0, 0)}, 'normal of a plane is .* expected a vector that is not zero'),
        ({'direction': (0, 0, 2)}, 'parallel to its normal'),
        ({'point': (0, np.nan, 0)}, 'three finite numbers'),
        ({'length_x': 0.0}, 'length_x of a plane is 0, expected more than 0'),
        ({'length_y': np.nan}, 'length_y of a plane is nan'),
        ({'restitution': 1.5}, 'restitution is 1.5, expected at least 0 and at most 1'),
        ({'friction': -0.1}, 'friction is -0.1, expected at least 0'),
    ],
)
def test_bad_planes(arguments: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Plane(**arguments)


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ({'radius': 0.0}, 'radius is 0, expected greater than 0'),
        ({'radius': (1.0, -2.0)}, 'radius is -2'),
        ({'mass': np.inf}, 'mass is inf'),
        ({'restitution': -0.1}, 'restitution is -0.1'),
        ({'friction': np.nan}, 'friction is nan'),
        ({'rolling_friction': [[1.0]]}, 'rolling_friction has shape'),
        ({'surfaces': ('ground',)}, 'expected planes only'),
        ({'gravity': (0.0, 1.0)}, 'gravity is .* three finite numbers'),
    ],
)
def test_bad_scenes(arguments: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Scene(**arguments)


def test_box_refuses_a_bad_length() -> None:
    with pytest.raises(ValueError, match='length_y of the box is -1'):
        Plane.box(1.0, -1.0)


def test_values_per_sphere() -> None:
    scene = Scene(radius=(1.0, 2.0, 3.0), mass=2.0)
    assert scene.sphere_count == 3
    assert_allclose(scene.per_sphere('radius', 3), [1, 2, 3])
    assert_allclose(scene.per_sphere('mass', 3), [2, 2, 2])
    with pytest.raises(ValueError, match='given for 3 spheres, but there are 4'):
        scene.per_sphere('radius', 4)
    with pytest.raises(ValueError, match='differ in length'):
        _ = Scene(radius=(1.0, 2.0), mass=(1.0, 2.0, 3.0)).sphere_count


def test_a_surface_has_its_own_material_or_the_scenes() -> None:
    scene = Scene(surfaces=(Plane(restitution=0.9), Plane()), restitution=(0.2, 0.4))
    assert_allclose(scene.surface_values('restitution'), [0.9, 0.3])


def test_ground_is_the_lowest_level_plane() -> None:
    level, tilted = Plane((0, 0, 2)), Plane((0, 0, -5), (1, 0, 1))
    assert Scene(surfaces=(tilted, level, Plane((0, 0, 1)))).ground == 2
    assert Scene(surfaces=(tilted,)).ground is None
    assert Scene(surfaces=()).ground is None


def test_gravity_as_a_number_points_down() -> None:
    assert Scene(gravity=1.62).gravity == (0.0, 0.0, -1.62)
    assert_allclose(Scene(gravity=(3.0, 0.0, 0.0)).up, [-1, 0, 0])
    assert_allclose(Scene(gravity=0.0).up, [0, 0, 1])


@pytest.mark.parametrize(
    'scene',
    [
        Scene(surfaces=Plane.box(60.0, 40.0, restitution=0.5)),
        Scene(surfaces=(), radius=(0.1, 0.2), gravity=(0.0, 1.0, -9.0)),
        Scene(surfaces=Plane((1, 2, 3), (1, 1, 1), (1, 0, 0), 4.0, 5.0, friction=0.1)),
    ],
)
def test_mapping_roundtrip_through_json(scene: Scene) -> None:
    restored = Scene.from_mapping(json.loads(json.dumps(scene.to_mapping(), allow_nan=False)))
    again = restored.to_mapping()
    for one, other in zip(scene.surfaces, restored.surfaces, strict=True):
        assert_allclose(one.axes, other.axes, atol=EXACT)
        assert (one.point, one.restitution, one.friction) == (
            other.point,
            other.restitution,
            other.friction,
        )
        assert (one.length_x, one.length_y) == (other.length_x, other.length_y)
    for name in ('radius', 'mass', 'restitution', 'friction', 'rolling_friction', 'gravity'):
        assert again[name] == scene.to_mapping()[name]


def test_mapping_with_a_box() -> None:
    scene = Scene.from_mapping({'box': {'length_x': 60, 'length_y': 60}, 'restitution': 0.4})
    assert scene == Scene(surfaces=Plane.box(60.0, 60.0), restitution=0.4)
    with pytest.raises(ValueError, match=r"scene\.box: unknown key 'depth', allowed"):
        Scene.from_mapping({'box': {'length_x': 1, 'length_y': 1, 'depth': 1}})
    with pytest.raises(ValueError, match=r"scene: unknown key 'bounce', allowed: surfaces"):
        Scene.from_mapping({'bounce': 1.0})


@pytest.mark.parametrize(
    ('mapping', 'message'),
    [
        ({'box': 5}, 'scene.box is 5, expected a mapping'),
        ({'box': {}}, "missing key 'length_x'"),
        ({'box': {'length_x': [1], 'length_y': 3}}, 'scene.box.length_x is'),
        (
            {'box': {'length_x': 3, 'length_y': 3, 'depth': 1}},
            "unknown key 'depth', allowed: length",
        ),
        ({'surfaces': 5}, 'scene.surfaces is 5, expected a list'),
        ([], 'expected a mapping'),
    ],
)
def test_bad_files_are_named(mapping, message):
    with pytest.raises(ValueError, match=message):
        Scene.from_mapping(mapping)


def test_gravity_may_be_one_number():
    assert Scene(gravity=1.62).gravity == (0.0, 0.0, -1.62)
    assert Scene.from_mapping({'gravity': 1.62}).gravity == (0.0, 0.0, -1.62)
    with pytest.raises(ValueError, match='gravity is -9.81'):
        Scene(gravity=-9.81)


@pytest.mark.parametrize('value', ['wide', '1,5', {}, 1j, [[1.0, 2.0], [3.0]], [], 10**400])
@pytest.mark.parametrize(
    ('what', 'name'),
    [
        (lambda value: Scene(radius=value), 'radius'),
        (lambda value: Scene(gravity=value), 'gravity'),
        (lambda value: Scene(mass=[1.0, value]), 'mass'),
        (lambda value: Plane(value), 'point'),
        (lambda value: Plane(normal=value), 'normal'),
        (lambda value: Plane(length_x=value), 'length_x'),
        (lambda value: Plane(restitution=value), 'restitution'),
        (lambda value: Plane(velocity=value), 'velocity'),
        (lambda value: Obstacle('sphere', radius=value), 'radius'),
        (lambda value: Obstacle(value, radius=1.0), 'shape'),
        (lambda value: Air(density=value), 'density'),
        (lambda value: Air(wind=value), 'wind'),
        (lambda value: ContactLaw(friction=value), 'friction'),
        (lambda value: State(positions=value), 'positions'),
        (lambda value: State(positions=[[0.0, 0.0, 1.0]], velocities=value), 'velocities'),
        (load_scene, 'scene'),
    ],
)
def test_what_is_no_number_is_told_with_its_name(
    what: Callable[[object], object], name: str, value: object
) -> None:
    if name == 'positions' and value == []:
        assert len(what(value)) == 0  # no spheres
        return
    with pytest.raises(UserError, match=name) as caught:
        what(value)
    assert '\n' not in str(caught.value)
