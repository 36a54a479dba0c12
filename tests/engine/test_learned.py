# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What holds by construction with a residual network of any weights, and its twin in torch."""

from dataclasses import asdict

import numpy as np
import pytest
from rigid_gns_core.engine.learned_network import network_of, ResidualConfig
from rigid_gns_core.engine.learned_stepper import LearnedStepper
from rigid_gns_core.engine.options import LawsOptions
from rigid_gns_core.engine.stepper import EngineStepper
from rigid_gns_core.files.checkpoint import tensors_of
from rigid_gns_core.networks.residual import changes, ResidualNetwork
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.state import State, Trajectory
from rigid_gns_core.studies.hard_cases.cases import hard_cases
from rigid_gns_core.studies.hard_cases.checks import measure_laws
from rigid_gns_core.training.residual.frames import batch_of, Frame
from scipy.spatial.transform import Rotation
import torch

CONFIG = ResidualConfig(width=16, vectors=3)
OPTIONS = asdict(LawsOptions())
GRAVITY = 9.81


def random_network(seed=0, config=CONFIG):
    """A network that does much, and nothing sensible."""
    torch.manual_seed(seed)
    network = ResidualNetwork(config)
    with torch.no_grad():
        network.out.weight.mul_(30.0)
    return network


NETWORK = random_network()
WEIGHTS = network_of(tensors_of(NETWORK), CONFIG)


def heap(seed=0, count=18):
    """Spheres of several radii and masses that fall onto each other in a box."""
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid([-2.1, 0, 2.1], [-2.1, 0, 2.1], [1.05, 3.1]), -1).reshape(-1, 3)
    positions = grid[rng.permutation(len(grid))[:count]] + rng.uniform(-0.02, 0.02, (count, 3))
    scene = Scene(
        surfaces=Plane.box(6.4, 6.4),
        radius=tuple(rng.uniform(0.7, 1.0, count)),
        mass=tuple(rng.uniform(0.5, 2.0, count)),
        restitution=0.8,
        friction=0.6,
    )
    state = State(
        positions=positions,
        velocities=rng.normal(0, 3, (count, 3)),
        angular_velocities=rng.normal(0, 3, (count, 3)),
    )
    return scene, state


def learned(scene, state, **changes_of_options):
    return LearnedStepper(WEIGHTS, scene, state, 0.1, **(OPTIONS | changes_of_options))


@pytest.mark.parametrize('config', [CONFIG, ResidualConfig(width=20, vectors=9)])
def test_engine_and_torch_agree(config):
    """They round float32 sums in other orders: 1e-5 of changes of some m/s."""
    scene, state = heap()
    network = random_network(config=config)
    options = OPTIONS | {'guard': False, 'sleep': False}
    stepper = LearnedStepper(network_of(tensors_of(network), config), scene, state, 0.1, **options)
    frame, world = stepper.frame(), stepper.world
    assert len(frame.contacts.a) > 10
    bodies = np.stack([world.radius, world.inverse_mass, world.inverse_inertia])
    errors = np.zeros((len(state), 9))
    known = np.ones(len(state), bool)
    contacts, bodies, *_ = batch_of([Frame(frame.contacts, bodies, errors, known)])
    with torch.no_grad():
        _, velocities, spins = changes(network(contacts), contacts, bodies, 0.1)
    done = frame.after.velocities - frame.laws.velocities
    assert np.abs(done).max() > 0.5
    np.testing.assert_allclose(done, velocities, atol=1e-5)
    turned = frame.after.angular_velocities - frame.laws.angular_velocities
    np.testing.assert_allclose(turned, spins, atol=3e-5)


def test_without_contacts_it_is_the_laws():
    scene = Scene(surfaces=(Plane(),))
    state = State(positions=[[0, 0, 20.0], [5, 0, 30.0]], velocities=[[1.0, 0, 0], [0, 2.0, 3.0]])
    stepper = learned(scene, state)
    assert len(stepper.frame().contacts.a) == 0
    states = learned(scene, state).advance(10).states
    laws = EngineStepper(scene, state, 0.1, **OPTIONS).advance(10).states
    for name, values in vars(laws).items():
        assert getattr(states, name).tobytes() == values.tobytes()


