# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Surfaces that bodies carry: as text, in the scene, and in a start."""

from __future__ import annotations

import numpy as np
import pytest
from rigid_gns_core import ContactLaw, Plane, Scene, UserError
from rigid_gns_core.forecasts.body_motion import BodyMotion
from rigid_gns_core.forecasts.moving_surfaces import (
    bodies_of,
    Body,
    carried,
    MovingSurfaces,
    with_surfaces,
)
from rigid_gns_core.forecasts.starts import Start
from scipy.spatial.transform import Rotation

RACKET = Plane(
    (0.1, 0.0, 0.02), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), 0.16, 0.15,
    contact=ContactLaw(restitution=0.8, friction=0.4),
)  # fmt: skip
SCENE = Scene(surfaces=(Plane(), RACKET, Plane((0, 0, 3.0), (0, 0, -1.0))), radius=0.02)


def test_bodies_are_read_by_name() -> None:
    text = '{racket: {surfaces: [1], pose: racket/pose, timeout: 0.5}}'
    assert bodies_of(text) == {'racket': Body((1,), 'racket/pose', timeout=0.5)}
    assert bodies_of('') == bodies_of('  ') == {}


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('{', 'moving_surfaces: not valid YAML'),
        ('[1]', r'moving_surfaces is \[1\], expected names and bodies'),
        ('racket: 3', r'moving_surfaces\.racket is 3, expected a mapping'),
        ('racket: {pose: a}', "missing key 'surfaces'"),
        ('racket: {surfaces: [], pose: a}', 'surfaces is empty'),
        ('racket: {surfaces: [1]}', 'none of pose, frame and plan is given'),
        ('racket: {surfaces: [1], plan: p, twist: t}', 'twist is given, but neither pose nor'),
        ('racket: {surfaces: [1], pose: p, frame: f}', 'pose and frame both say where it is'),
        ('a: {surfaces: [1], frame: x}\nb: {surfaces: [2], frame: x}', 'frame x twice'),
        ('racket: {surfaces: [1], pose: a, speed: 2}', "unknown key 'speed'"),
        ('racket: {surfaces: [1], pose: a, timeout: 0}', 'timeout is 0 s, expected more than 0'),
        ('a: {surfaces: [1], pose: x}\nb: {surfaces: [1], pose: y}', 'surface 1 twice'),
        ('a: {surfaces: [1], pose: x}\nb: {surfaces: [2], pose: x}', 'topic x twice'),
    ],
)
def test_what_is_no_body_is_named(text: str, message: str) -> None:
    with pytest.raises(UserError, match=message):
        bodies_of(text)


def test_a_surface_that_is_not_there_or_moves_is_named() -> None:
    with pytest.raises(UserError, match=r'racket has surface 3, but the scene has 3, from 0 on'):
        MovingSurfaces(SCENE, {'racket': Body((3,), 'pose')})
    lift = Scene(surfaces=(Plane(velocity=(0, 0, 1)),))
    with pytest.raises(UserError, match='which the scene moves already'):
        MovingSurfaces(lift, {'racket': Body((0,), 'pose')})
    with pytest.raises(UserError, match='of kind gns, and only the laws'):
        MovingSurfaces(SCENE, {'racket': Body((1,), 'pose')}).check_model('gns')
    MovingSurfaces(SCENE, {}).check_model('gns')


def test_a_surface_is_carried_by_its_body() -> None:
    """A body at (1, 2, 3), turned by 90 degrees about y, so that its z axis is the scene's x."""
    turn = Rotation.from_rotvec([0.0, np.pi / 2, 0.0])
    spin, velocity = np.array([0.0, 0.0, 5.0]), np.array([1.0, 0.0, 0.0])
    motion = BodyMotion(np.array([1.0, 2.0, 3.0]), turn, velocity, spin, 'poses')
    found = carried(RACKET, motion)
    np.testing.assert_allclose(found.point, [1.02, 2.0, 2.9], atol=1e-12)
    np.testing.assert_allclose(found.normal, [1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(found.direction, [0.0, 0.0, -1.0], atol=1e-12)
    # V + W x r, r = (0.02, 0, -0.1)
    np.testing.assert_allclose(found.velocity, [1.0, 0.1, 0.0], atol=1e-12)
    np.testing.assert_allclose(found.angular_velocity, spin)
    assert (found.length_x, found.length_y, found.contact) == (0.16, 0.15, RACKET.contact)


def test_surfaces_keep_their_indices() -> None:
    surfaces = MovingSurfaces(SCENE, {'racket': Body((1,), 'pose')})
    assert surfaces.fixed.surfaces == (SCENE.surfaces[0], SCENE.surfaces[2])
    assert surfaces.unknown == ['racket']
    with pytest.raises(UserError, match='nothing has come for racket on pose yet'):
        surfaces.at(0)
    surfaces.tracks['racket'].add_pose(0, np.array([0, 0, 1, 0, 0, 0, 1.0]))
    found = with_surfaces(surfaces.fixed, surfaces.at(0))
    assert found.surfaces[0] == SCENE.surfaces[0] and found.surfaces[2] == SCENE.surfaces[2]
    np.testing.assert_allclose(found.surfaces[1].point, [0.1, 0.0, 1.02], atol=1e-12)


def test_a_start_keeps_surfaces_to_the_bit() -> None:
    rng = np.random.default_rng(0)
    motion = BodyMotion(
        rng.normal(size=3), Rotation.random(random_state=1), rng.normal(size=3),
        rng.normal(size=3), 'poses',
    )  # fmt: skip
    surfaces = {1: carried(RACKET, motion), 4: carried(Plane(length_x=2.0), motion)}
    start = Start(3, (1, 2, 3), 'every', surfaces=surfaces)
    read = Start.from_json(start.json)
    assert read == start
    assert read.surfaces[1].axes.tobytes() == surfaces[1].axes.tobytes()
    assert 'surfaces' not in Start(3, (1, 2, 3), 'every').json
    with pytest.raises(UserError, match='surfaces'):
        Start.from_json('{"stamp_ns": 1, "window_ns": [1], "surfaces": {"0": {"size": 1}}}')
