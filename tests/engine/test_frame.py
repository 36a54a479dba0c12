# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""Frames of many spheres, whose candidates are looked for anew after a part of each."""

import numpy as np
from rigid_gns_core import load_simulator, Scene
from scipy.spatial import cKDTree


def test_many_spheres_miss_no_blow_and_keep_momentum():
    # 3000 pairs are within reach; one that flies through at ten times the speed of the others
    # strikes some far beyond what they could reach by themselves
    rng = np.random.default_rng(7)
    places = 2.2 * np.indices((10, 10, 10)).reshape(3, -1).T + rng.uniform(-0.09, 0.09, (1000, 3))
    velocities = rng.normal(0.0, 4.0, (1000, 3))
    places = np.concatenate([places, [[-4.0, 9.0, 10.1]]])
    velocities = np.concatenate([velocities, [[70.0, 0.0, 0.0]]])
    scene = Scene(surfaces=(), gravity=(0.0, 0.0, 0.0), restitution=0.9, friction=0.4)
    found = load_simulator('laws').rollout(scene, places, velocities, steps=6)
    momentum = found.velocities.sum(axis=1)
    # sums of 1001 velocities of up to 70 m/s, in other orders
    np.testing.assert_allclose(momentum, momentum[:1].repeat(7, 0), rtol=0, atol=1e-10)
    energy = 0.5 * (found.velocities**2).sum((1, 2)) + 0.2 * (found.angular_velocities**2).sum(
        (1, 2)
    )
    assert np.all(np.diff(energy) <= 1e-12 * energy[0]) and energy[-1] < 0.9 * energy[0]
    for positions in found.positions[1:]:
        pairs = cKDTree(positions).query_pairs(2.0, output_type='ndarray')
        distance = np.linalg.norm(positions[pairs[:, 0]] - positions[pairs[:, 1]], axis=1)
        assert np.all(distance > 2.0 - 2e-3)  # the engine pushes out what is deeper


def test_the_centre_of_mass_of_a_cluster_moves_as_its_momentum_says():
    # spheres of unlike mass, some of which are pushed into others that no blow reaches
    rng = np.random.default_rng(3)
    places = 2.05 * (np.indices((8, 8, 8)).reshape(3, -1).T[:400] - [3.0, 3.5, 3.5])
    places += rng.normal(0.0, 0.01, places.shape)
    velocities = rng.normal(0.0, 1.0, places.shape) - 0.5 * places
    mass = 100.0 ** rng.uniform(-0.5, 0.5, 400)
    radius = np.clip(0.5 * np.cbrt(mass), 0.05, 1.0)
    scene = Scene(
        surfaces=(), gravity=(0.0, 0.0, 0.0), radius=tuple(radius), mass=tuple(mass),
        restitution=0.8, friction=0.7,
    )  # fmt: skip
    found = load_simulator('laws').rollout(scene, places, velocities, steps=40)
    centre = mass @ found.positions / mass.sum()
    expected = centre[0] + np.outer(found.times, mass @ velocities / mass.sum())
    # roundings of 400 places of 10 m, 40 times
    np.testing.assert_allclose(centre, expected, rtol=0, atol=1e-12)
