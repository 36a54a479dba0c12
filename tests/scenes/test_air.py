# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Air: its values, the law of flight, its mapping and its scaling."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
from numpy.testing import assert_allclose
import pytest
from rigid_gns_core import Air, Scene, UserError
from rigid_gns_core.kernels.flight import acceleration, flight_at
from rigid_gns_core.kernels.vector import row
from rigid_gns_core.scenes.similarity import in_units, ModelUnits

EXACT = 1e-13  # a handful of roundings, relative
BALL = Scene(
    radius=0.02,
    mass=0.0027,
    air=Air(1.2, 0.4, 0.3, 0.37, 0.25, wind=(1.0, -2.0, 0.5), spin_decay=0.1),
)


@numba.njit(error_model='numpy')
def compiled_law(velocities: np.ndarray, spins: np.ndarray, rows: np.ndarray) -> tuple:
    """Way into the compiled law, which Python itself must not call."""
    return acceleration(row(velocities, 0), row(spins, 0), flight_at(rows, 0))


def accelerate(scene: Scene, velocity: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """Acceleration of the one sphere of a scene."""
    assert scene.air
    radius, mass = scene.per_sphere('radius', 1), scene.per_sphere('mass', 1)
    rows = scene.air.flight(radius, mass, scene.gravity)
    return np.array(compiled_law(velocity[None], spin[None], rows))


def textbook(scene: Scene, velocity: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """Acceleration as the law is written in `Air`."""
    air, r, m = scene.air, scene.radius, scene.mass
    assert air
    volume, area, u = 4 / 3 * np.pi * r**3, np.pi * r**2, velocity - air.wind
    size, turning = np.linalg.norm(u), np.cross(spin, u)
    ratio = r * np.linalg.norm(turning) / size**2
    drag = air.drag_coefficient + air.drag_slope * ratio
    lift = air.lift_coefficient * ratio / (ratio + air.lift_half_ratio)
    force = (m - air.density * volume) * np.array(scene.gravity)
    force -= air.density * area / 2 * drag * size * u
    force += air.density * area / 2 * lift * size**2 * turning / np.linalg.norm(turning)
    return force / (m + air.density * volume / 2)


@pytest.mark.parametrize('seed', range(5))
def test_law_of_flight_as_written(seed: int) -> None:
    generator = np.random.default_rng(seed)
    velocity, spin = generator.normal(size=3) * 10, generator.normal(size=3) * 300
    assert_allclose(accelerate(BALL, velocity, spin), textbook(BALL, velocity, spin), rtol=1e-12)


def test_topspin_pulls_down() -> None:
    scene = replace(BALL, air=replace(BALL.air, wind=(0.0, 0.0, 0.0)))
    still = accelerate(scene, np.array([10.0, 0, 0]), np.zeros(3))
    topspin = accelerate(scene, np.array([10.0, 0, 0]), np.array([0.0, 300, 0]))
    assert topspin[2] < still[2] - 1


def test_what_rests_in_the_air_has_weight_and_buoyancy_only() -> None:
    scene = replace(BALL, air=replace(BALL.air, wind=(0.0, 0.0, 0.0)))
    part = 1.2 * 4 / 3 * np.pi * 0.02**3 / 0.0027
    expected = [0.0, 0.0, -9.81 * (1 - part) / (1 + part / 2)]
    for spin in (np.zeros(3), np.array([5.0, 0.0, 0.0])):
        assert_allclose(accelerate(scene, np.zeros(3), spin), expected, rtol=EXACT)
    # spin along the velocity lifts nothing, and gives no 0 / 0
    along = accelerate(scene, np.array([7.0, 0, 0]), np.array([9.0, 0, 0]))
    assert_allclose(along[1:], expected[1:], rtol=EXACT)


def test_air_of_no_density_is_a_vacuum() -> None:
    scene = Scene(air=Air(density=0.0, lift_coefficient=0.4, wind=(9.0, 0.0, 0.0)))
    found = accelerate(scene, np.array([3.0, 1, 0]), np.array([0.0, 5, 1]))
    assert_allclose(found, scene.gravity, rtol=EXACT)


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        ({'density': -1.0}, 'density of the air is -1, expected at least 0'),
        ({'lift_half_ratio': 0.0}, 'lift_half_ratio of the air is 0, expected greater than 0'),
        ({'drag_coefficient': 'a lot'}, "drag_coefficient of the air is 'a lot'"),
        ({'wind': (1.0, 2.0)}, 'wind is .*, expected three finite numbers'),
        ({'spin_decay': np.nan}, 'spin_decay of the air is nan'),
        ({'crisis_speed': 0.0}, 'crisis_speed of the air is 0, expected greater than 0'),
        ({'drag_drop': 0.5}, 'drag_drop of the air is 0.5, expected at most its drag_coeff'),
    ],
)
def test_bad_air_is_refused(values: dict, message: str) -> None:
    with pytest.raises(UserError, match=message):
        Air(**values)


def test_air_that_is_none_of_ours_is_refused() -> None:
    with pytest.raises(UserError, match='air is 1.2, expected Air'):
        Scene(air=1.2)


def test_a_scene_in_air_is_read_back_to_the_bit() -> None:
    scene = replace(BALL, air=replace(BALL.air, density=1.2 + 1e-15, wind=(0.1, 0.2, 1 / 3)))
    assert Scene.from_mapping(scene.to_mapping()) == scene
    assert 'drag_drop' not in scene.to_mapping()['air']
    scene = replace(scene, air=replace(scene.air, drag_drop=0.3, crisis_speed=1 / 3))
    assert Scene.from_mapping(scene.to_mapping()) == scene
    assert 'air' not in Scene().to_mapping()
    assert Scene.from_mapping({'air': {}}).air == Air()


def test_air_in_the_units_of_a_model() -> None:
    air = replace(BALL.air, drag_drop=0.2, crisis_speed=8.0)
    scene = replace(BALL, gravity=(3.0, 1.0, -8.0), air=air)
    similarity, scaled = in_units(scene, ModelUnits(1.0, 9.81, 0.1))
    velocity, spin = np.array([8.0, -3.0, 2.0]), np.array([100.0, 20.0, -60.0])
    turn, length, time = similarity.rotation, similarity.length, similarity.time
    there = accelerate(scaled, turn @ velocity * (time / length), turn @ spin * time)
    expected = turn @ accelerate(scene, velocity, spin) * (time**2 / length)
    assert_allclose(there, expected, rtol=1e-12)
    assert scaled.air.spin_decay == pytest.approx(0.1 * time)
