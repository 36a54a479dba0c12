# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""Times of impact and normals are those that a fine walk along the free paths finds."""

import numpy as np
import pytest
from rigid_gns_core import Plane, Scene
from rigid_gns_core.engine.world import world_of
from rigid_gns_core.scenes.plane import closest_points

from . import calls

H = 0.025
FINE = np.linspace(0.0, H, 20_001)
GRAVITY = np.array([0.0, 0.0, -9.81])


def find(scene, positions, velocities, lookback=H):
    world = world_of(scene, len(positions))
    return calls.contacts(world, positions, velocities, 0.1, H, lookback)


def path(start, velocity, times, gravity=GRAVITY):
    times = np.asarray(times)[..., None]
    return start + times * velocity + 0.5 * times**2 * gravity


@pytest.mark.parametrize('seed', range(5))
def test_spheres_meet_when_and_where_their_paths_do(seed):
    rng = np.random.default_rng(seed)
    count = 40
    radius = rng.uniform(0.3, 1.0, count)
    positions = rng.uniform(-4, 4, (count, 3)) + [0, 0, 30]
    velocities = 15.0 * rng.normal(size=(count, 3))
    found = find(Scene(surfaces=(), radius=tuple(radius)), positions, velocities)
    real = found.speculative_gap == 0
    pairs = list(zip(found.a[real].tolist(), found.b[real].tolist(), strict=True))
    met = 0
    for a in range(count):
        for b in range(a + 1, count):
            apart = path(positions[a], velocities[a], FINE) - path(
                positions[b], velocities[b], FINE
            )
            gap = np.linalg.norm(apart, axis=1) - radius[a] - radius[b]
            if gap.min() > 1e-6:
                assert (a, b) not in pairs or gap[0] < 2.1e-4
                continue
            if gap.min() > -1e-6:
                continue  # a touch within what the walk resolves
            k = np.flatnonzero((found.a == a) & (found.b == b))[0]
            met += 1
            if gap[0] <= 0:
                assert found.time[k] <= 0  # they should have met before
                continue
            time = FINE[np.argmax(gap <= 0)]
            assert found.time[k] == pytest.approx(time, abs=2 * H / 20_000)
            there = apart[np.argmax(gap <= 0)]
            np.testing.assert_allclose(found.normal[k], there / np.linalg.norm(there), atol=1e-2)
            assert found.gap[k] == pytest.approx(0.0, abs=1e-9)
            speed = -(velocities[a] - velocities[b]) @ found.normal[k]
            assert found.approach_speed[k] == pytest.approx(speed, rel=1e-12)
    assert met > 5


@pytest.mark.parametrize('seed', range(4))
def test_a_sphere_meets_a_plane_when_its_parabola_does(seed):
    rng = np.random.default_rng(seed)
    tilt = rng.normal(size=3) + [0, 0, 2.0]
    plane = Plane(point=tuple(rng.normal(size=3)), normal=tuple(tilt))
    normal = np.asarray(plane.normal)
    count = 30
    radius = rng.uniform(0.3, 1.0, count)
    heights = radius + rng.exponential(0.2, count)
    along = np.cross(normal, rng.normal(size=(count, 3)))
    positions = np.asarray(plane.point) + heights[:, None] * normal + 30.0 * along
    velocities = rng.normal(size=(count, 3)) * 8.0
    found = find(Scene(surfaces=(plane,), radius=tuple(radius)), positions, velocities)
    met = 0
    for i in range(count):
        at = path(positions[i], velocities[i], FINE)
        gap = (at - np.asarray(plane.point)) @ normal - radius[i]
        own = np.flatnonzero((found.plane == 0) & (found.a == i))
        if gap.min() > 1e-9:
            assert not len(own) or found.speculative_gap[own[0]] > 0 or gap[0] < 2.1e-4
            continue
        met += 1
        (k,) = own
        time = FINE[np.argmax(gap <= 0)]
        assert found.time[k] == pytest.approx(time, abs=2 * H / 20_000)
        np.testing.assert_allclose(found.normal[k], normal, atol=1e-12)
        arrives = velocities[i] + found.time[k] * GRAVITY
        assert found.approach_speed[k] == pytest.approx(-arrives @ normal, rel=1e-9)
        assert found.acceleration[k] == pytest.approx(GRAVITY @ normal, rel=1e-12)
    assert met > 5


@pytest.mark.parametrize('seed', range(4))
def test_planes_are_met_the_same_alone_and_among_others(seed):
    # alone a sphere has too few candidates for lanes of eight; faces, edges and walls of two sides
    rng = np.random.default_rng(seed)
    plate = Plane(point=(0.0, 0.0, 3.0), normal=(0.2, 0.1, 1.0), length_x=3.0, length_y=2.0)
    scene = Scene(surfaces=(*Plane.box(9.0, 9.0, height=6.0), plate), radius=0.4)
    positions = rng.uniform([-4.5, -4.5, 0.3], [4.5, 4.5, 6.0], (200, 3))
    velocities = rng.choice([0.1, 8.0], 200)[:, None] * rng.normal(size=(200, 3))
    among, met = find(scene, positions, velocities), 0
    for i in range(200):
        alone = find(scene, positions[i, None], velocities[i, None])
        own = np.flatnonzero((among.a == i) & (among.plane >= 0))
        order = own[np.argsort(among.plane[own])]
        for name in alone._fields[3:]:  # without candidate, a and b
            known = getattr(alone, name)[np.argsort(alone.plane)]
            np.testing.assert_array_equal(getattr(among, name)[order], known)
        met += len(own)
    assert met > 20


