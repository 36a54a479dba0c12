# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Metrics of thesis section 4.2 against closed forms, brute force and invariances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.state import Trajectory
from rigid_gns_core.scoring import (
    angular_momentum,
    chamfer,
    divergence,
    energy,
    energy_gain,
    error_metrics,
    horizon_metrics,
    law_metrics,
    linear_momentum,
    lost_behind,
    passed_through,
    position_mse,
    sphere_penetration,
    surface_penetration,
    time_to_rest,
)

G = 9.81
DT = 0.1


def still(positions, steps=1):
    """Spheres that do not move."""
    return moving(np.repeat(np.asarray(positions, dtype=float)[None], steps + 1, axis=0))


def moving(positions, velocities=None, spins=None):
    positions = np.asarray(positions, dtype=float)
    zero = np.zeros_like(positions)
    return Trajectory(
        positions=positions,
        quaternions=np.broadcast_to([0.0, 0, 0, 1], (*positions.shape[:2], 4)),
        velocities=zero if velocities is None else velocities,
        angular_velocities=zero if spins is None else spins,
        dt=DT,
    )


def ballistic(seed=0, steps=20, count=5):
    rng = np.random.default_rng(seed)
    time = (np.arange(steps + 1) * DT)[:, None, None]
    velocity = rng.normal(size=(count, 3)) * 5
    gravity = np.array([0, 0, -G])
    start = rng.uniform(-20, 20, (count, 3)) + [0, 0, 80]
    spins = np.broadcast_to(rng.normal(size=(count, 3)), (steps + 1, count, 3))
    return moving(
        start + velocity * time + gravity * time**2 / 2, velocity + gravity * time, spins
    )


def random_walk(seed, steps=30, count=12):
    rng = np.random.default_rng(seed)
    return moving(np.cumsum(rng.normal(size=(steps + 1, count, 3)), axis=0))


# --- energy and momentum ---


def test_free_flight_keeps_its_energy():
    masses = (1.0, 2.0, 0.5, 3.0, 1.0)
    energies = energy(ballistic(), Scene(mass=masses, radius=0.5))
    for total in (energies.total, energies.with_rotation):
        # 20 terms of about 1e3 J: a few float64 roundings
        np.testing.assert_allclose(total, total[0], rtol=1e-13)
    assert energy_gain(energies.total) < 1e-12


def test_energy_of_one_sphere_by_hand():
    trajectory = moving([[[0, 0, 7.0]]], np.array([[[3.0, 0, 4.0]]]), np.array([[[0, 2.0, 0]]]))
    ground = Plane((0, 0, 2.0))
    parts = energy(trajectory, Scene(surfaces=(ground,), mass=2.0, radius=0.5))
    assert parts.kinetic[0] == pytest.approx(0.5 * 2 * 25)
    assert parts.potential[0] == pytest.approx(2 * G * 5)  # above the ground at 2 m
    assert parts.rotational[0] == pytest.approx(0.5 * 0.4 * 2 * 0.25 * 4)


def test_a_lifted_sphere_gains_what_lifting_costs():
    positions = np.array([[[0, 0, 10.0], [5, 0, 10.0]], [[0, 0, 13.0], [5, 0, 9.0]]])
    # up by 3, down by 1: the energy of all spheres rises by m g 2, over 20 m g at the start
    assert law_metrics(moving(positions), Scene())['energy_gain'] == pytest.approx(0.1)
    assert energy_gain(np.array([4.0, 3, 5, 2, 2.5])) == pytest.approx(2.5 / 4)


def test_nothing_to_normalise_by():
    assert energy_gain(np.array([0.0, 0.0])) == 0.0
    assert energy_gain(np.array([0.0, 1.0])) == float('inf')


