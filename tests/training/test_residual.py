# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A residual network learns what the laws lack, resumes to the same bytes, and loads."""

from dataclasses import replace
import json
import warnings

import numpy as np
import pytest
from rigid_gns_core.commands.cli import main
from rigid_gns_core.data.records import Record
from rigid_gns_core.engine.options import ResidualConfig
from rigid_gns_core.errors import UserError
from rigid_gns_core.files.checkpoint import CheckpointError, tensors_of
from rigid_gns_core.networks.residual import ResidualNetwork
from rigid_gns_core.prediction.load import load_simulator
from rigid_gns_core.scenes.obstacle import Obstacle
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.state import State, Trajectory
from rigid_gns_core.training.recipes import load_recipe
from rigid_gns_core.training.residual import gate
from rigid_gns_core.training.residual.blows import states_after_blows
from rigid_gns_core.training.residual.frames import Track
from rigid_gns_core.training.residual.gate import held_out
from rigid_gns_core.training.residual.learner import (
    NothingToLearnError,
    ResidualLearner,
    ResidualTrainConfig,
)
from rigid_gns_core.training.residual.smoothing import smoothed_states
from rigid_gns_core.training.residual.springs import fit_springs
from rigid_gns_core.training.residual.stiffness import stiffness_of
from rigid_gns_core.training.train import Trainer

LAWS = Scene(surfaces=Plane.box(8.0, 8.0), restitution=0.9)
CONFIG = ResidualTrainConfig(
    model=ResidualConfig(width=8, vectors=2),
    steps=12,
    batch=4,
    validate_every=6,
    validation_steps=3,
    spring_windows=0,
    pushforward_starts=3,
    average=0.9,
    warm_up=2,
)


def bouncing(seed, restitution=0.5, frames=30, count=6):
    """Spheres in a box of another restitution than the laws are told."""
    rng = np.random.default_rng(seed)
    places = np.stack(np.meshgrid([-2.5, 0, 2.5], [-2.5, 0, 2.5]), -1).reshape(-1, 2)
    height = rng.uniform(1.5, 5.0, (count, 1))
    positions = np.concatenate([places[rng.permutation(9)[:count]], height], axis=1)
    scene = replace(LAWS, restitution=restitution)
    truth = load_simulator().rollout(
        scene, positions, rng.normal(0, 2, positions.shape), steps=frames
    )
    return Record(trajectory=truth, scene=LAWS, seed=seed)


RECORDS, HELD_OUT = [bouncing(seed) for seed in range(8)], [bouncing(20 + k) for k in range(4)]


def test_tracks_without_a_contact_are_nothing_to_learn_from():
    space = Scene(surfaces=())
    flight = load_simulator().rollout(space, [[0.0, 0, 0], [9.0, 0, 0]], steps=12)
    records = [Record(trajectory=flight, scene=space, seed=k) for k in range(3)]
    with pytest.raises(NothingToLearnError, match='no frame of the training data has a contact'):
        ResidualLearner.of(CONFIG, records)


def test_it_learns_another_restitution(tmp_path):
    """The laws bounce too high; what is left of their error must be less than two thirds."""
    config = replace(CONFIG, model=ResidualConfig(width=16, vectors=2), steps=400, batch=8)
    config = replace(config, validate_every=400, learning_rate=5e-3, pushforward_starts=20)
    trainer = Trainer(config, RECORDS, HELD_OUT, tmp_path)
    trainer.run()
    assert trainer.comparison.strength >= 0.5 and trainer.comparison.ratio < 0.8
    errors = {}
    for name, model in (('laws', 'laws'), ('residual', tmp_path / 'best')):
        simulator, found = load_simulator(model), []
        for record in HELD_OUT:
            for start in range(0, 25, 3):
                made = simulator.rollout(LAWS, steps=3, **vars(record.trajectory[start]))
                truth = record.trajectory.positions[start + 3]
                found.append(np.linalg.norm(made.positions[-1] - truth, axis=1))
        errors[name] = np.mean(found)
    assert errors['residual'] < 0.67 * errors['laws']


