# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Connectivity against brute force over all pairs, and the cases it exists for."""

import numpy as np
import pytest
from rigid_gns_core.gns.graph import build_graph, Reach, swept_distance
from rigid_gns_core.scenes.scene import Plane, Scene

DT = 0.1
CONNECTIVITIES = ('epsilon', 'vmax', 'vi', 'swept')


def random_spheres(seed, count=60, side=12.0):
    rng = np.random.default_rng(seed)
    positions = rng.uniform(-side / 2, side / 2, (count, 3)) + [0, 0, side / 2 + 1]
    # speeds over three decades, so that reaches differ
    velocities = rng.normal(size=(count, 3)) * 10 ** rng.uniform(-1, 1.7, (count, 1))
    return positions, velocities


def brute_force_pairs(positions, velocities, radius, reach):
    pairs = set()
    speed = np.linalg.norm(velocities, axis=1)
    for i in range(len(positions)):
        for j in range(i + 1, len(positions)):
            gap = np.linalg.norm(positions[i] - positions[j]) - 2 * radius
            limit = {
                'epsilon': reach.epsilon,
                'vmax': speed.max() * DT + reach.margin,
                'vi': max(speed[i], speed[j]) * DT + reach.margin,
                'swept': reach.margin,
            }[reach.connectivity]
            if reach.connectivity == 'swept':
                # a fine scan of the step: within 1e-3 m of the closed form's minimum
                times = np.linspace(0, DT, 4001)[:, None]
                relative = positions[j] - positions[i] + times * (velocities[j] - velocities[i])
                gap = np.linalg.norm(relative, axis=1).min() - 2 * radius
                if abs(gap - limit) < 1e-3:
                    continue
            if gap <= limit:
                pairs.add((i, j))
    return pairs


@pytest.mark.parametrize('connectivity', CONNECTIVITIES)
@pytest.mark.parametrize('seed', range(3))
def test_pairs_equal_brute_force(connectivity, seed):
    positions, velocities = random_spheres(seed)
    reach = Reach(connectivity, epsilon=1.0)
    scene = Scene(surfaces=(), radius=0.7)
    graph = build_graph(positions, velocities, scene, DT, reach)
    found = {(s, r) for s, r in zip(graph.senders, graph.receivers, strict=True) if s < r}
    expected = brute_force_pairs(positions, velocities, 0.7, reach)
    assert len(expected) > 5  # the scene is dense enough to tell something
    if connectivity == 'swept':
        assert expected <= found
        assert len(found - expected) <= 2  # the ones within the scan's resolution
    else:
        assert found == expected


PLATE = Plane((1.0, 0, 4), (0, 0.6, 0.8), length_x=6.0, length_y=4.0)
STRIP = Plane((0, 0, 3), (0.6, 0, 0.8), (0, 1, 0), length_y=3.0)
BOX = Plane.box(9.0, 9.0)
ONE_FACED = BOX  # its walls too: their ends are on other walls


def brute_force_surfaces(positions, velocities, radius, scene, reach):
    """(sphere, surface) and the closest point, which is looked for corner by corner and inside."""
    speed = np.linalg.norm(velocities, axis=1)
    found = {}
    for i, p in enumerate(positions):
        limit = {
            'epsilon': reach.epsilon,
            'vmax': speed.max() * DT + reach.margin,
            'vi': speed[i] * DT + reach.margin,
        }[reach.connectivity]
        for s, plane in enumerate(scene.surfaces):
            x, y, normal = plane.axes
            along, across, height = (axis @ (p - plane.point) for axis in (x, y, normal))
            along = sorted([-plane.length_x / 2, along, plane.length_x / 2])[1]
            across = sorted([-plane.length_y / 2, across, plane.length_y / 2])[1]
            point = plane.point + along * x + across * y
            gap = np.linalg.norm(p - point)
            if height < 0 and plane in ONE_FACED:
                gap = -gap
            if gap - radius <= limit or (reach.ground_edge and s == scene.ground):
                found[i, s] = point
    return found


