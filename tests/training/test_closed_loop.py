# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Training in closed loop: rollouts with gradients, what is lost, and the curriculum."""

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core.gns.config import GNSConfig
from rigid_gns_core.gns.features import GraphBatch
from rigid_gns_core.gns.network import GNS
from rigid_gns_core.gns.stepper import GNSStepper
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.similarity import ModelUnits
from rigid_gns_core.scenes.state import rotation_between, State, Trajectory
from rigid_gns_core.training.gns.closed_loop import roll_out
from rigid_gns_core.training.gns.learner import GNSLearner, GNSTrainConfig
from rigid_gns_core.training.gns.windows import Draw, Noise, Source, stack_windows
import torch

DT = 0.1
SCENE = Scene(surfaces=Plane.box(12.0, 12.0))
MODEL = GNSConfig(message_passing_steps=2, width=16)
UNITS = ModelUnits(radius=1.0, gravity=9.81, dt=DT)
CONFIG = GNSTrainConfig(model=MODEL, batch=4, steps=10, closed_loop_steps=3)


def source(seed=0, count=5, steps=12, scene=SCENE):
    """Spheres on straight ways, which turn."""
    rng = np.random.default_rng(seed)
    time = (np.arange(steps + 1) * DT)[:, None, None]
    velocity, spin = rng.normal(size=(2, count, 3))
    positions = rng.uniform(-4, 4, (count, 3)) + [0, 0, 6] + time * velocity
    speed = np.linalg.norm(spin, axis=1, keepdims=True)
    half = 0.5 * time * speed
    quaternions = np.concatenate([np.sin(half) * spin / speed, np.cos(half)], axis=-1)
    full = np.ones_like(time)
    trajectory = Trajectory(
        positions=positions,
        quaternions=quaternions,
        velocities=full * velocity,
        angular_velocities=full * spin,
        dt=DT,
    )
    return Source.of(trajectory, scene)


def network(config=MODEL, seed=0):
    torch.manual_seed(seed)
    made = GNS(config)
    made.target_normaliser.fit(torch.zeros(6), torch.full((6,), 2.0))
    return made


def frames(net, sources, draws, steps, corrects_target=False):
    windows = stack_windows(
        sources, draws, net.config, steps, corrects_target, torch.device('cpu')
    )
    return windows, list(roll_out(net, windows, corrects_target))


def plain(source=0, step=3, **changes):
    return Draw(source, step, None, None, None)._replace(**changes)


@pytest.mark.parametrize('target', ['velocity', 'acceleration'])
def test_the_closed_loop_is_a_rollout(target):
    net = network(replace(MODEL, target=target))
    own = source()
    with torch.no_grad():
        windows, steps = frames(net, [own], [plain(step=0, known=0)], 4)
        stepper = GNSStepper(net, SCENE, State(positions=own.positions[0]), DT)
        stepper.motion = own.motion(0, 2, 0)
        for step in steps:
            np.testing.assert_allclose(
                step.batch.graph.nodes[:, :3], stepper.motion.velocities[0], atol=1e-5
            )
            stepper.step()
    assert len(steps) == 4
    assert windows.targets.shape == (4, 5, 6)


def test_turned_windows_are_windows_of_the_turned_world():
    net = network()
    own = source()
    angle = 0.8
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    planes = tuple(
        replace(
            plane,
            point=tuple(turn @ plane.point),
            normal=tuple(turn @ plane.normal),
            direction=tuple(turn @ plane.axes[0]),
        )
        for plane in SCENE.surfaces
    )
    other = replace(
        own,
        scene=replace(SCENE, surfaces=planes),
        positions=own.positions @ turn.T,
        velocities=own.velocities @ turn.T,
        angular_velocities=own.angular_velocities @ turn.T,
    )
    with torch.no_grad():
        _, one = frames(net, [own], [plain(angle=angle)], 3, True)
        _, two = frames(net, [other], [plain()], 3, True)
    for a, b in zip(one, two, strict=True):
        # angles and features in float32, three steps of predicted speeds of order one
        torch.testing.assert_close(a.output, b.output, rtol=0, atol=2e-5)
        torch.testing.assert_close(a.batch.next_motion, b.batch.next_motion, rtol=0, atol=1e-4)


@pytest.mark.parametrize('corrects', [False, True])
def test_one_step_is_the_loss_of_the_thesis(corrects):
    config = replace(
        CONFIG,
        closed_loop_steps=1,
        noise=Noise(0.02, corrects),
        energy_weight=0.1,
        start_fraction=0.5,
        rotate=False,
    )
    sources = [source(seed, count) for seed, count in ((0, 5), (1, 9))]
    learner = GNSLearner(config, sources, UNITS)
    draws = learner.draw(0, 6, config.noise)
    errors, gains = [], []
    for draw in draws:
        own = sources[draw.source]
        motion = draw.shifts(own.motion(draw.step, MODEL.history, draw.known))
        graph = GraphBatch([SCENE], [own.count], MODEL, DT, torch.device('cpu')).features(motion)
        there = draw.step + 1
        velocity, spin = own.velocities[there], own.angular_velocities[there]
        if corrects:
            velocity = (own.positions[there] - motion.positions.numpy()) / DT
            spin = rotation_between(motion.quaternions.numpy(), own.quaternions[there]) / DT
        with torch.no_grad():
            output = learner.network(graph)
            normalise = learner.network.target_normaliser
            target = normalise(torch.from_numpy(np.concatenate([velocity, spin], 1)).float())
            v = normalise.inverse(output)[:, :3].double().numpy()
        errors.append((output - target).square())
        # E[k+1] - E[k] per sphere of 1 kg and in units of m g r
        kinetic = 0.5 * ((v**2).sum(1) - (motion.velocities[0].numpy() ** 2).sum(1))
        gains.append(max((kinetic + 9.81 * DT * v[:, 2]).mean(), 0.0) / 9.81)
    error, gain = learner.loss_terms(draws)
    # float32 sums
    assert error.item() == pytest.approx(torch.cat(errors).mean().item(), rel=1e-5)
    assert gain.item() == pytest.approx(0.1 * np.mean(gains), rel=1e-4, abs=1e-6)