def test_momentum_of_an_elastic_collision():
    masses = (1.0, 3.0)
    before = np.array([[2.0, 0, 0], [-1.0, 0, 0]])
    centre = (before * np.array(masses)[:, None]).sum(0) / 4
    velocities = np.stack([before, 2 * centre - before])
    positions = np.array([[[-1.0, 0.3, 9], [1.0, 0.3, 9]]] * 2)
    trajectory = moving(positions, velocities)
    scene = Scene(mass=masses, surfaces=())
    momentum = linear_momentum(trajectory, scene)
    np.testing.assert_allclose(momentum[0], momentum[1], atol=1e-14)
    laws = law_metrics(trajectory, scene)
    assert laws['horizontal_momentum_drift'] < 1e-14
    assert laws['vertical_spin_drift'] < 1e-14
    broken = replace(trajectory, velocities=np.stack([before, before * [[0], [1]]]))
    # the first sphere's 2 kg m/s vanish; |p| summed over spheres was 2 + 3 kg m/s
    assert law_metrics(broken, scene)['horizontal_momentum_drift'] == pytest.approx(2 / 5)


def test_angular_momentum_of_an_orbit_and_a_spin():
    places, velocities = [[[2.0, 0, 0], [-2.0, 0, 0]]], [[[0, 3.0, 0], [0, -3.0, 0]]]
    trajectory = moving(places, np.array(velocities), np.array([[[0, 0, 5.0]] * 2]))
    momentum = angular_momentum(trajectory, Scene(mass=2.0, radius=0.5))
    np.testing.assert_allclose(momentum[0], [0, 0, 2 * (2 * 2 * 3 + 0.4 * 2 * 0.25 * 5)])


def test_time_to_rest():
    speed = np.array([1.0, 0.5, 0.0, 0.2, 0.0, 0.0])
    trajectory = moving(np.zeros((6, 1, 3)), speed[:, None, None] * [1.0, 0, 0])
    assert time_to_rest(trajectory, Scene()) == pytest.approx(0.4)
    assert time_to_rest(trajectory.window(0, 4), Scene()) == float('inf')
    assert time_to_rest(still([[0, 0, 1]]), Scene()) == 0.0


# --- penetration ---


def test_two_spheres_that_intersect():
    found = sphere_penetration(still([[0, 0, 5], [1.5, 0, 5], [9, 0, 5]]).positions, 1.0)
    assert found.depth == found.deepest == pytest.approx(0.25)  # 0.5 m of a diameter of 2 m
    assert found.percentage == pytest.approx(200 / 3)
    assert found.count == 2  # one pair in two frames
    apart = sphere_penetration(still([[0, 0, 5], [2.0, 0, 5]]).positions, 1.0)
    assert (apart.depth, apart.percentage, apart.count) == (0.0, 0.0, 0)


def test_spheres_of_two_sizes_and_on_the_same_point():
    found = sphere_penetration(still([[0, 0, 5], [2.5, 0, 5]]).positions, np.array([1.0, 2.0]))
    assert found.depth == pytest.approx(0.5 / 3)
    assert sphere_penetration(still([[0, 0, 5], [0, 0, 5]]).positions, 1.0).depth == 1.0


def test_sphere_penetration_equals_brute_force():
    rng = np.random.default_rng(1)
    positions, radius = rng.uniform(-4, 4, (6, 40, 3)), rng.uniform(0.3, 1.0, 40)
    depths, touched = [], set()
    for frame in positions:
        for i in range(40):
            for j in range(i):
                gap = radius[i] + radius[j] - np.linalg.norm(frame[i] - frame[j])
                if gap > 0:
                    depths.append(gap / (radius[i] + radius[j]))
                    touched |= {i, j}
    found = sphere_penetration(positions, radius)
    assert found.count == len(depths) > 20
    assert found.depth == pytest.approx(np.mean(depths), rel=1e-12)
    assert found.percentage == pytest.approx(100 * len(touched) / 40)


def test_ground_and_walls_are_told_apart():
    scene = Scene(surfaces=Plane.box(10.0, 10.0))
    laws = law_metrics(still([[0, 0, 0.9], [4.4, 0, 5.0], [0, 0, 5.0], [2, 0, 5.0]]), scene)
    assert laws['depth_ground'] == pytest.approx(0.05)
    assert laws['depth_static'] == pytest.approx(0.2)
    assert laws['intersections_ground'] == laws['intersections_static'] == 25.0
    assert laws['intersections_sphere'] == laws['passed_through'] == 0.0