@pytest.mark.parametrize('ground_edge', [True, False])
@pytest.mark.parametrize('connectivity', ['epsilon', 'vmax', 'vi'])
def test_surface_edges_equal_brute_force(connectivity, ground_edge):
    reach = Reach(connectivity, epsilon=0.6, ground_edge=ground_edge)
    scene = Scene(surfaces=(*BOX, PLATE, STRIP), radius=0.7)
    for seed in range(3):
        positions, velocities = random_spheres(seed, side=10.0)
        positions = 1.2 * positions - [0, 0, 2.0]  # some behind walls and below the ground
        graph = build_graph(positions, velocities, scene, DT, reach)
        expected = brute_force_surfaces(positions, velocities, 0.7, scene, reach)
        edges = zip(graph.surface_receivers.tolist(), graph.surface_senders.tolist(), strict=True)
        found = dict(zip(edges, graph.surface_points, strict=True))
        assert found.keys() == expected.keys()
        assert len({s for _, s in found}) == 7 and len(found) > 20
        for edge, point in expected.items():
            np.testing.assert_allclose(found[edge], point, atol=1e-13)  # float64 of order 10


def test_gravity_brings_a_sphere_at_rest_to_a_plane():
    # 0.06 m above it, beyond the margin of 0.05, but g dt^2 / 2 = 0.049 m nearer after the step
    positions = np.array([[0.0, 0, 1.06], [9.0, 0, 1.2]])
    reach = Reach('swept', ground_edge=False)
    graph = build_graph(positions, np.zeros((2, 3)), Scene(), DT, reach)
    assert graph.surface_receivers.tolist() == [0]


@pytest.mark.parametrize('connectivity', CONNECTIVITIES)
def test_edges_come_in_both_directions(connectivity):
    positions, velocities = random_spheres(4)
    graph = build_graph(positions, velocities, Scene(radius=0.7), DT, Reach(connectivity))
    assert len(graph.senders) > 0
    np.testing.assert_array_equal(graph.senders[graph.reverse], graph.receivers)
    np.testing.assert_array_equal(graph.reverse[graph.reverse], np.arange(len(graph.reverse)))


def test_swept_finds_a_crossing_that_both_ends_miss():
    offset = np.array([[3.0, 0.5, 0.0]])
    moved = np.array([[-6.0, 0.0, 0.0]])
    assert swept_distance(offset, moved)[0] == pytest.approx(0.5, abs=1e-15)
    positions = np.array([[0.0, 0, 50], [3.0, 0.5, 50]])
    velocities = np.array([[60.0, 0, 0], [0.0, 0, 0]])
    scene = Scene(surfaces=(), radius=1.0)
    graph = build_graph(positions, velocities, scene, DT, Reach('swept'))
    assert len(graph.senders) == 2
    assert len(build_graph(positions, velocities, scene, DT, Reach('epsilon')).senders) == 0


@pytest.mark.parametrize('connectivity', CONNECTIVITIES)
def test_touching_spheres_at_rest_are_connected(connectivity):
    positions = np.array([[0.0, 0, 1], [2.0, 0, 1]])
    graph = build_graph(positions, np.zeros((2, 3)), Scene(), DT, Reach(connectivity))
    assert sorted(zip(graph.senders.tolist(), graph.receivers.tolist(), strict=True)) == [
        (0, 1),
        (1, 0),
    ]


@pytest.mark.parametrize('connectivity', CONNECTIVITIES)
@pytest.mark.parametrize('ground_edge', [True, False])
def test_ground_edge_reaches_any_height(connectivity, ground_edge):
    positions = np.array([[0.0, 0, 120.0], [5.0, 0, 1.0]])
    reach = Reach(connectivity, ground_edge=ground_edge)
    graph = build_graph(positions, np.zeros((2, 3)), Scene(), DT, reach)
    assert graph.surface_receivers.tolist() == ([0, 1] if ground_edge else [1])


@pytest.mark.parametrize('connectivity', CONNECTIVITIES)
def test_a_sphere_that_went_through_the_ground_stays_connected(connectivity):
    positions = np.array([[0.0, 0, -40.0]])
    reach = Reach(connectivity, ground_edge=False)
    graph = build_graph(positions, np.array([[0.0, 0, -5.0]]), Scene(), DT, reach)
    assert graph.surface_receivers.tolist() == [0]