def test_what_does_not_win_is_switched_off(tmp_path):
    """Laws that are right leave nothing to learn, and hardly trained weights only do harm."""
    right = [replace(record, scene=replace(LAWS, restitution=0.5)) for record in HELD_OUT]
    config = replace(CONFIG, steps=1, learning_rate=0.1, warm_up=0, average=0.0)
    trainer = Trainer(config, right[:1], right, tmp_path)
    trainer.run()
    assert trainer.comparison.strength == 0 and trainer.comparison.ratio > 1
    assert 'switched off' in str(trainer.comparison)
    made, laws = (
        load_simulator(name).rollout(right[0].scene, steps=20, **vars(right[0].trajectory[0]))
        for name in (tmp_path / 'best', 'laws')
    )
    assert made.positions.tobytes() == laws.positions.tobytes()


@pytest.mark.parametrize(
    ('springs', 'network', 'both', 'strength', 'has_springs', 'ratio'),
    [
        (1.1, 1.2, 1.3, 0.0, False, 1.2),  # the best of those with a network is told
        (0.8, 0.9, 0.9, 0.0, True, 0.8),
        (0.8, 0.9, 0.6, 1.0, True, 0.6),
        (1.1, 0.7, 0.9, 1.0, False, 0.7),
        (0.8, 0.6, 0.9, 1.0, False, 0.6),
        (np.inf, 0.7, np.inf, 1.0, False, 0.7),
    ],
)
def test_springs_and_network_are_judged_alone_and_together(
    monkeypatch, springs, network, both, strength, has_springs, ratio
):
    """Errors over those of the laws; a quarter of the strength does a quarter of it."""

    def errors(weights, tracks, horizons):
        has, s = weights.springs[0] > 0, weights.strength[0]
        alone, full = (springs, both) if has else (1.0, network)
        own = full if s == 1 else alone + s * (full - alone) if np.isfinite(full) else alone
        return np.outer(1.0 + 0.1 * np.arange(len(tracks)), [own, own])

    monkeypatch.setattr(gate, 'rollout_errors', errors)
    tensors = tensors_of(ResidualNetwork(CONFIG.model))
    tensors['springs'] = np.array([3e4, 1.0, 1.0, 0.8], np.float32)
    found = gate.compare(tensors, CONFIG.model, [None] * 4, 3)
    assert (found.strength, found.springs) == (strength, has_springs)
    # of laws that win, the best of the others is told: a quarter of the network
    told = 1 + (ratio - 1) / 4 if not (strength or has_springs) else ratio
    assert found.ratio == pytest.approx(told)


def test_without_held_out_tracks_it_is_switched_off(tmp_path):
    trainer = Trainer(replace(CONFIG, steps=1), RECORDS[:1], HELD_OUT[:2], tmp_path)
    trainer.run()
    assert trainer.comparison.strength == 0
    assert 'fewer than 3 held-out tracks' in str(trainer.comparison)


def test_held_out_records_are_spread_and_leave_something_to_learn_from():
    train, rest = held_out(list(range(30)), 10)
    assert len(rest) == 6 and rest[0] == 0 and rest[-1] == 29
    assert sorted(train + rest) == list(range(30))
    assert [len(part) for part in held_out(list(range(200)), 10)] == [190, 10]
    assert [len(part) for part in held_out(list(range(5)), 10)] == [2, 3]
    assert [len(part) for part in held_out(list(range(3)), 10)] == [3, 0]


