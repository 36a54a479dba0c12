# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""One contact alone follows its closed form; the law's own series of bounces."""

import numpy as np
import pytest
from rigid_gns_core import load_simulator, Plane, Scene
from rigid_gns_core.closed_form import GROUPS, laws, run_checks
from rigid_gns_core.engine.world import THRESHOLD_TIME, world_of

from . import calls

G = 9.81
THRESHOLD = THRESHOLD_TIME * G
SMALL = 0.02


def engine_of(simulator):
    def engine(scene, start, steps, dt):
        trajectory = simulator.rollout(
            scene, start.positions, start.velocities, start.angular_velocities, steps
        )
        assert trajectory.dt == pytest.approx(dt, rel=1e-12)
        return trajectory

    return engine


@pytest.mark.parametrize('group', list(GROUPS)[:6])  # the others share spheres and surfaces
@pytest.mark.parametrize('size', [(1, 1), (8, 4)])
def test_closed_forms_at_one_metre(group, size):
    substeps, rounds = size  # single contacts need no rounds; a pile does
    if group == 'pile' and rounds < 4:
        substeps, rounds = 4, 6
    simulator = load_simulator(substeps=substeps, rounds=rounds)
    checks = run_checks(engine_of(simulator), quick=True, groups=(group,))
    assert len(checks) > 3
    assert not [check for check in checks if not check.passed]


@pytest.mark.parametrize('e', [0.3, 0.9])
def test_small_spheres_bounce_as_their_restitution_says(e):
    scene = Scene(radius=SMALL, restitution=e, surfaces=(Plane(restitution=1.0),))
    drop = 0.05
    t = load_simulator().rollout(scene, [[0.0, 0, SMALL + drop]], steps=10)
    rise = 0.5 * t.velocities[:, 0, 2] ** 2 + G * (t.positions[:, 0, 2] - SMALL)
    after = np.flatnonzero(rise < 0.99 * rise[0])[0]
    # states are exact at frames; only the rounding of the units is left
    assert np.sqrt(rise[after] / rise[0]) == pytest.approx(e, rel=1e-9)


def test_small_spheres_roll_down_inclines():
    for degrees in (2.0, 20.0):
        angle = np.radians(degrees)
        plane = Plane(normal=(np.sin(angle), 0.0, np.cos(angle)), friction=1.0)
        scene = Scene(surfaces=(plane,), radius=SMALL, friction=1.0, rolling_friction=0.02)
        t = load_simulator().rollout(scene, [SMALL * np.asarray(plane.normal)], steps=20)
        speed = t.velocities[-1, 0] @ [np.cos(angle), 0.0, -np.sin(angle)]
        expected = laws.incline_acceleration(angle, 1.0, 0.02, G)
        # the sphere starts within the rounding of its units of the plane
        assert speed / t.times[-1] == pytest.approx(expected, rel=1e-4)


def test_small_spheres_collide():
    masses, radii = np.array([1.0, 3.0]), np.full(2, SMALL)
    scene = Scene(
        surfaces=(),
        gravity=(0.0, 0.0, 0.0),
        radius=SMALL,
        mass=tuple(masses),
        restitution=0.8,
        friction=0.5,
    )
    positions = np.array([[-3.1, 1.0, 0.0], [0, 0, 0]]) * SMALL
    velocities, spins = np.array([[0.8, 0, 0], [0, 0, 0]]), np.array([[5.0, 9, -7], [0, 0, 0]])
    t = load_simulator().rollout(scene, positions, velocities, spins, steps=8)
    normal = np.array([-np.sqrt(3.0), 1.0, 0.0]) / 2.0
    speeds, turned = laws.impact_of_spheres(velocities, spins, normal, radii, masses, 0.64, 0.25)
    np.testing.assert_allclose(t.velocities[-1], speeds, atol=1e-9)
    np.testing.assert_allclose(t.angular_velocities[-1], turned, atol=1e-7)