@pytest.mark.parametrize('connectivity', CONNECTIVITIES)
def test_a_strip_connects_on_both_sides_and_nothing_far_from_it(connectivity):
    positions = np.array([[0.0, 70, 6], [0, 0, 4.1], [0, 0, -9], [8, 0, 4.9], [2.7, 0, 4.3]])
    reach = Reach(connectivity, epsilon=0.1, ground_edge=False)
    strips = [Plane((0, 0, 5), (0, 0, side), (1, 0, 0), 4.0) for side in (1.0, -1.0)]
    graphs = [
        build_graph(positions, np.zeros((5, 3)), Scene(surfaces=strip), DT, reach)
        for strip in strips
    ]
    for graph in graphs:
        assert graph.surface_receivers.tolist() == [0, 1, 4]
        # out of the face on the sphere's side, whichever the plane's own normal is
        np.testing.assert_array_equal(graph.surface_normals[:, 2], [1.0, -1.0, -1.0])
        np.testing.assert_array_equal(graph.surface_points, graphs[0].surface_points)


def test_behind_the_walls_of_a_box_is_outside_and_behind_a_fence_is_not():
    positions = np.array([[-14.0, 0, 3], [0, 14.0, 3]])
    fence = Plane((-2.0, 0, 1), (1, 0, 0), (0, 0, 1), length_x=2.0)
    scene = Scene(surfaces=(*Plane.box(20.0, 20.0), fence))
    graph = build_graph(positions, np.zeros((2, 3)), scene, DT, Reach(ground_edge=False))
    edges = list(zip(graph.surface_receivers, graph.surface_senders, strict=True))
    assert edges == [(0, 1), (1, 4)]
    np.testing.assert_array_equal(graph.surface_normals, [[1.0, 0, 0], [0, -1.0, 0]])


def test_a_ramp_above_the_floor_is_not_connected_to_spheres_far_below():
    ramp = Plane((0, 0, 20), (0, 0, 1), length_x=10, length_y=10)
    scene = Scene(surfaces=(Plane(), ramp))
    graph = build_graph(np.array([[0.0, 0, 1]]), np.zeros((1, 3)), scene, DT, Reach('vi'))
    assert graph.surface_senders.tolist() == [0]


def test_closest_point_is_on_the_edge_beyond_a_plane_with_an_end():
    table = Plane((0, 0, 0), (0, 0, 1), (1, 0, 0), 4.0, 2.0)
    scene = Scene(surfaces=(table,))
    positions = np.array([[2.5, 0.0, 0.8], [4.0, 0.0, 0.8]])
    graph = build_graph(positions, np.zeros((2, 3)), scene, DT, Reach('vi', ground_edge=False))
    assert graph.surface_receivers.tolist() == [0]  # the second is 2.15 m away
    np.testing.assert_allclose(graph.surface_points[0], [2.0, 0, 0], atol=1e-15)


@pytest.mark.parametrize('connectivity', ['vi', 'vmax', 'swept'])
def test_a_sphere_that_crosses_a_plane_with_an_end_in_one_step(connectivity):
    table = Scene(surfaces=(Plane((0, 0, 0), (0, 0, 1), (1, 0, 0), 10.0, 10.0),))
    positions = np.array([[0.0, 0, 3.0], [30.0, 0, 3.0]])
    velocities = np.array([[0.0, 0, -60.0], [0.0, 0, -1.0]])
    reach = Reach(connectivity, ground_edge=False)
    graph = build_graph(positions, velocities, table, DT, reach)
    assert graph.surface_receivers.tolist() == [0]


def test_no_spheres_and_no_surfaces():
    graph = build_graph(np.zeros((0, 3)), np.zeros((0, 3)), Scene(), DT, Reach())
    assert len(graph.senders) == len(graph.surface_receivers) == 0
    graph = build_graph(np.zeros((1, 3)), np.zeros((1, 3)), Scene(surfaces=()), DT, Reach())
    assert len(graph.senders) == len(graph.surface_receivers) == 0


def test_unknown_connectivity_lists_the_known_ones():
    with pytest.raises(ValueError, match='epsilon, vmax, vi, swept'):
        Reach('radius')
