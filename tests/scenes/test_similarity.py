# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Dynamic similarity: other radii, gravities and directions of gravity are the same model."""

import numpy as np
import pytest
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.similarity import ModelUnits, Similarity
from rigid_gns_core.scenes.state import State

UNITS = ModelUnits(radius=1.0, gravity=9.81, dt=0.1)


def some_state(count=5):
    rng = np.random.default_rng(0)
    return State(
        positions=rng.normal(size=(count, 3)),
        quaternions=rng.normal(size=(count, 4)),
        velocities=rng.normal(size=(count, 3)),
        angular_velocities=rng.normal(size=(count, 3)),
    )


@pytest.mark.parametrize(
    'gravity',
    [(0.0, 0.0, -9.81), (0.0, 0.0, -1.62), (3.0, -2.0, -9.0), (0.0, 0.0, 9.81), (9.81, 0.0, 0.0)],
)
def test_to_world_is_the_inverse_of_to_model(gravity):
    scene = Scene(radius=0.02, gravity=gravity)
    similarity = Similarity.between(scene, UNITS)
    state = some_state()
    back = similarity.to_world(similarity.to_model(state))
    for name in ('positions', 'velocities', 'angular_velocities'):
        np.testing.assert_allclose(getattr(back, name), getattr(state, name), atol=1e-14)
    same = np.abs(np.einsum('ij,ij->i', back.quaternions, state.quaternions))
    np.testing.assert_allclose(same, 1.0, atol=1e-14)
    np.testing.assert_allclose(similarity.scene(scene).gravity, (0, 0, -9.81), atol=1e-13)
    assert similarity.scene(scene).radius == pytest.approx(1.0, abs=1e-15)


def test_a_table_tennis_ball_runs_at_71_hertz():
    time = Similarity.between(Scene(radius=0.02), UNITS).time
    assert 1 / (UNITS.dt * time) == pytest.approx(10 / np.sqrt(0.02))  # 70.7 Hz


def test_free_fall_looks_the_same_in_model_units():
    scene = Scene(radius=0.02, gravity=(0.0, 0.0, -3.7))
    similarity = Similarity.between(scene, UNITS)
    state = similarity.to_model(State(positions=[[0, 0, 1.0]], velocities=[[0, 0, 2.0]]))
    time = 0.3
    height = 1.0 + 2.0 * time - 0.5 * 3.7 * time**2
    model_time = time / similarity.time
    expected = (
        state.positions[0, 2] + state.velocities[0, 2] * model_time - 0.5 * 9.81 * model_time**2
    )
    assert height / similarity.length == pytest.approx(expected, rel=1e-12)


def test_surfaces_turn_with_gravity():
    tilted = Scene(
        surfaces=(Plane((1.0, 0, 0), (-1.0, 0, 0), (0, 1.0, 0), 6.0, 8.0),),
        gravity=(9.81, 0.0, 0.0),
        radius=0.5,
    )
    plane = Similarity.between(tilted, UNITS).scene(tilted).surfaces[0]
    np.testing.assert_allclose(plane.normal, (0, 0, 1), atol=1e-15)
    np.testing.assert_allclose(plane.point, (0, 0, -2.0), atol=1e-15)
    assert (plane.length_x, plane.length_y) == (12.0, 16.0)


def test_without_gravity_time_is_that_of_the_units():
    still = Scene(gravity=(0.0, 0.0, 0.0), radius=4.0)
    assert Similarity.between(still, UNITS).time == pytest.approx(2.0)