@pytest.mark.parametrize('slip', [0.0, 20.0])
def test_a_bounce_is_seen_however_fast_it_slips(slip):
    """It touches the floor after 50 of 100 ms, wherever along the floor that is."""
    start = State(positions=[[0, 0, 2.0]], velocities=[[slip, 0, -20.0]])
    scene = Scene(surfaces=(Plane(),), gravity=(0.0, 0.0, 0.0))
    contacts = learned(scene, start).frame().contacts
    assert contacts.a.tolist() == [0]
    np.testing.assert_allclose(contacts.normal, [[0, 0, 1]], atol=1e-15)
    _, _, gap_then, share_of_frame, touches, *_ = contacts.features[0, 0]
    np.testing.assert_allclose([gap_then, share_of_frame, touches], [0, 0.5, 1], atol=1e-12)


def test_a_heap_at_rest_is_the_laws():
    """Its contacts have no scale, so that a network cannot shake it."""
    scene = Scene(surfaces=Plane.box(6.0, 6.0), radius=1.0)
    at_rest = State(positions=[[-1.0, 0, 1.0], [1.0, 0, 1.0], [0, 0, 1.0 + np.sqrt(3)]])
    scene = Scene(surfaces=Plane.box(4.0, 4.0), friction=1.0)
    stepper = learned(scene, at_rest)
    frames = [stepper.frame() for _ in range(5)]
    assert sum(len(frame.contacts.a) for frame in frames[1:]) == 0


def turned_about_gravity(scene, state, angle, shift):
    turn = Rotation.from_euler('z', angle)
    planes = tuple(
        Plane(
            point=turn.apply(plane.point) + shift,
            normal=turn.apply(plane.normal),
            direction=turn.apply(np.array(plane.axes[0])),
            length_x=plane.length_x,
            length_y=plane.length_y,
        )
        for plane in scene.surfaces
    )
    moved = State(
        positions=np.ascontiguousarray(turn.apply(state.positions) + shift),
        velocities=np.ascontiguousarray(turn.apply(state.velocities)),
        angular_velocities=np.ascontiguousarray(turn.apply(state.angular_velocities)),
    )
    return Scene(**(vars(scene) | {'surfaces': planes})), moved, turn


def test_it_turns_and_moves_with_the_scene():
    """One frame: what rounding makes of it grows in later ones, as contacts do."""
    scene, state = heap()
    one = learned(scene, state).frame().after
    other_scene, other_state, turn = turned_about_gravity(scene, state, 0.7, [3.0, -2.0, 5.0])
    other = learned(other_scene, other_state).frame().after
    np.testing.assert_allclose(other.velocities, turn.apply(one.velocities), atol=1e-4)
    np.testing.assert_allclose(
        other.positions, turn.apply(one.positions) + [3.0, -2.0, 5.0], atol=1e-5
    )


def test_the_order_of_spheres_does_not_matter():
    scene, state = heap()
    order = np.random.default_rng(1).permutation(len(state))
    one = learned(scene, state).frame().after
    other_scene = Scene(
        **(
            vars(scene)
            | {
                'radius': tuple(np.asarray(scene.radius)[order]),
                'mass': tuple(np.asarray(scene.mass)[order]),
            }
        )
    )
    values = {name: getattr(state, name)[order] for name in vars(state)}
    other = learned(other_scene, State(**values)).frame().after
    np.testing.assert_allclose(other.velocities, one.velocities[order], atol=1e-4)
    np.testing.assert_allclose(other.positions, one.positions[order], atol=1e-5)


def test_momenta_of_a_free_cluster_stay():
    scene, state = heap()
    free = Scene(**(vars(scene) | {'surfaces': (), 'gravity': (0.0, 0.0, 0.0)}))
    mass, radius = np.asarray(scene.mass), np.asarray(scene.radius)
    inertia = 0.4 * mass * radius**2

    def momenta(positions, velocities, spins):
        linear = mass @ velocities
        swing = (mass[:, None] * np.cross(positions, velocities)).sum(0)
        return np.concatenate([linear, swing + inertia @ spins])

    stepper = learned(free, state)
    before = momenta(state.positions, state.velocities, state.angular_velocities)
    for _ in range(10):
        after = stepper.frame().after
    assert stepper.acted >= 0
    now = momenta(after.positions, after.velocities, after.angular_velocities)
    size = (mass * np.linalg.norm(state.velocities, axis=1)).sum()
    np.testing.assert_allclose(now, before, atol=1e-9 * size)


def energies(scene, states):
    mass, radius = np.asarray(scene.mass), np.asarray(scene.radius)
    return (
        0.5 * mass * (states.velocities**2).sum(-1)
        + 0.2 * mass * radius**2 * (states.angular_velocities**2).sum(-1)
        + GRAVITY * mass * states.positions[..., 2]
    ).sum(1)