def test_the_edge_of_a_plane():
    table = (Plane((0, 0, 0), (0, 0, 1), (1, 0, 0), 4.0, 2.0),)
    beside = still([[2.6, 0, 0.6]]).positions  # 0.849 m from the edge at x = 2
    expected = (1 - np.hypot(0.6, 0.6)) / 2
    assert surface_penetration(beside, 1.0, table).depth == pytest.approx(expected)
    assert surface_penetration(still([[3.1, 0, 0.5]]).positions, 1.0, table).count == 0


def test_a_centre_below_the_ground_is_deeper_than_half():
    ground = (Plane(),)
    found = surface_penetration(still([[0, 0, -3.0]]).positions, 1.0, ground)
    assert found.depth == pytest.approx(2.0)


def test_who_went_through_a_ramp_and_who_went_around():
    ramp = (Plane((0, 0, 5.0), (0, 0, 1), (1, 0, 0), 4.0, 4.0),)
    heights = np.array([6.0, 5.2, 4.8, 2.0])
    through = np.zeros((4, 2, 3))
    through[:, 0, 2] = through[:, 1, 2] = heights
    through[:, 1, 0] = [0, 4, 4, 0]  # the second one goes around the edge
    np.testing.assert_array_equal(passed_through(through, ramp), [True, False])


STRIP = Plane((0, 0, 5.0), (0, 0, 1), (1, 0, 0), 4.0)  # endless along y


@pytest.mark.parametrize('normal', [(0, 0, 1), (0, 0, -1)])
def test_both_faces_of_a_strip_are_faces(normal):
    strip = (replace(STRIP, normal=normal),)
    touching = still([[0, 900.0, 6.0], [0, -900.0, 4.0], [0, 0, 1.0]]).positions
    assert surface_penetration(touching, 1.0, strip).count == 0
    deep = still([[0, 0, 5.5], [0, 0, 4.5]]).positions
    assert surface_penetration(deep, 1.0, strip).depth == pytest.approx(0.25)
    # from above, from below, from below and back, from below and back around the end
    x = np.array([[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 9.0]])
    z = np.array([[6.0, 4.8, 4.5], [4.0, 5.2, 5.5], [4.0, 5.2, 4.0], [4.0, 5.5, 4.5]])
    paths = np.stack([x, 0 * x, z], axis=-1).swapaxes(0, 1)
    np.testing.assert_array_equal(passed_through(paths, strip), True)
    np.testing.assert_array_equal(lost_behind(paths, strip), [True, True, False, False])
    deepest = [surface_penetration(paths[:, [k]], 1.0, strip).deepest for k in range(4)]
    np.testing.assert_allclose(deepest, [0.75, 0.75, 0.6, 0.75])


def test_nothing_is_lost_beside_a_strip_or_on_its_back():
    x = np.array([[3.0, 3.0, 0.0], [0.0, 3.0, 3.0], [0.0, 0.0, 0.0]])
    z = np.array([[6.0, 4.0, 4.0], [4.0, 4.0, 6.0], [4.0, 3.0, 4.0]])
    paths = np.stack([x, 0 * x, z], axis=-1).swapaxes(0, 1)
    assert not passed_through(paths, (STRIP,)).any()
    assert surface_penetration(paths, 1.0, (STRIP,)).count == 0


def test_behind_a_half_space_a_centre_is_lost_if_it_went_through():
    z = np.array([[1.0, -1.0, -5.0], [1.0, -1.0, 1.0], [-1.0, -1.0, 1.0]])
    paths = np.stack([0 * z, 0 * z, z], axis=-1).swapaxes(0, 1)
    np.testing.assert_array_equal(passed_through(paths, (Plane(),)), [True, True, False])
    np.testing.assert_array_equal(lost_behind(paths, (Plane(),)), [True, False, False])


def test_tolerance_hides_rounding():
    positions = still([[0, 0, 5], [2.0 - 1e-12, 0, 5]]).positions
    assert sphere_penetration(positions, 1.0).count == 0
    assert sphere_penetration(positions, 1.0, tolerance=0.0).count == 2


# --- errors ---


