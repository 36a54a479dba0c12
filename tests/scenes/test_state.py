# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""States, trajectories and rotations against closed forms."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose
import pytest
from rigid_gns_core import State, Trajectory
from rigid_gns_core.scenes.state import quaternion_multiply, rotate_quaternions, rotation_between


def quaternions(count: int, seed: int = 0) -> np.ndarray:
    values = np.random.default_rng(seed).normal(size=(count, 4))
    return values / np.linalg.norm(values, axis=1, keepdims=True)


def matrix(q: np.ndarray) -> np.ndarray:
    """Rotation matrix of one quaternion (x, y, z, w), from the textbook."""
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def trajectory(steps: int = 4, count: int = 2, dt: float = 0.1) -> Trajectory:
    generator = np.random.default_rng(0)
    return Trajectory(
        positions=generator.normal(size=(steps + 1, count, 3)),
        quaternions=quaternions((steps + 1) * count).reshape(steps + 1, count, 4),
        velocities=generator.normal(size=(steps + 1, count, 3)),
        angular_velocities=generator.normal(size=(steps + 1, count, 3)),
        dt=dt,
    )


def test_defaults_of_a_state() -> None:
    state = State(positions=np.zeros((3, 3)))
    assert len(state) == 3
    assert_allclose(state.quaternions, np.tile([0, 0, 0, 1], (3, 1)))
    assert not state.velocities.any()
    assert not state.angular_velocities.any()
    assert len(State(positions=np.zeros((0, 3)))) == 0


def test_state_copies_and_normalises() -> None:
    positions = np.zeros((1, 3))
    state = State(positions=positions, quaternions=np.array([[0.0, 0.0, 2.0, 0.0]]))
    positions += 1
    assert not state.positions.any()
    assert_allclose(state.quaternions, [[0, 0, 1, 0]])


@pytest.mark.parametrize(
    ('fields', 'message'),
    [
        ({'positions': np.zeros((2, 2))}, r'positions has shape \(2, 2\), expected \(2, 3\)'),
        ({'positions': 1.0}, 'positions has shape'),
        ({'positions': [[0, 0, 0], [0, np.nan, 0]]}, 'positions of sphere 1 is not finite'),
        (
            {'velocities': [[0, 0, 0], [0, -1e101, 0]]},
            r'velocities of sphere 1 holds -1e\+101, expected numbers of at most 1e\+100',
        ),
        ({'velocities': np.zeros((3, 3))}, r'velocities has shape \(3, 3\), expected \(2, 3\)'),
        ({'angular_velocities': [[0, 0, np.inf], [0, 0, 0]]}, 'angular_velocities of sphere 0'),
        ({'quaternions': [[0, 0, 0, 1], [0, 0, 0, 0]]}, 'quaternion of sphere 1 has norm 0'),
    ],
)
def test_bad_states(fields: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        State(**({'positions': np.zeros((2, 3))} | fields))


def test_trajectory_sizes_and_times() -> None:
    long = trajectory(steps=4, count=2, dt=0.25)
    assert (long.steps, long.count, len(long)) == (4, 2, 5)
    assert_allclose(long.times, [0, 0.25, 0.5, 0.75, 1.0])
    part = long.window(1, 3)
    assert_allclose(part.positions, long.positions[1:3])
    assert part.dt == long.dt
    assert_allclose(long[2].velocities, long.velocities[2])


def test_states_and_back() -> None:
    one = trajectory()
    again = Trajectory.from_states(list(one), one.dt)
    for name in ('positions', 'quaternions', 'velocities', 'angular_velocities'):
        # a State normalises its quaternions once more
        assert_allclose(getattr(again, name), getattr(one, name), rtol=1e-15, atol=1e-15)


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'positions': np.zeros((5, 3))}, 'positions have shape'),
        ({'velocities': np.zeros((5, 2, 2))}, 'velocities have shape'),
        ({'dt': 0.0}, 'dt is 0.0, expected a positive'),
        ({'dt': np.nan}, 'dt is nan'),
    ],
)
def test_bad_trajectories(change: dict, message: str) -> None:
    one = trajectory()
    fields = {
        name: getattr(one, name)
        for name in ('positions', 'quaternions', 'velocities', 'angular_velocities', 'dt')
    }
    with pytest.raises(ValueError, match=message):
        Trajectory(**(fields | change))


def test_divergence_is_found() -> None:
    one = trajectory()
    assert one.diverged_at is None
    one.velocities[3, 1, 0] = np.nan
    one.positions[4, 0, 0] = np.inf
    assert one.diverged_at == 3


def test_product_is_composition() -> None:
    a, b = quaternions(2)
    assert_allclose(matrix(quaternion_multiply(a, b)), matrix(a) @ matrix(b), atol=1e-14)


@pytest.mark.parametrize('angle', [0.0, 1e-14, 1e-9, 1e-3, 1.0, 3.0, np.pi - 1e-6])
def test_rotation_there_and_back(angle: float) -> None:
    axis = np.array([1.0, -2.0, 0.5]) / np.linalg.norm([1.0, -2.0, 0.5])
    before = quaternions(8)
    after = rotate_quaternions(before, angle * axis)
    assert_allclose(np.linalg.norm(after, axis=1), 1.0, rtol=1e-15)
    found = rotation_between(before, after)
    assert_allclose(found, np.tile(angle * axis, (8, 1)), rtol=1e-9, atol=1e-15)
    # q and -q are one rotation
    assert_allclose(rotation_between(before, -after), found, atol=1e-15)


def test_rotation_is_in_the_world_frame() -> None:
    before = quaternions(1)
    turned = rotate_quaternions(before, np.array([0.0, 0.0, np.pi / 2]))
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert_allclose(matrix(turned[0]), quarter @ matrix(before[0]), atol=1e-15)


def test_velocities_from_poses() -> None:
    """Constant velocity and spin come back exactly; thesis section 3.3."""
    dt, velocity, spin = 0.1, np.array([1.0, -2.0, 3.0]), np.array([4.0, 0.0, -6.0])
    times = np.arange(6) * dt
    positions = times[:, None, None] * velocity + np.ones((1, 2, 3))
    rotations = np.stack([rotate_quaternions(quaternions(2), spin * time) for time in times])
    made = Trajectory.from_poses(positions, rotations, dt)
    assert_allclose(made.velocities, np.broadcast_to(velocity, (6, 2, 3)), rtol=1e-12)
    assert_allclose(made.angular_velocities, np.broadcast_to(spin, (6, 2, 3)), atol=1e-12)


def test_velocities_from_one_pose_are_zero() -> None:
    made = Trajectory.from_poses(np.ones((1, 2, 3)), quaternions(2)[None], 0.1)
    assert not made.velocities.any()
    assert not made.angular_velocities.any()