@pytest.mark.parametrize('seed', range(6))
def test_an_oblique_impact_of_unlike_spheres_is_the_closed_form(seed):
    rng = np.random.default_rng(seed)
    masses, radii = rng.uniform(0.3, 3.0, 2), np.array([1.0, rng.uniform(0.3, 1.0)])
    e, mu = rng.uniform(0.3, 1.0, 2), rng.uniform(0.0, 1.0, 2)
    scene = Scene(
        surfaces=(),
        gravity=(0.0, 0.0, 0.0),
        radius=tuple(radii),
        mass=tuple(masses),
        restitution=tuple(e),
        friction=tuple(mu),
    )
    normal = rng.normal(size=3)  # from b to a, at the impact
    normal /= np.linalg.norm(normal)
    across = np.cross(normal, rng.normal(size=3))
    velocities = np.array([-4.0 * normal + 2.0 * across, rng.normal(size=3)])
    spins = 3.0 * rng.normal(size=(2, 3))
    touching = np.array([radii.sum() * normal, [0.0, 0, 0]])
    t = load_simulator().rollout(scene, touching - 0.13 * velocities, velocities, spins, steps=3)
    speeds, turned = laws.impact_of_spheres(
        velocities, spins, normal, radii, masses, e.prod(), mu.prod()
    )
    np.testing.assert_allclose(t.velocities[-1], speeds, atol=1e-9)
    np.testing.assert_allclose(t.angular_velocities[-1], turned, atol=1e-9)


