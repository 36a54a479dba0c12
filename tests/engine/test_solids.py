# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Obstacles where closed forms do not reach: fast spheres, heaps, air, other units."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rigid_gns_core import Air, load_simulator, Obstacle, Plane, Scene, Simulator, State
from rigid_gns_core.engine.stepper import EngineStepper

LYING: dict[str, Any] = {'axis': (0.3, 0.1, 1.0)}
SHAPES = (
    Obstacle('sphere', radius=1.5),
    Obstacle('box', size=(2.0, 1.5, 1.0), **LYING),
    Obstacle('cylinder', radius=1.2, length=1.5, **LYING),
    Obstacle('ring', radius=1.2, thickness=0.1, **LYING),
    Obstacle('ring', radius=2.0, **LYING),
    Obstacle('tube', radius=2.0, length=2.0, **LYING),
)


@pytest.fixture(scope='module')
def laws() -> Simulator:
    return load_simulator('laws')


def heap(obstacle: Obstacle) -> Scene:
    return Scene(surfaces=Plane.box(8.0, 8.0), obstacles=(obstacle,), radius=0.4)


@pytest.mark.parametrize('shape', SHAPES, ids=lambda o: o.shape)
def test_a_fast_sphere_never_passes(shape: Obstacle) -> None:
    """Whatever its speed, a sphere whose path leads within its radius of the body is deflected."""
    laws, rng = load_simulator('laws', substeps=1), np.random.default_rng(0)
    for _ in range(40):
        start = 3.0 * rng.normal(size=(1, 3))
        distance, normal = shape.closest(start)
        if distance[0] < 1.1:
            continue
        # past the closest point, nearer than its radius
        side = np.cross(rng.normal(size=3), normal[0])
        aside = 0.9 * rng.random() * side / np.linalg.norm(side)
        target = start[0] - distance[0] * normal[0] + aside
        velocity = (target - start[0]) * 10.0 ** rng.uniform(1.0, 4.0)
        scene = Scene(surfaces=(), obstacles=(shape,), gravity=0.0, radius=1.0)
        run = laws.rollout(scene, start, velocity[None], steps=2)
        assert np.linalg.norm(run.velocities[-1, 0] - velocity) > 1e-6 * np.linalg.norm(velocity)
        assert shape.closest(run.positions[:, 0])[0].min() > 1.0 - 1e-6


@pytest.mark.parametrize('shape', SHAPES, ids=lambda o: o.shape)
def test_a_heap_on_it_keeps_out_and_loses_energy(laws: Simulator, shape: Obstacle) -> None:
    grid = np.stack(np.meshgrid(*[np.linspace(-1.8, 1.8, 5)] * 2, [3.0, 4.0]), axis=-1)
    places = grid.reshape(-1, 3) + np.random.default_rng(1).uniform(-0.02, 0.02, (50, 3))
    run = laws.rollout(heap(shape), places, steps=150)
    kinetic = 0.5 * np.sum(run.velocities**2, axis=2)
    kinetic += 0.2 * 0.4**2 * np.sum(run.angular_velocities**2, axis=2)
    energy = (kinetic + 9.81 * run.positions[..., 2]).sum(axis=1)
    assert np.diff(energy).max() < 1e-9 * energy[0]
    depth = np.array([shape.closest(frame)[0].min() for frame in run.positions]) - 0.4
    assert depth.min() > -0.02 * 0.4  # that of spheres pressed by others
    assert kinetic[-1].mean() < 0.3  # they come to rest


@pytest.mark.parametrize('shape', SHAPES, ids=lambda o: o.shape)
def test_laws_alone_give_no_energy(shape: Obstacle) -> None:
    """Without the guard, also where a sphere rocks in a ring or rolls over rims."""
    scene = Scene(surfaces=(), obstacles=(shape,), rolling_friction=0.0, friction=1.0)
    for seed in range(6):
        rng = np.random.default_rng(seed)
        now = State(
            positions=np.append(rng.uniform(-0.6, 0.6, 2), 4.0)[None],
            velocities=rng.normal(size=(1, 3)),
        )
        stepper = EngineStepper(scene, now, 0.1, substeps=8, rounds=20, guard=False, sleep=False)
        energies = []
        for _ in range(30):
            now = stepper.step()
            square = np.sum(now.velocities**2) + 0.4 * np.sum(now.angular_velocities**2)
            energies.append(0.5 * square + 9.81 * (now.positions[0, 2] + 3.0))
        assert np.diff(energies).max() < 1e-4 * energies[0]


def test_overlaps_at_the_start_are_undone(laws: Simulator) -> None:
    for shape in SHAPES:
        scene = Scene(surfaces=(), obstacles=(shape,), gravity=0.0, radius=0.5)
        place = np.array([[2.0, 1.0, 1.5]])
        distance, normal = shape.closest(place)
        place -= (distance - 0.2)[:, None] * normal
        run = laws.rollout(scene, place, steps=1)
        assert shape.closest(run.positions[-1])[0].min() > 0.5 - 1e-5
        assert np.abs(run.velocities).max() == 0.0


def test_in_air_a_blow_is_where_the_path_meets_it(laws: Simulator) -> None:
    air = Air(density=1.2, drag_coefficient=0.45, lift_coefficient=0.4)
    given: dict[str, Any] = {'radius': 0.02, 'mass': 0.0027, 'air': air, 'restitution': 0.9}
    start, velocity, spin = [(0.0, 0.0, 0.3)], [(4.0, 1.0, 1.0)], [(0.0, 100.0, 50.0)]
    free = laws.rollout(Scene(surfaces=(), **given), start, velocity, spin, steps=40)
    ball = Obstacle('sphere', tuple(free.positions[20, 0]), radius=0.05)
    met = laws.rollout(
        Scene(surfaces=(), obstacles=(ball,), **given), start, velocity, spin, steps=40
    )
    gaps = ball.closest(free.positions[:, 0])[0] - 0.02
    before = int(np.argmax(gaps < 0)) - 1
    assert np.abs(met.positions[:before, 0] - free.positions[:before, 0]).max() < 1e-6
    assert ball.closest(met.positions[:, 0])[0].min() > 0.02 - 1e-9
    assert np.abs(met.velocities[-1] - free.velocities[-1]).max() > 1.0


def test_scenes_without_obstacles_and_far_ones_are_the_same(laws: Simulator) -> None:
    rng = np.random.default_rng(2)
    places = rng.uniform(-3.0, 3.0, (12, 3)) + [0.0, 0.0, 5.0]
    far = Obstacle('ring', (0.0, 0.0, 500.0), radius=2.0)
    scene = Scene(surfaces=Plane.box(8.0, 8.0), radius=0.4)
    alone = laws.rollout(scene, places, steps=60)
    with_far = laws.rollout(
        Scene(surfaces=Plane.box(8.0, 8.0), radius=0.4, obstacles=(far,)), places, steps=60
    )
    assert alone.positions.tobytes() == with_far.positions.tobytes()