def bounces_in_csv(path, tracks=6, parts=4):
    """A ball that falls on the ground and leaves with half its speed, `parts` samples a frame."""
    lines = ['track,sphere,time,x,y,z']
    for k in range(tracks):
        time, height = np.arange(12 * parts + 1) * 0.1 / parts, 1.5 + 0.2 * k
        met = np.sqrt(2 * (height - 1.0) / 9.81)
        later = time - met
        z = np.where(
            later < 0, height - 4.905 * time**2, 1.0 + 4.905 * met * later - 4.905 * later**2
        )
        z = np.maximum(z, 1.0)
        lines += [
            f'{k},ball,{t:.5f},{0.7 * t:.5f},0,{x:.5f}' for t, x in zip(time, z, strict=True)
        ]
    path.write_text('\n'.join(lines) + '\n')


def test_command_trains_on_imported_tracks_and_says_what_they_lack(tmp_path, capsys):
    """Positions alone, at four times the rate of frames, and no validation set."""
    bounces_in_csv(tmp_path / 'lab.csv')
    scene = tmp_path / 'lab.yaml'
    scene.write_text('scene: {surfaces: [{}], radius: 1.0, restitution: 0.9}\n')
    given = ['import', str(tmp_path / 'lab.csv'), '--scene', str(scene), '--out']
    assert main([*given, str(tmp_path / 'data')]) == 0
    train = ['train', '--config', 'residual', '--scene', str(scene), '--steps', '2']
    run = [*train, '--data', str(tmp_path / 'data'), '--out', str(tmp_path / 'run')]
    capsys.readouterr()
    assert main(run) == 0
    said = capsys.readouterr()
    assert '3 of 6 trajectories are held out' in said.err
    assert 'import them again with --dt 0.025' in said.err
    assert 'the rotations of 3 of 3 spheres were not tracked' in said.err
    assert 'of the error of the laws on held-out tracks' in said.out
    assert main([*given, str(tmp_path / 'fine'), '--dt', '0.025']) == 0
    finer = [*train, '--data', str(tmp_path / 'fine'), '--out', str(tmp_path / 'finer')]
    assert main(finer) == 0
    assert 'import them again' not in capsys.readouterr().err
    score = ['evaluate', '--model', str(tmp_path / 'finer/best'), '--data', str(tmp_path / 'fine')]
    assert main([*score, '--json', str(tmp_path / 'score.json')]) == 0
    found = json.loads((tmp_path / 'score.json').read_text())['records']
    assert {one['dt'] for one in found.values()} == {0.1}


def test_spins_that_nobody_saw_are_left_to_the_laws():
    """Rotations that never change are unknown: no error of a spin is learned from them."""
    seen = replace(RECORDS[0], teacher={'engine': 'tracker'})
    poses = seen.trajectory
    still = replace(poses, quaternions=np.tile([0.0, 0, 0, 1], (*poses.positions.shape[:2], 1)))
    found = {}
    for name, record in {'turning': seen, 'unknown': replace(seen, trajectory=still)}.items():
        learner = ResidualLearner.of(replace(CONFIG, pushforward_frames=0), [record])
        found[name] = np.concatenate([frame.errors[:, 6:] for frame in learner._frames])
    assert np.abs(found['turning']).max() > 0.1 and not found['unknown'].any()


def test_resumed_run_gives_the_same_bytes(tmp_path):
    Trainer(CONFIG, RECORDS[:2], HELD_OUT, tmp_path / 'whole').run()
    for stop in (5, 9, None):
        Trainer(CONFIG, RECORDS[:2], HELD_OUT, tmp_path / 'parts').run(stop_at=stop)
    for name in ('best.safetensors', 'state.safetensors', 'best.json'):
        assert (tmp_path / 'whole' / name).read_bytes() == (tmp_path / 'parts' / name).read_bytes()


def test_card_and_weights_must_belong_together(tmp_path):
    Trainer(replace(CONFIG, steps=1), RECORDS[:1], [], tmp_path).run()
    simulator = load_simulator(tmp_path / 'best', substeps=4)
    assert simulator.kind == 'residual' and simulator.options.substeps == 4
    card = tmp_path / 'best.json'
    card.write_text(card.read_text().replace('"width": 8', '"width": 9'))
    with pytest.raises(CheckpointError, match='do not belong together'):
        load_simulator(tmp_path / 'best')


