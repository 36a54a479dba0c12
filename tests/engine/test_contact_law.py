# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""One contact alone follows its closed form for any weights; the law's own series of bounces."""

from dataclasses import asdict, replace

import numpy as np
import pytest
from rigid_gns_core import load_simulator, Plane, Scene
from rigid_gns_core.closed_form import GROUPS, laws, run_checks
from rigid_gns_core.files.checkpoint import save_model
from rigid_gns_core.gns.config import ContactConfig
from rigid_gns_core.models.contact.geometry import Contacts
from rigid_gns_core.models.contact.law import aim_of, Law
from rigid_gns_core.models.contact.network import ContactNetwork
from rigid_gns_core.models.contact.world import World
import torch

G, QUIET = 9.81, 3.0 * 9.81 * 0.1 / 240.0
SMALL = 0.02


@pytest.fixture(scope='module')
def load(tmp_path_factory):
    """Make simulators with random weights, by substeps, rounds and options."""

    def made(substeps=2, rounds=3, **options):
        torch.manual_seed(0)
        network = ContactNetwork(ContactConfig(substeps=substeps, rounds=rounds, width=8))
        with torch.no_grad():
            for parameter in network.heads.parameters():
                parameter.normal_(std=0.5)
        card = {
            'kind': 'contact',
            'config': asdict(network.config),
            'units': {'radius': 1.0, 'gravity': G, 'dt': 0.1},
            'materials': {'restitution': [0, 1]},
            'training': {},
            'validation': {},
        }
        path = tmp_path_factory.mktemp('model') / 'random'
        save_model(path, network, card)
        return load_simulator(path, **options)

    return made


def engine_of(simulator):
    def engine(scene, start, steps, dt):
        trajectory = simulator.rollout(
            scene, start.positions, start.velocities, start.angular_velocities, steps
        )
        assert trajectory.dt == pytest.approx(dt, rel=1e-12)
        return trajectory

    return engine


@pytest.mark.parametrize('group', GROUPS)
def test_closed_forms_at_one_metre(load, group):
    # single contacts need no rounds; a pile does, so its depth is no guarantee for any weights
    size = {'substeps': 4, 'rounds': 6} if group == 'pile' else {'substeps': 1, 'rounds': 2}
    checks = run_checks(engine_of(load(**size)), quick=True, groups=(group,))
    assert len(checks) > 3
    assert not [check for check in checks if not check.passed]


@pytest.mark.parametrize('group', ['bounce', 'oblique', 'collision'])
def test_closed_forms_in_float32(load, group):
    simulator = load(substeps=1, rounds=2, dtype='float32')
    checks = run_checks(engine_of(simulator), quick=True, groups=(group,))
    assert not [check for check in checks if not check.passed]


@pytest.mark.parametrize('e', [0.3, 0.9])
def test_small_spheres_bounce_as_their_restitution_says(load, e):
    scene = Scene(radius=SMALL, restitution=e, surfaces=(Plane(restitution=1.0),))
    drop = 0.05
    t = load().rollout(scene, [[0.0, 0, SMALL + drop]], steps=10)
    rise = 0.5 * t.velocities[:, 0, 2] ** 2 + G * (t.positions[:, 0, 2] - SMALL)
    after = np.flatnonzero(rise < 0.99 * rise[0])[0]
    # states are exact at frames; only the rounding of the units is left
    assert np.sqrt(rise[after] / rise[0]) == pytest.approx(e, rel=1e-9)


def test_small_spheres_roll_down_inclines(load):
    for degrees in (2.0, 20.0):
        angle = np.radians(degrees)
        plane = Plane(normal=(np.sin(angle), 0.0, np.cos(angle)), friction=1.0)
        scene = Scene(surfaces=(plane,), radius=SMALL, friction=1.0, rolling_friction=0.02)
        t = load().rollout(scene, [SMALL * np.asarray(plane.normal)], steps=20)
        speed = t.velocities[-1, 0] @ [np.cos(angle), 0.0, -np.sin(angle)]
        expected = laws.incline_acceleration(angle, 1.0, 0.02, G)
        # the sphere starts within the rounding of its units of the plane
        assert speed / t.times[-1] == pytest.approx(expected, rel=1e-4)