def test_contacts_of_an_island_may_be_left_out():
    positions = np.array([[0.0, 0, 1], [2, 0, 1], [9, 0, 1], [11, 0, 1], [20, 0, 1]])
    world, still = world_of(Scene(radius=1.0), 5), np.zeros((5, 3))
    whole, _ = calls.contacts_without(world, positions, still, 0.1, H, 0)
    assert sorted(whole.a.tolist()) == [0, 0, 1, 2, 2, 3, 4]
    for island, left in ((1, [2, 2, 3, 4]), (2, [0, 0, 1, 4])):
        found, begin = calls.contacts_without(world, positions, still, 0.1, H, island)
        assert sorted(found.a.tolist()) == left
        assert begin[island] == begin[island + 1]


def test_an_edge_is_met_where_its_closest_point_is():
    plate = Plane(point=(0.0, 0.0, 5.0), length_x=4.0, length_y=4.0)
    rng = np.random.default_rng(0)
    angle = rng.uniform(0, 2 * np.pi, 60)
    rim = 2.0 / np.maximum(np.abs(np.cos(angle)), np.abs(np.sin(angle)))
    out = np.c_[np.cos(angle), np.sin(angle), 0 * angle]
    positions = out * (rim + rng.uniform(0.2, 0.95, 60))[:, None] + [0, 0, 5.0]
    positions[:, 2] += rng.uniform(0.0, 1.2, 60)
    velocities = -3.0 * out
    scene = Scene(surfaces=(plate,), radius=1.0)
    met = 0
    for place, velocity in zip(positions, velocities, strict=True):  # one by one: none meet
        found = find(scene, place[None], velocity[None])
        (points, _) = closest_points((plate,), path(place, velocity, FINE))
        away = path(place, velocity, FINE) - points[:, 0]
        gap = np.linalg.norm(away, axis=1) - 1.0
        if gap[0] < 0:  # overlaps from the start: the normal is that of the closest point
            assert len(found.a) == 1
            expected = away[0] / np.linalg.norm(away[0])
            np.testing.assert_allclose(found.normal[0], expected, atol=1e-9)
            assert found.gap[0] == pytest.approx(gap[0], abs=1e-12)
            met += 1
        elif gap[-1] < 0:  # linear in between, exact to second order in h
            assert found.time[0] == pytest.approx(FINE[np.argmax(gap < 0)], abs=0.1 * H)
            met += 1
    assert met > 20


def test_what_gravity_may_bring_together_is_a_speculative_contact():
    gap = 0.5 * 9.81 * H**2
    positions = np.array([[0.0, 0, 1.0 + gap], [0.0, 20, 3.0], [2.0 + gap, 20.0, 3.0]])
    found = find(Scene(), positions, np.array([[0.0, 0, 5.0], [0, 0, 0], [0, 0, 0]]))
    assert found.speculative_gap == pytest.approx([gap, gap])
    assert (found.time == 0).all()
    positions[:, 2] += 1.0
    positions[2, 0] += 3.0 * gap
    assert len(find(Scene(), positions, np.zeros((3, 3))).a) == 0


def test_gaps_are_those_of_the_closest_points():
    rng = np.random.default_rng(2)
    plate = Plane(point=(0.0, 0.0, 4.0), normal=(0.2, 0.1, 1.0), length_x=5.0, length_y=3.0)
    surfaces = (*Plane.box(9.0, 9.0), plate)
    positions = rng.uniform(-4, 4, (60, 3)) + [0, 0, 4.5]
    radius = rng.uniform(0.4, 1.0, 60)
    scene = Scene(surfaces=surfaces, radius=tuple(radius))
    world = world_of(scene, 60)
    found = calls.contacts(world, positions, 5.0 * rng.normal(size=(60, 3)), 0.1, H, H)
    moved = positions + 0.01 * rng.normal(size=(60, 3))
    values = calls.gaps(world, moved, found)
    points, heights = closest_points(surfaces, moved)
    assert (found.plane == 5).any() and (found.plane < 0).any()
    for k, (a, b, plane) in enumerate(zip(found.a, found.b, found.plane, strict=True)):
        if plane < 0:
            expected = np.linalg.norm(moved[a] - moved[b]) - radius[a] - radius[b]
        else:
            away = moved[a] - points[a, plane]
            behind = plane == 0 and heights[a, plane] < 0  # of the ground, which has no end
            expected = (-1.0 if behind else 1.0) * np.linalg.norm(away) - radius[a]
        assert values[k] == pytest.approx(expected, abs=1e-12)
