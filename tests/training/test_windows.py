# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Training windows: differences, noise, history at a start, and turning about gravity."""

import numpy as np
import pytest
from rigid_gns_core.gns.config import GNSConfig
from rigid_gns_core.gns.motion import difference, integrate
from rigid_gns_core.gns.network import GNS
from rigid_gns_core.gns.stepper import backward_velocities
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.state import State, Trajectory
from rigid_gns_core.training.gns.closed_loop import batch_of, rotate_batch
from rigid_gns_core.training.gns.windows import Draw, draw_windows, Noise, Source, stack_windows
import torch

CONFIG = GNSConfig(message_passing_steps=1, width=8)
SILENT = Noise(std=0.0)
GRAVITY = np.array([0.0, 0.0, -9.81])
DT = 0.1


def ballistic(steps=20, count=4, seed=0):
    rng = np.random.default_rng(seed)
    start = rng.uniform(-5, 5, (count, 3)) + [0, 0, 60]
    velocity = rng.normal(size=(count, 3)) * 4
    spin = rng.normal(size=(count, 3)) * 3
    time = (np.arange(steps + 1) * DT)[:, None, None]
    positions = start + velocity * time + 0.5 * GRAVITY * time**2
    angle = np.linalg.norm(spin, axis=1, keepdims=True) * time[..., 0][..., None]
    axis = spin / np.linalg.norm(spin, axis=1, keepdims=True)
    quaternions = np.concatenate([np.sin(angle / 2) * axis, np.cos(angle / 2)], axis=-1)
    return Trajectory(
        positions=positions,
        quaternions=quaternions,
        velocities=velocity + GRAVITY * time,
        angular_velocities=np.broadcast_to(spin, positions.shape),
        dt=DT,
    )


def one_step_batch(sources, draws, config, corrects):
    windows = stack_windows(sources, draws, config, 1, corrects, torch.device('cpu'))
    return batch_of(windows, 0, windows.start, corrects)


def draw_batch(sources, size, config, noise, rng, **options):
    draws = draw_windows(sources, size, config, noise, rng, **options)
    return one_step_batch(sources, draws, config, noise.corrects_target)


def test_integrate_is_the_inverse_of_difference():
    trajectory = ballistic()
    for step in range(trajectory.steps):
        here, there = trajectory[step], trajectory[step + 1]
        before, after = (
            (torch.from_numpy(state.positions), torch.from_numpy(state.quaternions))
            for state in (here, there)
        )
        velocity, angular = difference(*before, *after, DT)
        positions, quaternions = (x.numpy() for x in integrate(*before, velocity, angular, DT))
        # float64: a few roundings of values near 60
        np.testing.assert_allclose(positions, there.positions, atol=1e-13)
        same = np.abs(np.einsum('ij,ij->i', quaternions, there.quaternions))
        np.testing.assert_allclose(same, 1.0, atol=1e-13)
        np.testing.assert_allclose(angular, here.angular_velocities, atol=1e-11)


def test_rotation_is_exact_where_the_first_order_form_is_not():
    still = torch.zeros(1, 3, dtype=torch.float64)
    quaternion, spin = (
        torch.tensor([values], dtype=torch.float64) for values in ([0, 0, 0, 1], [20, 0, 0])
    )
    _, turned = integrate(still, quaternion, still, spin, DT)
    assert 2 * torch.atan2(turned[0, 0], turned[0, 3]).item() == pytest.approx(2.0, abs=1e-12)


def test_velocities_are_differences_of_poses_alone():
    trajectory = ballistic()
    source = Source.of(trajectory, Scene())
    expected = np.diff(trajectory.positions, axis=0) / DT
    np.testing.assert_allclose(source.velocities[1:], expected, atol=1e-12)
    np.testing.assert_allclose(
        source.angular_velocities, trajectory.angular_velocities, atol=1e-10
    )
    # the difference that would have come before the first frame, known from v: free flight
    np.testing.assert_allclose(
        source.velocities[0], trajectory.velocities[0] - 0.5 * DT * GRAVITY, atol=1e-12
    )


def test_a_resting_sphere_starts_at_rest_and_a_flying_one_does_not():
    state = State(positions=[[0, 0, 1.0], [5.0, 0, 1.0], [7.0, 0, 1.0], [0, 0, 9.0]])
    velocity = backward_velocities(state, Scene(), DT)
    np.testing.assert_allclose(velocity[:3], 0.0)
    np.testing.assert_allclose(velocity[3], [0, 0, 0.4905])