def test_small_spheres_collide(load):
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
    t = load().rollout(scene, positions, velocities, spins, steps=8)
    normal = np.array([-np.sqrt(3.0), 1.0, 0.0]) / 2.0
    speeds, turned = laws.impact_of_spheres(velocities, spins, normal, radii, masses, 0.64, 0.25)
    np.testing.assert_allclose(t.velocities[-1], speeds, atol=1e-9)
    np.testing.assert_allclose(t.angular_velocities[-1], turned, atol=1e-7)


def test_a_scaled_scene_is_a_scaled_rollout(load):
    rng = np.random.default_rng(5)
    positions = rng.uniform(-3, 3, (6, 3)) * [1, 1, 0] + 2.4 * np.arange(6)[:, None] * [0, 0, 1]
    positions, velocities = positions + [0, 0, 1.5], rng.normal(size=(6, 3))
    # powers of two keep all digits, so that not even chaos tells the two apart
    length, time = 1.0 / 64.0, 1.0 / 8.0
    simulator = load()
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


def aim(e, approach, h, *, time=0.0, extra=0.0, gap=0.0):
    """Aim of a sphere above a floor."""
    scene = Scene(surfaces=(Plane(restitution=1.0),), restitution=e)

    def row(value):
        return torch.tensor([value], dtype=torch.float64)

    one = torch.tensor([1])
    contacts = Contacts(
        a=0 * one,
        b=one,
        plane=0 * one,
        side=row(1.0),
        normal=torch.tensor([[0.0, 0, 1]], dtype=torch.float64),
        time=row(time),
        gap=row(0.0),
        open=row(gap),
        approach=row(approach),
        pull=row(-G),
    )
    law = Law(World.of(scene, 1), contacts, h, h)
    return aim_of(law, row(approach), row(extra))


def bounced(e, approach, rest):
    """Velocity and height after `rest`, from one event to the next."""
    speed = approach
    while True:
        if speed <= QUIET:
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
        found = aim(e, float(approach), h, time=time)
        parting, height = bounced(e, approach, h - time)
        assert found.hit.item()
        assert found.parting.item() == pytest.approx(parting, abs=1e-9)
        # the impulse acts at once, `lever` before the end: where the free path would end in depth
        rest = h - time
        depth = approach * rest + 0.5 * G * rest**2
        assert (found.impulse * found.lever).item() - depth == pytest.approx(height, abs=1e-9)
        assert found.impulse.item() == pytest.approx(parting + approach + G * rest, abs=1e-9)
        flown += bool(found.flying)
    assert flown > 2


def test_a_slow_sphere_rests():
    found = aim(0.9, 0.5 * QUIET, 0.025)
    assert found.hit and not found.flying
    assert found.parting.item() == 0.0
    assert found.impulse.item() == pytest.approx(0.5 * QUIET + G * 0.025, rel=1e-12)


def test_what_others_hold_does_not_fall():
    # the free path meets the floor after 10 ms; others take its weight and stop it before
    free = aim(0.5, 0.2, 0.1, time=0.01)
    held = aim(0.5, 0.2, 0.1, time=0.01, extra=20.0 + G)
    near = aim(0.5, 0.0, 0.1, gap=0.01, extra=G)
    assert free.hit and not held.hit and not near.hit
    assert aim(0.5, 0.0, 0.1, gap=0.01).hit  # which else it reaches: 1/2 g h^2 is 49 mm


def test_properties_of_pairs_are_products():
    scene = Scene(
        surfaces=(Plane(restitution=0.5, friction=0.25),), restitution=(0.8,), friction=(0.6,)
    )
    contacts = aim_contacts(scene)
    law = Law(World.of(replace(scene, radius=2.0), 1), contacts, 0.1, 0.1)
    assert law.restitution.item() == pytest.approx(0.4)
    assert law.friction.item() == pytest.approx(0.15)
    assert law.rolling.item() == pytest.approx(0.04)


def aim_contacts(scene):
    one, zero = torch.tensor([1]), torch.zeros(1, dtype=torch.float64)
    up = torch.tensor([[0.0, 0, 1]], dtype=torch.float64)
    return Contacts(0 * one, one, 0 * one, zero + 1.0, up, zero, zero, zero, zero, zero - G)