def test_corrected_targets_lead_from_the_predicted_to_the_true_pose():
    net, own = network(), source()
    with torch.no_grad():
        windows, steps = frames(net, [own], [plain()], 3, True)
        predicted = windows.start.positions
        for k, step in enumerate(steps):
            reached = predicted + DT * step.batch.next_motion[:, :3].double()
            # float32 of velocities up to 10 m/s, times dt
            torch.testing.assert_close(reached, windows.positions[k], rtol=0, atol=1e-6)
            predicted = predicted + DT * net.decode(step.output, step.batch.graph.motion)[:, :3]


def test_gradients_run_through_all_steps():
    net, own = network(), source()
    _, steps = frames(net, [own], [plain()], 3)
    (start,) = torch.autograd.grad(steps[2].output.sum(), steps[0].output, retain_graph=True)
    assert start.abs().max() > 1e-3
    _, corrected = frames(net, [own], [plain()], 2, True)
    # the way back from what was predicted: the target of step 2 moves with the output of step 1
    (start,) = torch.autograd.grad(corrected[1].batch.next_motion[:, 0].sum(), corrected[0].output)
    torch.testing.assert_close(start[:, 0], torch.full((5,), -2.0))  # - scale of the target


def test_lost_spheres_no_longer_count():
    net, own = network(), source()
    with torch.no_grad():
        net.decoder.last.weight.zero_()
        net.decoder.last.bias.zero_()
    positions = np.repeat(own.positions[:1], len(own.positions), axis=0)
    positions[:, 2, 0] += 0.3 * np.arange(len(positions))  # radii a step
    positions[2, 3, 1] += 0.6  # back in time, but lost is lost
    moved = replace(own, positions=positions)
    with torch.no_grad():
        _, steps = frames(net, [moved], [plain(step=0)], 4)
    every, lost = [True] * 5, [True, True, False, False, True]
    assert [step.counted.tolist() for step in steps] == [every, every, lost, lost]


def test_the_loss_falls_along_its_gradient_and_follows_from_the_seed():
    config = replace(CONFIG, noise=Noise(0.005, True), energy_weight=0.01)
    learner, twin = (GNSLearner(config, [source(0), source(1)], UNITS) for _ in range(2))
    assert learner.advance() == twin.advance()
    before = learner.loss_at(5)
    gradients = torch.autograd.grad(before, learner.parameters)
    with torch.no_grad():
        for parameter, gradient in zip(learner.parameters, gradients, strict=True):
            parameter -= 1e-3 * gradient
        assert learner.loss_at(5) < before
        assert twin.loss_at(5) == before


def test_what_diverges_is_named():
    net = network()
    with torch.no_grad():
        net.decoder.last.bias.fill_(float('inf'))
    with pytest.raises(FloatingPointError, match='closed_loop_steps 1 first'):
        frames(net, [source()], [plain()], 2)


def test_the_curriculum_grows_from_the_fewest_spheres_to_all():
    config = replace(CONFIG, curriculum=0.5, steps=100, batch=64)
    sources = [source(seed, count) for seed, count in enumerate((20, 2, 11))]
    learner = GNSLearner(config, sources, UNITS)
    drawn = {
        step: {sources[d.source].count for d in learner.draw(step, 64, config.noise)}
        for step in (0, 24, 25, 49, 50, 99)
    }
    few, some, every = {2}, {2, 11}, {2, 11, 20}
    assert drawn == {0: few, 24: few, 25: some, 49: some, 50: every, 99: every}


def test_windows_end_before_their_trajectory_does():
    learner = GNSLearner(CONFIG, [source(steps=4), source(steps=2)], UNITS)
    draws = learner.draw(0, 200, CONFIG.noise)
    assert {(d.source, d.step) for d in draws} == {(0, 0), (0, 1)}


def test_trajectories_that_are_too_short_are_named():
    with pytest.raises(ValueError, match='3 steps .closed_loop_steps., the longest has 2'):
        GNSLearner(CONFIG, [source(steps=2)], UNITS)


@pytest.mark.parametrize(
    ('name', 'value', 'bound'),
    [
        ('closed_loop_steps', 0, 'at least 1'),
        ('curriculum', -0.1, 'at least 0'),
        ('curriculum', 1.5, 'at most 1'),
    ],
)
def test_values_out_of_range_are_named(name, value, bound):
    with pytest.raises(ValueError, match=f'{name} is {value}, expected {bound}'):
        replace(CONFIG, **{name: value})