def test_a_scaled_scene_is_a_scaled_rollout():
    rng = np.random.default_rng(5)
    positions = rng.uniform(-3, 3, (6, 3)) * [1, 1, 0] + 2.4 * np.arange(6)[:, None] * [0, 0, 1]
    positions, velocities = positions + [0, 0, 1.5], rng.normal(size=(6, 3))
    # powers of two keep all digits, so that not even chaos tells the two apart
    length, time = 1.0 / 64.0, 1.0 / 8.0
    simulator = load_simulator()
    large = simulator.rollout(Scene(surfaces=Plane.box(8, 8)), positions, velocities, steps=15)
    small = simulator.rollout(
        Scene(surfaces=Plane.box(8 * length, 8 * length), radius=length),
        positions * length,
        velocities * length / time,
        steps=15,
    )
    assert small.dt == pytest.approx(0.1 * time)
    np.testing.assert_allclose(small.positions / length, large.positions, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(
        small.velocities * time / length, large.velocities, rtol=1e-9, atol=1e-9
    )


def target(e, approach, h, *, time=0.0, coupling=0.0, gap=0.0):
    """Target of a sphere above a floor."""
    return calls.target(e, h, time, gap, approach, -G, coupling)


def bounced(e, approach, rest):
    """Velocity and height after `rest`, from one event to the next."""
    speed = approach
    while True:
        if speed <= THRESHOLD:
            return 0.0, 0.0
        speed *= e
        flight = 2.0 * speed / G
        if flight >= rest:
            return speed - G * rest, speed * rest - 0.5 * G * rest**2
        rest -= flight


@pytest.mark.parametrize('e', [0.1, 0.5, 0.8, 0.95])
@pytest.mark.parametrize('time', [0.0, 0.013])
def test_bounces_are_a_geometric_series(e, time):
    h, flown = 0.1, 0
    for approach in np.geomspace(2e-3, 8.0, 40):
        found = target(e, float(approach), h, time=time)
        separation, height = bounced(e, approach, h - time)
        assert found.active
        assert found.separation_velocity == pytest.approx(separation, abs=1e-9)
        # the impulse acts at once, so long before the end: where the free path would end in depth
        rest = h - time
        depth = approach * rest + 0.5 * G * rest**2
        assert found.impulse * found.impulse_time - depth == pytest.approx(height, abs=1e-9)
        assert found.impulse == pytest.approx(separation + approach + G * rest, abs=1e-9)
        flown += found.flight_time > 0
    assert flown > 2


def test_a_slow_sphere_rests():
    found = target(0.9, 0.5 * THRESHOLD, 0.025)
    assert found.active and found.flight_time == 0
    assert found.separation_velocity == 0.0
    assert found.impulse == pytest.approx(0.5 * THRESHOLD + G * 0.025, rel=1e-12)


@pytest.mark.parametrize('e', [0.0, 0.7, 1.0])
@pytest.mark.parametrize('pull', [0.0, G])
def test_what_nothing_presses_together_parts_however_slow(e, pull):
    # a wall, or a ceiling that gravity pulls away from: one bounce, at any speed
    for approach in (1e-9, 1e-3, 2.0):
        found = calls.target(e, 0.1, 0.04, 0.0, approach, pull, 0.0)
        separation = e * approach + pull * 0.06
        assert found.active
        assert found.separation_velocity == pytest.approx(separation, rel=1e-12, abs=1e-15)
        assert found.end_gap == pytest.approx(e * approach * 0.06 + 0.5 * pull * 0.06**2)


def test_an_elastic_sphere_bounces_on():
    # each flight takes 2 u / g, and begins as fast as the last
    approach, h = 0.05, 0.1
    flown = h % (2.0 * approach / G)
    found = target(1.0, approach, h)
    assert found.separation_velocity == pytest.approx(approach - G * flown, rel=1e-12)
    assert found.end_gap == pytest.approx(approach * flown - 0.5 * G * flown**2, rel=1e-9)


def test_a_touching_sphere_that_leaves_comes_back():
    leaves = 3.0 * THRESHOLD
    found = target(0.5, -leaves, 0.1)
    assert 0.1 - found.remaining == pytest.approx(2.0 * leaves / G, rel=1e-12)
    assert target(0.5, -leaves, leaves / G).impulse == pytest.approx(0.0, abs=1e-15)  # not yet


def test_what_others_hold_does_not_fall():
    # the free path meets the floor after 10 ms; others take its weight and stop it before
    free = target(0.5, 0.2, 0.1, time=0.01)
    held = target(0.5, 0.2, 0.1, time=0.01, coupling=20.0 + G)
    near = target(0.5, 0.0, 0.1, gap=0.01, coupling=G)
    assert free.active and not held.active and not near.active
    assert target(0.5, 0.0, 0.1, gap=0.01).active  # which else it reaches: 1/2 g h^2 is 49 mm


def test_what_others_push_arrives_sooner():
    # a gap of 10 mm at rest, pulled by gravity and by others: t = sqrt(2 s / a)
    for more in (0.0, 5.0, 30.0):
        found = target(0.5, 0.0, 0.1, gap=0.01, coupling=-more)
        assert 0.1 - found.remaining == pytest.approx(np.sqrt(0.02 / (G + more)), rel=1e-12)


def test_properties_of_pairs_are_products():
    scene = Scene(
        surfaces=(Plane(restitution=0.5, friction=0.25),),
        radius=(2.0, 1.0),
        mass=(2.0, 4.0),
        restitution=(0.8, 0.5),
        friction=(0.6, 0.5),
        rolling_friction=0.02,
    )
    positions = np.array([[0.0, 0, 2.0], [3.0, 0, 2.0]])
    world = world_of(scene, 2)
    found = calls.contacts(world, positions, np.zeros((2, 3)), 0.1, 0.01, 0.01)
    law = calls.law(world, found)
    assert found.b.tolist() == [1, 2]
    assert law.restitution == pytest.approx([0.8 * 0.5, 0.8 * 0.5])
    assert law.friction == pytest.approx([0.6 * 0.5, 0.6 * 0.25])
    assert law.rolling == pytest.approx([0.0, 0.02 * 2.0])  # none between spheres
    assert law.inverse_effective_mass == pytest.approx([1 / 2 + 1 / 4, 1 / 2])
    assert law.arm_a == pytest.approx([2.0, 2.0]) and law.arm_b == pytest.approx([1.0, 0.0])
    inertia = 0.4 * np.array([2.0 * 4.0, 4.0 * 1.0])
    assert law.rotation_a == pytest.approx(4.0 / inertia[0])
    assert law.rotation_b == pytest.approx([1.0 / inertia[1], 0.0])