def test_other_materials_than_in_training_are_warned_of(tmp_path):
    Trainer(replace(CONFIG, steps=1), RECORDS[:1], [], tmp_path).run()
    simulator = load_simulator(tmp_path / 'best')
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        simulator.check(LAWS, 6)
    with pytest.warns(UserWarning, match='restitution of the scene is 0.5 .* laws with 0.9'):
        simulator.check(replace(LAWS, restitution=0.5), 6)


def test_shipped_recipe():
    recipe = load_recipe('residual')
    assert isinstance(recipe, ResidualTrainConfig) and recipe.model == ResidualConfig()


def test_a_step_that_is_no_part_of_a_frame_is_refused():
    record = RECORDS[0]
    other = replace(record, trajectory=replace(record.trajectory, dt=0.07))
    with pytest.raises(UserError, match='time step'):
        Track.of(other)


def test_obstacles_and_surfaces_that_move_are_refused():
    post = replace(LAWS, obstacles=Obstacle('cylinder', radius=1.0, length=2.0))
    belt = replace(LAWS, surfaces=Plane(surface_velocity=(1.0, 0.0, 0.0)))
    for scene, what in ((post, 'obstacles'), (belt, 'surfaces that move')):
        with pytest.raises(UserError, match=f'has {what}, but a residual network sees'):
            Track.of(replace(RECORDS[0], scene=scene))


def test_stiffness_of_springs_is_found():
    """A ball on a spring of 8000 / s^2, in closed form; samples resolve 89 rad/s to 4 %."""
    k, h, g = 8000.0, 0.0025, 9.81
    time, rate = np.arange(13) * h, np.sqrt(k)
    deep = g / k * (1 - np.cos(rate * time)) + 3.0 / rate * np.sin(rate * time)
    height = (1.0 - deep)[:, None, None] * [0.0, 0.0, 1.0]
    bounces = State.unchecked(height, height, height, height)
    known = np.ones((13, 1), bool)
    track = Track(Scene(surfaces=(Plane(),)), bounces, 40, bounces, known, known[0])
    assert stiffness_of([track] * 6) == pytest.approx(k, rel=0.04)
    assert stiffness_of([Track.of(RECORDS[0])]) == 0.0  # hard contacts do not overlap


def on_springs(seed, frames=30, count=6, k=20000.0, samples=4):
    """Spheres on springs of k without a dashpot, in a box, by small steps; none meets another."""
    rng = np.random.default_rng(seed)
    places = np.stack(np.meshgrid([-2.5, 0, 2.5], [-2.5, 0, 2.5]), -1).reshape(-1, 2)
    height = rng.uniform(1.5, 4.0, (count, 1))
    x = np.concatenate([places[rng.permutation(9)[:count]], height], axis=1)
    v, h, seen = np.zeros_like(x), 0.1 / samples / 100, [x.copy()]
    for step in range(frames * samples * 100):
        v[:, 2] += h * (k * np.maximum(0.0, 1.0 - x[:, 2]) - 9.81)
        x += h * v
        if step % 100 == 99:
            seen.append(x.copy())
    states = np.array(seen)
    truth = Trajectory.from_poses(
        states, np.tile([0.0, 0, 0, 1], (*states.shape[:2], 1)), 0.1 / samples
    )
    scene = Scene(surfaces=(Plane(),), restitution=1.0, friction=0.0)
    return Record(trajectory=truth, scene=scene, seed=seed, teacher={'engine': 'tracker'})