def test_history_is_newest_first_and_repeats_its_oldest_where_it_ends():
    source = Source.of(ballistic(), Scene())
    np.testing.assert_array_equal(source.motion(5, 2).velocities, source.velocities[[5, 4, 3]])
    np.testing.assert_array_equal(source.motion(1, 2).velocities, source.velocities[[1, 0, 0]])
    np.testing.assert_array_equal(
        source.motion(5, 2, known=0).velocities, source.velocities[[5, 5, 5]]
    )


def test_noise_has_the_stated_size_and_leaves_the_target():
    source = Source.of(ballistic(count=400), Scene(surfaces=()))
    rng = np.random.default_rng(1)
    draw = Draw(0, 5, None, None, None)
    noise = Noise(0.05).draw(400, CONFIG.history, 1.0, rng)
    clean = one_step_batch([source], [draw], CONFIG, False)
    noisy = one_step_batch([source], [draw._replace(shifts=noise)], CONFIG, False)
    torch.testing.assert_close(noisy.next_motion, clean.next_motion, rtol=0, atol=0)
    spread = (noisy.graph.nodes - clean.graph.nodes).std().item()
    # 7200 draws: the standard error of a standard deviation is 0.05 / sqrt(14400) = 0.0004
    assert spread == pytest.approx(0.05, abs=0.002)


def test_corrected_target_leads_from_the_noisy_to_the_true_pose():
    source = Source.of(ballistic(), Scene(surfaces=()))
    noise = Noise(0.05).draw(4, CONFIG.history, 1.0, np.random.default_rng(2))
    batch = one_step_batch([source], [Draw(0, 5, None, noise, None)], CONFIG, True)
    start = source.positions[5] + noise.positions
    assert np.abs(noise.positions).max() > 0.02
    np.testing.assert_allclose(
        start + DT * batch.next_motion[:, :3].numpy(), source.positions[6], atol=1e-5
    )


def test_batches_follow_from_the_generator():
    sources = [Source.of(ballistic(seed=s), Scene()) for s in range(3)]
    first, second = (
        draw_batch(sources, 6, CONFIG, Noise(), np.random.default_rng(5), start_fraction=0.5)
        for _ in range(2)
    )
    torch.testing.assert_close(first.graph.nodes, second.graph.nodes, rtol=0, atol=0)
    assert first.windows == 6
    assert torch.bincount(first.owner).tolist() == [4] * 6


def test_turned_batch_is_the_batch_of_the_turned_world():
    scene = Scene(surfaces=Plane.box(30.0, 30.0))
    trajectory = ballistic()
    angle = 0.7
    cosine, sine = np.cos(angle), np.sin(angle)
    matrix = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    batch = draw_batch([Source.of(trajectory, scene)], 1, CONFIG, SILENT, np.random.default_rng(0))
    turned = rotate_batch(batch, torch.tensor([angle]), CONFIG)
    nodes = batch.graph.nodes.numpy().reshape(4, 6, 3) @ matrix.T
    np.testing.assert_allclose(turned.graph.nodes.numpy(), nodes.reshape(4, 18), atol=1e-5)
    surface = batch.graph.surface_edges.numpy()
    expected = np.concatenate(
        [(surface[:, :9].reshape(-1, 3, 3) @ matrix.T).reshape(-1, 9), surface[:, 9:]], axis=1
    )
    np.testing.assert_allclose(turned.graph.surface_edges.numpy(), expected, atol=1e-4)
    targets = batch.next_motion.numpy().reshape(4, 2, 3) @ matrix.T
    np.testing.assert_allclose(turned.next_motion.numpy(), targets.reshape(4, 6), atol=1e-5)


def test_turning_needs_a_masked_pose():
    config = GNSConfig(message_passing_steps=1, width=8, mask_pose=False)
    source = Source.of(ballistic(), Scene())
    with pytest.raises(ValueError, match='mask_pose'):
        draw_batch([source], 1, config, SILENT, np.random.default_rng(0), rotate=True)
    assert GNS(config)(
        draw_batch([source], 1, config, SILENT, np.random.default_rng(0)).graph
    ).shape == (4, 6)
