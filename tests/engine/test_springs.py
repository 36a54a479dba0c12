# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Blows by springs: closed forms, what holds with any network after them, and what they leave."""

from dataclasses import asdict, replace
import math

import numpy as np
import pytest
from rigid_gns_core.engine.learned_network import network_of
from rigid_gns_core.engine.learned_stepper import LearnedStepper
from rigid_gns_core.engine.options import LawsOptions, ResidualConfig
from rigid_gns_core.engine.stepper import EngineStepper
from rigid_gns_core.files.checkpoint import tensors_of
from rigid_gns_core.networks.residual import ResidualNetwork
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.state import State, Trajectory
from rigid_gns_core.studies.hard_cases.cases import hard_cases
from rigid_gns_core.studies.hard_cases.checks import measure_laws
from scipy.integrate import solve_ivp
import torch

CONFIG = ResidualConfig(width=16, vectors=3)
OPTIONS = asdict(LawsOptions())
GRAVITY = 9.81
STIFFNESS = 30000.0
"""Contacts of 18 ms where a frame is 100 ms."""


def springs(size, stiffness=STIFFNESS, restitution=1.0, friction=1.0, ratio=0.8, seed=0):
    """Weights with springs, and with a random network of so large outputs."""
    torch.manual_seed(seed)
    network = ResidualNetwork(CONFIG)
    with torch.no_grad():
        network.out.weight.mul_(size)
        network.stiffness.fill_(stiffness)
        network.springs.copy_(torch.tensor([stiffness, restitution, friction, ratio]))
    return network_of(tensors_of(network), CONFIG)


ALONE, WITH_NETWORK = springs(0.0), springs(30.0)


def stepper_of(scene, state, weights=ALONE, **options):
    return LearnedStepper(weights, scene, state, 0.1, **(OPTIONS | options))


def heap(seed=0, count=18):
    """Spheres of several radii and masses that fall onto each other in a box."""
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid([-2.1, 0, 2.1], [-2.1, 0, 2.1], [1.05, 3.1]), -1).reshape(-1, 3)
    scene = Scene(
        surfaces=Plane.box(6.4, 6.4),
        radius=tuple(rng.uniform(0.7, 1.0, count)),
        mass=tuple(rng.uniform(0.5, 2.0, count)),
        restitution=0.8,
        friction=0.6,
    )
    state = State(
        positions=grid[rng.permutation(len(grid))[:count]] + rng.uniform(-0.02, 0.02, (count, 3)),
        velocities=rng.normal(0, 3, (count, 3)),
        angular_velocities=rng.normal(0, 3, (count, 3)),
    )
    return scene, state


@pytest.mark.parametrize('restitution', [1.0, 0.6, 0.2])
def test_a_blow_has_its_restitution_and_takes_its_time(restitution):
    """A ball against a wall without gravity: it leaves at e u, and half a period late.

    The dashpot of the spring may not pull, so that it leaves a little earlier and faster than e.
    A blow begins anywhere in a step of 0.4 / sqrt(k): 5 % of its speed at most, with any e.
    """
    rate = math.sqrt(STIFFNESS)
    scene = Scene(surfaces=(Plane(),), gravity=(0, 0, 0), restitution=restitution**0.5)
    start = State(positions=[[0, 0, 1.15]], velocities=[[0, 0, -3.0]])
    after = stepper_of(scene, start).frame().after

    def pushed(_, y):
        share = -math.log(restitution) / math.hypot(math.pi, math.log(restitution))
        push = max(0.0, -STIFFNESS * y[0] - 2 * share * rate * y[1]) if y[0] < 0 else 0.0
        return [y[1], push]

    true = solve_ivp(pushed, [0, 0.1], [0.15, -3.0], rtol=1e-8, atol=1e-10, max_step=1e-4).y[:, -1]
    assert after.velocities[0, 2] == pytest.approx(true[1], abs=0.06 * 3.0)
    assert after.positions[0, 2] - 1.0 == pytest.approx(true[0], abs=3.0 * 0.4 / rate)
    assert after.velocities[0, 2] == pytest.approx(3.0 * restitution, abs=0.15 * 3.0)


def test_a_chain_shares_a_blow_as_springs_in_a_row():
    """Three balls, two of which touch: the struck one moves on, by springs, which no law has."""
    scene = Scene(surfaces=(), gravity=(0, 0, 0), restitution=1.0, friction=0.0)
    places = np.array([0.0, 2.0, 4.05])
    start = State(
        positions=np.outer(places, [1, 0, 0]), velocities=[[0, 0, 0], [0, 0, 0], [-3.0, 0, 0]]
    )
    after = stepper_of(scene, start, guard=False).frame().after

    def pushed(_, y):
        overlap = np.maximum(0.0, 2.0 - np.diff(y[:3]))
        force = 0.5 * STIFFNESS * overlap
        return np.concatenate([y[3:], [-force[0], force[0] - force[1], force[1]]])

    begun = np.concatenate([places, [0, 0, -3.0]])
    true = solve_ivp(pushed, [0, 0.1], begun, rtol=1e-8, atol=1e-10, max_step=1e-4).y[:, -1]
    assert abs(true[5]) > 0.2  # rigid blows in a row would stop it
    np.testing.assert_allclose(after.velocities[:, 0], true[3:], atol=0.03)
    np.testing.assert_allclose(after.positions[:, 0], true[:3], atol=0.01)


