# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Training on a device: what a window holds, and that nothing is made away from the device."""

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core.gns.config import GNSConfig
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.similarity import ModelUnits
from rigid_gns_core.scenes.state import rotate_quaternions, rotation_between, Trajectory
from rigid_gns_core.training.gns.learner import GNSLearner, GNSTrainConfig
from rigid_gns_core.training.gns.windows import draw_windows, Noise, Source, stack_windows
import torch

DT = 0.1
CPU = torch.device('cpu')
UNITS = ModelUnits(radius=1.0, gravity=9.81, dt=DT)
RAMP = Plane((1, 0, 4), (0, 0.6, 0.8), length_x=6.0, length_y=4.0)
SCENES = [
    Scene(surfaces=Plane.box(12.0, 12.0), radius=0.7),
    Scene(surfaces=(), radius=0.7),
    Scene(surfaces=(*Plane.box(9.0, 14.0, 5.0), RAMP), radius=0.7),
]
MODEL = GNSConfig(message_passing_steps=1, width=8)
TRAINING = GNSTrainConfig(
    model=replace(MODEL, message_passing_steps=2),
    batch=5,
    noise=Noise(0.01, True),
    energy_weight=0.1,
    start_fraction=0.3,
)


def source(seed, count, steps=10, scene=SCENES[0]):
    """Spheres that jitter, all of one radius."""
    rng = np.random.default_rng(seed)
    positions = rng.uniform(-4, 4, (1, count, 3)) + [0, 0, 5]
    positions = positions + np.cumsum(0.2 * rng.normal(size=(steps + 1, count, 3)), axis=0)
    turns = np.cumsum(rng.normal(size=positions.shape), axis=0) * 0.3
    identity = np.tile([0.0, 0, 0, 1], (steps + 1, count, 1))
    trajectory = Trajectory(
        positions=positions,
        quaternions=rotate_quaternions(identity, turns),
        velocities=np.gradient(positions, DT, axis=0),
        angular_velocities=rng.normal(size=positions.shape),
        dt=DT,
    )
    return Source.of(trajectory, scene)


def sources():
    return [source(0, 25), source(1, 40, scene=SCENES[2]), source(2, 3, steps=4, scene=SCENES[1])]


@pytest.mark.parametrize('corrects', [False, True])
@pytest.mark.parametrize(
    'switch', [{}, {'history': 0}, {'mask_pose': False, 'sphere_properties': True}], ids=str
)
def test_windows_hold_what_was_drawn(switch, corrects):
    config, own = replace(MODEL, **switch), sources()
    draws = draw_windows(
        own, 12, config, Noise(0.02), np.random.default_rng(0),
        start_fraction=0.5, rotate=config.mask_pose, steps=3,
    )  # fmt: skip
    windows = stack_windows(own, draws, config, 3, corrects, CPU)
    first = 0
    for k, (draw, scene) in enumerate(zip(draws, windows.graph.scenes, strict=True)):
        source, shifts = own[draw.source], draw.shifts
        spheres = slice(first, first + source.count)
        first += source.count
        assert scene is source.scene
        assert windows.graph.owner[spheres].tolist() == [k] * source.count
        start = source.positions[draw.step] + shifts.positions
        turn = rotate_quaternions(source.quaternions[draw.step], shifts.rotations)
        np.testing.assert_array_equal(windows.start.positions[spheres], start)
        np.testing.assert_allclose(windows.start.quaternions[spheres], turn, atol=1e-14)
        known = config.history if draw.known is None else draw.known
        for h in range(config.history + 1):
            then = max(draw.step - min(h, known), 0)
            for name in ('velocities', 'angular_velocities'):
                expected = getattr(source, name)[then] + getattr(shifts, name)[h]
                np.testing.assert_array_equal(getattr(windows.start, name)[h, spheres], expected)
        for j in range(3):
            there = draw.step + 1 + j
            np.testing.assert_array_equal(windows.positions[j, spheres], source.positions[there])
            v, w = source.velocities[there], source.angular_velocities[there]
            if corrects and j == 0:
                v = (source.positions[there] - start) / DT
                w = rotation_between(turn, source.quaternions[there]) / DT
            # float64, of turns up to pi in 0.1 s
            np.testing.assert_allclose(
                windows.targets[j, spheres], np.concatenate([v, w], 1), rtol=0, atol=1e-11
            )
        properties = np.stack([scene.per_sphere(p, source.count) for p in ('radius', 'mass')], 1)
        np.testing.assert_array_equal(windows.graph.properties[spheres], properties)
    assert first == len(windows.start.positions)
    angles = None if windows.angles is None else windows.angles.tolist()
    assert angles == ([draw.angle for draw in draws] if config.mask_pose else None)


@pytest.mark.parametrize('steps', [1, 3])
def test_training_on_the_cpu_by_name_is_the_default(steps):
    config = replace(TRAINING, closed_loop_steps=steps)
    default, by_name = (GNSLearner(config, sources(), UNITS, device=d) for d in (None, CPU))
    for _ in range(3):
        assert by_name.advance() == default.advance()


@pytest.mark.parametrize('steps', [1, 2])
def test_every_tensor_is_on_the_device(steps):
    learner = GNSLearner(replace(TRAINING, closed_loop_steps=steps), sources(), UNITS)
    expected = learner.loss_at(0)
    with torch.device('meta'):  # what does not say where it belongs lands there, and fails
        assert learner.loss_at(0) == expected


@pytest.mark.skipif(not torch.cuda.is_available(), reason='needs a CUDA device')
def test_training_on_cuda_is_training():
    config = GNSTrainConfig(model=MODEL, batch=5, closed_loop_steps=2)
    arrays = GNSLearner(config, sources(), UNITS)
    device = GNSLearner(config, sources(), UNITS, device=torch.device('cuda'))
    for _ in range(3):
        assert device.advance() == pytest.approx(arrays.advance(), rel=1e-3)  # TF32 is off
    state = device.state()
    assert {value.device.type for value in state.values()} == {'cpu'}
    device.load_state(state)
    assert device.advance() == pytest.approx(arrays.advance(), rel=1e-3)