@pytest.mark.parametrize('seed', range(3))
def test_energy_never_rises_and_spheres_stay_inside(seed):
    network = network_of(tensors_of(random_network(seed)), CONFIG)
    scene, state = heap(seed)
    states = LearnedStepper(network, scene, state, 0.1, **OPTIONS).advance(400).states
    energy = energies(scene, states)
    assert np.diff(energy).max() <= 1e-11 * energy[0]
    assert (np.abs(states.positions[..., :2]) < 3.2).all()
    assert (states.positions[..., 2] > 0).all()


@pytest.mark.parametrize('name', ['elastic', 'tilted_corner', 'obstacle', 'room_12', 'long'])
def test_bounds_of_hard_cases_hold(name):
    (case,) = hard_cases([name], quick=True)
    stepper = LearnedStepper(WEIGHTS, case.scene, case.start, 0.1, **OPTIONS)
    states = stepper.advance(case.steps).states
    begun = {key: values[None] for key, values in vars(case.start).items()}
    whole = {key: np.concatenate([begun[key], values]) for key, values in vars(states).items()}
    laws = measure_laws(case, Trajectory(dt=0.1, **whole))
    assert laws['finite'] and laws['inside']
    assert laws['energy_rise'] < 1e-11  # rounding, summed over hundreds of frames


def test_soft_contacts_give_back_what_they_stored_and_no_more():
    """The energy rises in some frames, out of the stores, which nothing but its loss fills."""
    soft = random_network(1)
    soft.stiffness.fill_(8000.0)
    scene, state = heap(1)
    network = network_of(tensors_of(soft), CONFIG)
    stepper = LearnedStepper(network, scene, state, 0.1, **OPTIONS)
    start, totals, rose = energies(scene, stepper.advance(1).states)[0], [], False
    before = start
    totals.append(before + stepper.stored.sum())
    for _ in range(100):
        energy = energies(scene, stepper.advance(1).states)[0]
        rose |= energy > before + 1e-6
        before = energy
        totals.append(energy + stepper.stored.sum())
    assert rose
    assert np.diff(totals).max() <= 1e-11 * start


def changed(**values):
    """The network with other buffers."""
    tensors = tensors_of(NETWORK)
    for name, value in values.items():
        tensors[name] = np.full_like(tensors[name], value)
    return network_of(tensors, CONFIG)


def test_without_strength_it_is_the_laws():
    scene, state = heap()
    made = LearnedStepper(changed(strength=0.0), scene, state, 0.1, **OPTIONS).advance(20).states
    laws = EngineStepper(scene, state, 0.1, **OPTIONS).advance(20).states
    for name, values in vars(laws).items():
        assert getattr(made, name).tobytes() == values.tobytes()


def test_it_fades_to_the_laws_outside_of_its_range():
    """Features that all are this far above the range; deviations are 1 in the network of tests."""
    scene, state = heap()
    full = LearnedStepper(changed(), scene, state, 0.1, **OPTIONS).frame()
    assert len(full.contacts.a) > 10
    worst = np.where(full.contacts.b[:, None] < 0, [True, False], True)
    largest = np.where(worst, full.contacts.features.max(-1), -np.inf).max(-1)
    high = float(np.median(largest)) - 0.5
    stepper = LearnedStepper(changed(high=high), scene, state, 0.1, **OPTIONS)
    part = stepper.frame()
    shares = np.clip(1.0 - (largest - high), 0.0, 1.0)
    assert ((shares > 0) & (shares < 1)).any() and (shares == 0).any()
    # the network's bounds are float32
    np.testing.assert_allclose(part.contacts.scale, shares * full.contacts.scale, rtol=1e-5)
    counts = stepper.range_counts
    assert counts.contacts == len(shares)
    assert counts.faded == pytest.approx((1.0 - shares).sum(), rel=1e-5)
    assert counts.farthest == pytest.approx(largest.max() - high, rel=1e-5)
    none = LearnedStepper(changed(high=-1e3), scene, state, 0.1, **OPTIONS).frame()
    # but for the energy guard
    np.testing.assert_allclose(none.after.velocities, none.laws.velocities, atol=1e-12)


def test_weights_of_another_size_are_refused():
    with pytest.raises(ValueError, match='shape'):
        network_of(tensors_of(NETWORK), ResidualConfig(width=8, vectors=3))
    with pytest.raises(ValueError, match='unknown weight'):
        network_of(tensors_of(NETWORK) | {'extra': np.zeros(1, np.float32)}, CONFIG)