def test_a_frame_that_begins_in_the_middle_of_a_blow_goes_on_with_it():
    """A ball 0.01 inside the floor and still: the spring throws it up at sqrt(k) 0.01."""
    scene = Scene(surfaces=(Plane(),), gravity=(0, 0, -1e-3), restitution=1.0)
    after = stepper_of(scene, State(positions=[[0, 0, 0.99]])).frame().after
    assert after.velocities[0, 2] == pytest.approx(0.01 * math.sqrt(STIFFNESS), rel=0.02)


def test_heaps_at_rest_and_flights_are_the_laws():
    scene = Scene(surfaces=Plane.box(4.0, 4.0), friction=1.0)
    rest = State(positions=[[-1.0, 0, 1.0], [1.0, 0, 1.0], [0, 0, 1.0 + np.sqrt(3)]])
    flight = State(positions=[[0, 0, 20.0]], velocities=[[1.0, 2.0, 3.0]])
    for state, box in ((rest, scene), (flight, Scene(surfaces=(Plane(),)))):
        stepper, laws = stepper_of(box, state), EngineStepper(box, state, 0.1, **OPTIONS)
        made, known = stepper.advance(5).states, laws.advance(5).states
        assert made.positions.tobytes() == known.positions.tobytes()


def test_what_springs_cannot_express_is_left_to_the_laws():
    """A blow that would overlap more than a fifth of a radius, and one on an edge."""
    plate = Scene(surfaces=(Plane(length_x=4.0, length_y=4.0),))
    fast = State(positions=[[0, 0, 1.5]], velocities=[[0, 0, -80.0]])
    edge = State(positions=[[2.5, 0, 1.0]], velocities=[[0, 0, -4.0]])
    for state in (fast, edge):
        laws = EngineStepper(plate, state, 0.1, **OPTIONS).advance(1).states
        made = stepper_of(plate, state).frame().laws
        assert np.linalg.norm(laws.velocities[0, 0] - state.velocities[0]) > 2.0  # it was struck
        np.testing.assert_array_equal(made.velocities, laws.velocities[0])


def test_momenta_of_a_free_cluster_stay():
    scene, state = heap()
    free = replace(scene, surfaces=(), gravity=(0.0, 0.0, 0.0))
    mass, radius = np.asarray(scene.mass), np.asarray(scene.radius)
    inertia = 0.4 * mass * radius**2

    def momenta(one):
        linear = mass @ one.velocities
        swing = (mass[:, None] * np.cross(one.positions, one.velocities)).sum(0)
        return np.concatenate([linear, swing + inertia @ one.angular_velocities])

    size = (mass * np.linalg.norm(state.velocities, axis=1)).sum()
    for weights, guard in ((ALONE, False), (WITH_NETWORK, True)):
        stepper = stepper_of(free, state, weights, guard=guard)
        frames = [stepper.frame() for _ in range(10)]
        assert len(frames[0].contacts.a) > 5
        now = momenta(frames[0].after if not guard else frames[-1].after)
        # without the guard, in the first frame, springs alone keep angular momentum, too
        np.testing.assert_allclose(now, momenta(state), atol=1e-9 * size)


@pytest.mark.parametrize('seed', range(3))
def test_energy_with_what_contacts_store_never_rises(seed):
    rng, (scene, state) = np.random.default_rng(seed), heap(seed)
    low, high = [math.log(3e2), 0.2, 0.0, 0.02], [math.log(2e5), 1.5, 3.0, 1.0]  # as training's
    log, *others = rng.uniform(low, high)
    weights = springs(30.0, math.exp(log), *others, seed=seed)
    mass, radius = np.asarray(scene.mass), np.asarray(scene.radius)
    stepper, totals = stepper_of(scene, state, weights), []
    for _ in range(200):
        one = stepper.advance(1).states
        energy = (
            0.5 * mass * (one.velocities**2).sum(-1)
            + 0.2 * mass * radius**2 * (one.angular_velocities**2).sum(-1)
            + GRAVITY * mass * one.positions[..., 2]
        ).sum()
        totals.append(energy + stepper.stored.sum())
        assert (np.abs(one.positions[..., :2]) < 3.2).all() and (one.positions[..., 2] > 0).all()
    assert np.diff(totals).max() <= 1e-11 * totals[0]


@pytest.mark.parametrize('name', ['elastic', 'tilted_corner', 'room_12', 'long'])
def test_bounds_of_hard_cases_hold(name):
    """Its energy may rise by what contacts store, which is less than a hundredth."""
    (case,) = hard_cases([name], quick=True)
    stepper = LearnedStepper(WITH_NETWORK, case.scene, case.start, 0.1, **OPTIONS)
    states = stepper.advance(case.steps).states
    begun = {key: values[None] for key, values in vars(case.start).items()}
    whole = {key: np.concatenate([begun[key], values]) for key, values in vars(states).items()}
    laws = measure_laws(case, Trajectory(dt=0.1, **whole))
    assert laws['finite'] and laws['inside']