def test_mse_and_chamfer_equal_the_thesis_formulas():
    ours, theirs = random_walk(0).positions, random_walk(1).positions
    squares, chamfers = [], []
    for p, q in zip(ours, theirs, strict=True):
        squares.append(np.mean([np.sum((a - b) ** 2) for a, b in zip(p, q, strict=True)]))
        square = np.sum((p[:, None] - q[None]) ** 2, axis=-1)
        chamfers.append(square.min(1).mean() + square.min(0).mean())
    assert position_mse(ours, theirs) == pytest.approx(np.mean(squares), rel=1e-12)
    assert chamfer(ours, theirs) == pytest.approx(np.mean(chamfers), rel=1e-12)


def test_chamfer_forgets_the_order_and_mse_does_not():
    walk = random_walk(2)
    order = np.random.default_rng(0).permutation(walk.count)
    shuffled = replace(walk, positions=walk.positions[:, order])
    errors = error_metrics(shuffled, walk)
    assert errors['chamfer'] == 0.0
    assert errors['mse'] > 0.1


def test_errors_do_not_change_when_everything_is_moved_or_renumbered():
    ours, theirs = random_walk(3), random_walk(4)
    order = np.random.default_rng(0).permutation(ours.count)

    def changed(walk):
        return replace(walk, positions=walk.positions[:, order] + [100.0, -30.0, 7.0])

    first, second = error_metrics(ours, theirs), error_metrics(changed(ours), changed(theirs))
    for key, value in first.items():
        assert second[key] == pytest.approx(value, rel=1e-9), key


def test_horizons_are_single_steps():
    reference = still(np.zeros((3, 3)) + [[0, 0, 5], [9, 0, 5], [18, 0, 5]], steps=60)
    drift = np.arange(61)[:, None, None] * [0.01, 0, 0]
    predicted = replace(reference, positions=reference.positions + drift)
    found = horizon_metrics(predicted, reference)
    assert list(found) == [10, 30, 50]  # 100 is after the end
    for step, values in found.items():
        assert values['time'] == pytest.approx(step * DT)
        assert values['position_error'] == pytest.approx(0.01 * step)
        assert values['mse'] == pytest.approx((0.01 * step) ** 2)
    errors = error_metrics(predicted, reference)
    # half a radius is passed after step 50, at 5.1 s
    assert errors['predictability_time'] == pytest.approx(5.1)
    assert errors['resting_drift'] == pytest.approx(0.6)


def test_spin_and_rotation_errors():
    reference = still([[0, 0, 5.0]], steps=4)
    turned = np.broadcast_to([np.sin(0.15), 0, 0, np.cos(0.15)], (5, 1, 4))
    spins = np.broadcast_to([0, 0, 0.7], (5, 1, 3))
    predicted = replace(reference, quaternions=turned, angular_velocities=spins)
    errors = error_metrics(predicted, reference)
    assert errors['spin_error'] == pytest.approx(0.7)
    assert errors['rotation_error'] == pytest.approx(0.3)


def test_a_divergence_is_infinite_never_nan():
    reference = random_walk(5)
    positions = reference.positions.copy()
    positions[20:] = np.nan
    predicted = replace(reference, positions=positions)
    assert divergence(predicted, Scene()) == 20
    laws, errors = law_metrics(predicted, Scene()), error_metrics(predicted, reference)
    assert set(laws.values()) == {float('inf')}
    assert errors['mse'] == errors['chamfer'] == float('inf')
    assert errors['predictability_time'] == pytest.approx(2.0)
    horizons = horizon_metrics(predicted, reference)
    assert horizons[10]['mse'] == 0.0
    assert horizons[30]['mse'] == float('inf')
    assert not any(np.isnan(v) for v in [*laws.values(), *errors.values()])
    far = replace(
        reference,
        positions=reference.positions * np.where(np.arange(31) > 9, 1e8, 1)[:, None, None],
    )
    assert divergence(far, Scene()) == 10


def test_what_cannot_be_compared_is_refused():
    walk = random_walk(6)
    with pytest.raises(ValueError, match='reference 30 of 12'):
        error_metrics(walk.window(0, 5), walk)
    with pytest.raises(ValueError, match='dt 0.2 s'):
        error_metrics(replace(walk, dt=0.2), walk)
    with pytest.raises(ValueError, match='no spheres'):
        law_metrics(moving(np.zeros((3, 0, 3))), Scene())
