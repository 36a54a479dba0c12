# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Planned motions between their points, written, in other units, and what is refused."""

from __future__ import annotations

from dataclasses import replace
import json
from typing import Any

import numpy as np
import pytest
from rigid_gns_core import Plane, Scene, UserError
from rigid_gns_core.scenes.planned_motion import Moments, PlannedMotion
from rigid_gns_core.scenes.similarity import in_units, ModelUnits
from scipy.spatial.transform import Rotation

AXIS = np.array([0.6, 0.0, 0.8])


def truth(times: np.ndarray) -> Moments:
    """A cubic in each coordinate, and a turn about an axis by a cubic."""
    t = times[:, None]
    cubics = np.array([[0.3, -1.0, 2.0], [1.0, 0.5, -0.4], [0.2, 3.0, -1.0], [-1.0, 0.7, 0.5]])
    powers = np.concatenate([t**k for k in range(4)], axis=1)
    rates = np.concatenate([0 * t, 1 + 0 * t, 2 * t, 3 * t**2], axis=1)
    turn, rate = powers @ [0.2, 1.0, -0.5, 0.4], rates @ [0.2, 1.0, -0.5, 0.4]
    quaternions = Rotation.from_rotvec(turn[:, None] * AXIS).as_quat()
    return Moments(powers @ cubics, quaternions, rates @ cubics, rate[:, None] * AXIS)


def plan() -> PlannedMotion:
    times = np.array([0.0, 0.3, 0.4, 1.1])
    return PlannedMotion.of(times, truth(times))


def test_cubics_are_followed_exactly() -> None:
    times = np.linspace(0.0, 1.0999, 57)
    found, expected = plan().at(times), truth(times)
    np.testing.assert_allclose(found.positions, expected.positions, atol=1e-12)
    np.testing.assert_allclose(found.velocities, expected.velocities, atol=1e-12)
    np.testing.assert_allclose(found.angular_velocities, expected.angular_velocities, atol=1e-12)
    np.testing.assert_allclose(found.quaternions, expected.quaternions, atol=1e-12)


def test_an_axis_that_changes_gives_the_rate_of_its_turn() -> None:
    """The angular velocity is that of the rotations, by differences."""
    times = np.array([0.0, 0.2, 0.5])
    turns = Rotation.from_rotvec([[0.0, 0.0, 0.0], [0.2, 0.1, -0.1], [0.1, 0.5, 0.1]])
    spins = np.array([[1.0, 0.2, 0.0], [0.5, 1.0, 0.3], [-0.5, 0.4, 1.0]])
    still = np.zeros((3, 3))
    own = PlannedMotion.of(times, Moments(still, turns.as_quat(), still, spins))
    np.testing.assert_allclose(own.at(times[:2]).angular_velocities, spins[:2], atol=2e-4)
    inner, h = np.linspace(0.01, 0.49, 30), 1e-6
    before, after = (Rotation.from_quat(own.at(inner + s * h).quaternions) for s in (-1, 1))
    rates = (after * before.inv()).as_rotvec() / (2 * h)
    # series of the turn from point to point, here up to 0.5 rad
    np.testing.assert_allclose(own.at(inner).angular_velocities, rates, atol=2e-3)


def test_a_body_rests_before_and_after() -> None:
    found, given = plan().at(np.array([-1.0, 1.1, 5.0])), plan().moments
    np.testing.assert_allclose(found.positions, given.positions[[0, -1, -1]])
    assert not found.velocities.any() and not found.angular_velocities.any()


def test_a_scene_keeps_it_to_the_bit() -> None:
    scene = Scene(surfaces=(Plane(), Plane(length_x=1.0, plan=plan())))
    read = Scene.from_mapping(json.loads(json.dumps(scene.to_mapping())))
    assert read == scene and read.surfaces[1].plan == plan()
    assert 'plan' not in scene.to_mapping()['surfaces'][0]
    assert scene.surfaces[1].changes_place and scene.surfaces[1].moves
    assert scene.surfaces[1].at_rest() == Plane(length_x=1.0)
    assert scene.of_fixed_surfaces().surfaces == (Plane(),)


def test_in_other_units_it_is_the_same_motion() -> None:
    scene = Scene(surfaces=(Plane(plan=plan()),), radius=0.02, gravity=(0.0, 3.0, 0.0))
    similarity, similar = in_units(scene, ModelUnits(1.0, 9.81, 0.1))
    times = np.linspace(0.0, 1.0, 7)
    found, own = similar.surfaces[0].plan, plan().at(times)
    assert found is not None
    scaled = found.at(times / similarity.time)
    turn = similarity.rotation
    np.testing.assert_allclose(
        scaled.positions, own.positions @ turn.T / similarity.length, atol=1e-10
    )
    np.testing.assert_allclose(
        scaled.angular_velocities, own.angular_velocities @ turn.T * similarity.time, atol=1e-12
    )
    matrices = Rotation.from_quat(scaled.quaternions).as_matrix()
    np.testing.assert_allclose(
        matrices, turn @ Rotation.from_quat(own.quaternions).as_matrix(), atol=1e-12
    )


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'times': (0.0,)}, 'less than two points'),
        ({'times': (0.0, 0.5, 0.4, 1.0)}, 'not finite, or fall'),
        ({'times': (0.0, 0.1, 0.2, np.nan)}, 'not finite, or fall'),
        ({'positions': ((0.0, 0.0, 0.0),)}, r'positions of a plan have shape \(1, 3\)'),
        ({'velocities': ((np.inf, 0.0, 0.0),) * 4}, 'velocities of a plan are not finite'),
        ({'quaternions': ((0.0, 0.0, 0.0, 2.0),) * 4}, 'not of length 1'),
    ],
)
def test_what_is_no_plan_is_named(change: dict[str, Any], message: str) -> None:
    with pytest.raises(UserError, match=message):
        replace(plan(), **change)