def test_springs_are_found_in_tracks_and_act_where_they_win(tmp_path):
    """Balls on springs, whose blows take 22 ms of a frame of 100; the laws know none of it.

    Samples are 25 ms apart, so that k is known to about a quarter. Springs alone must leave less
    than half of the error; a network of one step may do nothing.
    """
    train, held_out = ([on_springs(seed) for seed in range(a, b)] for a, b in ((0, 6), (6, 10)))
    config = replace(CONFIG, steps=1, spring_windows=60)
    trainer = Trainer(config, train, held_out, tmp_path)
    assert trainer.learner.network.springs[0] == pytest.approx(20000.0, rel=0.25)
    trainer.run()
    found = trainer.comparison
    assert found.springs and found.ratio < 0.5
    simulator = load_simulator(tmp_path / 'best')
    assert simulator.has_springs and simulator.strength == found.strength


def test_springs_are_not_used_where_the_laws_are_as_good():
    tracks = [
        Track.of(replace(record, scene=replace(LAWS, restitution=0.5))) for record in RECORDS
    ]
    assert not fit_springs(tracks, 40, 0).any()


def test_blows_are_completed():
    """A ball on a spring, in closed form: in the blow it has the path that it leaves on."""
    k, h, g = 200000.0, 0.004, 9.81
    rate = np.sqrt(k)
    start = 5.0
    time = (np.arange(40) - 10.6) * h
    # it falls at 5 m/s, is in contact for half a period, and flies off
    end = np.pi / rate
    inside = (time > 0) & (time < end)
    fall = 1.0 - start * time - 0.5 * g * time**2
    deep = 1.0 - start / rate * np.sin(rate * time)
    left = 1.0 + start * (time - end) - 0.5 * g * (time - end) ** 2
    height = np.where(time <= 0, fall, np.where(inside, deep, left))
    speed = np.where(time <= 0, -start - g * time, -start * np.cos(rate * time))
    speed = np.where(time < end, speed, start - g * (time - end))
    assert inside.sum() == 2

    def upwards(values):
        return values[:, None, None] * np.array([0.0, 0.0, 1.0])

    states = State.unchecked(upwards(height), upwards(height), upwards(speed), upwards(0 * speed))
    done, known = states_after_blows(Scene(surfaces=(Plane(),)), states, h)
    assert known.all()
    expected = np.where(inside, start - g * (time - end), speed)
    # gravity acts in the blow, too, where the closed form has none
    np.testing.assert_allclose(done.velocities[:, 0, 2], expected, atol=1e-9)
    expected = np.where(inside, left, height)
    np.testing.assert_allclose(done.positions[:, 0, 2], expected, atol=1e-9)


def test_smoothing_finds_states_in_flight_and_through_a_bounce():
    """In flight velocities are far better known than by differences.

    These have errors of sqrt(2) noise / h = 0.23 m/s. A bounce between two samples is not smeared
    over more than a few of them.
    """
    h, noise, bounce = 0.0125, 0.002, 0.5
    time = np.arange(80) * h
    fall = -1.0 - 9.81 * time
    after = 0.6 * (1.0 + 9.81 * bounce)
    fallen = time < bounce
    height = 1.0 + bounce + 0.5 * 9.81 * bounce**2 - time - 0.5 * 9.81 * time**2
    later = time - bounce
    height = np.where(fallen, height, 1.0 + after * later - 0.5 * 9.81 * later**2)
    velocity = np.where(fallen, fall, after - 9.81 * later)
    rng = np.random.default_rng(0)
    positions = np.stack([0.5 * time, 0 * time, height], axis=1)[:, None]
    quaternions = np.tile([0.0, 0, 0, 1.0], (80, 1, 1))
    tracked = positions + noise * rng.standard_normal(positions.shape)
    states = smoothed_states(Scene(surfaces=(Plane(),)), tracked, quaternions, h)
    error = np.linalg.norm(
        states.velocities[:, 0] - np.stack([0.5 + 0 * time, 0 * time, velocity], axis=1), axis=1
    )
    far = np.abs(later) > 4 * h
    assert error[far].mean() < 0.06
    assert np.linalg.norm(states.positions - positions, axis=-1).mean() < 1.3 * noise
