# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The benchmark: its parts against closed forms, and one quick run. No timing is asserted."""

from __future__ import annotations

from dataclasses import replace
import importlib
from pathlib import Path
import sys

import numpy as np
import pytest
from rigid_gns_core.commands.cli import main
from rigid_gns_core.errors import UserError
from rigid_gns_core.files.strict_json import read_json
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.scenes.state import Array, State, Trajectory
from rigid_gns_core.studies.benchmark import fresh_process
from rigid_gns_core.studies.benchmark.accuracy import energy_rise, faults, position_errors
from rigid_gns_core.studies.benchmark.interleaved import PeerRecord, run_interleaved, timing
from rigid_gns_core.studies.benchmark.peers import all_peers, NOTES, Peer, Run
from rigid_gns_core.studies.benchmark.scaling import bouncing_box, fitted_exponent
from rigid_gns_core.studies.benchmark.scenes import bench_scenes, BenchScene, FRAME, SCENES
from rigid_gns_core.studies.benchmark.settling import frame_error, settle
from rigid_gns_core.studies.benchmark.what_ifs import height_after


def test_scenes_match_their_descriptions() -> None:
    scenes = {scene.name: scene for scene in bench_scenes()}
    assert list(scenes) == list(SCENES)
    counts = {name: len(scene.start) for name, scene in scenes.items()}
    assert 150 <= counts.pop('thesis') <= 250
    assert counts == {'box': 154, 'pile': 200, 'billiards': 16, 'flight': 1000}
    for scene in scenes.values():
        positions = scene.start.positions
        apart = np.linalg.norm(positions[:, None] - positions[None], axis=-1)
        assert apart[~np.eye(len(positions), dtype=bool)].min() > 2.0, scene.name
        for plane in scene.scene.surfaces:
            heights = (positions - plane.point) @ np.asarray(plane.normal)
            assert heights.min() > 1.0 - 1e-9, scene.name


def test_flight_has_no_contact() -> None:
    (scene,) = bench_scenes(['flight'])
    t = FRAME * np.arange(0, scene.frames + 1, 5)[:, None, None]
    start, drop = scene.start, np.array([0.0, 0.0, -9.81])
    flown = start.positions + t * start.velocities + 0.5 * t**2 * drop
    assert flown[..., 2].min() > 2.0
    assert flown[..., 2].max() < 155.0
    # they fly apart, so the nearest pair is that of the start
    assert np.linalg.norm(flown[-1][1:] - flown[-1][:-1], axis=1).min() > 3.0


def test_unknown_names_are_refused() -> None:
    with pytest.raises(ValueError, match="unknown scene 'lake', known: box"):
        bench_scenes(['lake'])
    with pytest.raises(ValueError, match="unknown peer 'drake', known: Bullet"):
        all_peers(['drake'])


def test_errors_against_a_reference() -> None:
    rng = np.random.default_rng(0)
    reference = rng.normal(size=(101, 4, 3))
    same = position_errors(reference, reference)
    assert same == {f'position_error_{frame}': 0.0 for frame in (30, 50, 100)} | {'chamfer': 0.0}
    moved = position_errors(reference + [0.3, 0.0, 0.4], reference)
    assert moved['position_error_50'] == pytest.approx(0.5)
    ended = position_errors(reference[:60], reference)
    assert ended['position_error_50'] == 0.0
    assert ended['position_error_100'] == ended['chamfer'] == float('inf')


class Script:
    """A run that returns what it was given, one entry a frame."""

    def __init__(self, frames: list[Array]) -> None:
        self._frames = iter(frames)
        self.closed = False

    def advance(self) -> Array:
        try:
            return next(self._frames)
        except StopIteration:
            raise FloatingPointError('the script is over') from None

    def close(self) -> None:
        self.closed = True


# it has 200 J to move with, though the scripts let it stay
STILL = BenchScene(
    'still',
    '',
    Scene(),
    State(positions=np.array([[0.0, 0.0, 1.0]]), velocities=np.array([[20.0, 0.0, 0.0]])),
    frames=12,
)


def scripted(name: str, frames: list[Array]) -> Peer:
    return Peer(name, name, '', lambda scene, state: Script(frames))


def test_race_marks_what_blows_up_and_keeps_what_was_before() -> None:
    stay = STILL.start.positions

    def refuse(scene: Scene, state: State) -> Run:
        raise UserError('not this scene')

    peers = [
        scripted('calm', [stay] * 12),
        scripted('short', [stay] * 7),
        scripted('nan', [stay] * 3 + [stay * np.nan] * 9),
        scripted('rising', [stay + [0.0, 0.0, 4.0 * k] for k in range(12)]),
        scripted('sinking', [stay - [0.0, 0.0, 0.4 * k] for k in range(12)]),
        scripted('dipping', [stay] * 5 + [stay - [0.0, 0.0, 1.1]] + [stay - [0.0, 0.0, 0.5]] * 6),
        Peer('picky', 'picky', '', refuse),
    ]
    records = {record.peer.name: record for record in run_interleaved(STILL, peers, repeats=2)}
    assert [len(seconds) for seconds in records['calm'].seconds] == [12, 12]
    assert [len(seconds) for seconds in records['short'].seconds] == [7, 7]
    assert len(records['calm'].positions) == 13
    assert records['picky'].refused == 'not this scene'
    assert timing(records['picky']) is None
    grave = {
        name: ' '.join(faults(STILL, record)[0])
        for name, record in records.items()
        if record.seconds
    }
    assert grave['calm'] == grave['dipping'] == ''
    assert grave['short'] == 'the script is over'
    assert grave['nan'] == 'a position is not finite'
    assert 'energy rose' in grave['rising']
    assert grave['sinking'] == '1 of 1 spheres are lost behind a surface'
    (told,) = faults(STILL, records['dipping'])[1]
    assert told == '1 of 1 centres were behind a surface, and came back'


def test_timing_is_of_repeats() -> None:
    record = PeerRecord(scripted('p', []), seconds=[[0.1, 0.3], [0.2, 0.4], [0.5, 0.5]])
    times = timing(record)
    assert times is not None
    assert times['seconds_per_frame']['median'] == pytest.approx(0.3)
    assert times['frames_per_second'] == pytest.approx(1 / 0.3)
    assert times['latency'] == {'p50': pytest.approx(0.35), 'p99': 0.5, 'worst': 0.5, 'frames': 6}


def test_energy_of_a_bouncing_sphere_does_not_rise() -> None:
    """A closed-form bounce without loss: means over frames never exceed the energy."""
    scene = replace(STILL, start=State(positions=np.array([[0.0, 0.0, 6.0]])))
    fall = np.sqrt(2 * 5.0 / 9.81)
    t = (FRAME * np.arange(101) + fall) % (2 * fall)  # since the last blow
    heights = np.sqrt(2 * 9.81 * 5.0) * t - 0.5 * 9.81 * t**2
    positions = np.stack([0 * t, 0 * t, 1.0 + heights], axis=-1)[:, None]
    assert energy_rise(scene, positions) < 0.01
    assert energy_rise(scene, positions * [1.0, 1.0, 1.2]) > 0.1


@pytest.mark.parametrize('power', [1.0, 1.15, 2.0])
def test_exponent_is_fitted_from_large_counts_alone(power: float) -> None:
    pairs = [(count, 3e-6 * count**power) for count in (1000, 3000, 10_000, 100_000)]
    assert fitted_exponent([(1, 1.0), (10, 1.0), *pairs]) == pytest.approx(power)
    assert fitted_exponent([(1, 1.0), (10, 1.0), pairs[0]]) is None


@pytest.mark.parametrize('spheres', [1, 2, 5, 10, 1000])
def test_bouncing_boxes_hold_their_spheres(spheres: int) -> None:
    scene, start = bouncing_box(spheres)
    area = scene.surfaces[3].length_y * scene.surfaces[1].length_y
    assert area == pytest.approx(20.0 * spheres)
    apart = np.linalg.norm(start.positions[:, None] - start.positions[None], axis=-1)
    assert np.where(np.eye(spheres, dtype=bool), np.inf, apart).min() > 2.0
    assert np.abs(start.positions[:, :2]).max() <= np.sqrt(area) / 2 - 1.0


def test_height_of_a_thrown_ball_is_that_of_its_parabolas() -> None:
    assert height_after(6.0, 3.0, 1.0, 10.0) == pytest.approx(4.0)  # 6 + 3 - 5
    # falls 5 m in 1 s, and rises for 0.8 s to 0.64 of that
    assert height_after(6.0, 0.0, 1.8, 10.0) == pytest.approx(1.0 + 3.2)
    assert height_after(6.0, 0.0, 2.6 + 0.64, 10.0) == pytest.approx(1.0 + 5.0 * 0.64**2)


def test_a_pile_that_lies_still_has_settled() -> None:
    """Three spheres in a row, two of which touch; the third rolls away."""
    places = np.array([[0.0, 0.0, 1.0], [2.01, 0.0, 1.0], [9.0, 0.0, 1.0]])
    frames = [places + [[0.0] * 3, [0.0] * 3, [0.3 * min(k, 4), 0.0, 0.0]] for k in range(12)]
    scene = replace(STILL, start=State(positions=places + [0.0, 0.0, 1.0]))
    record = PeerRecord(scripted('p', frames), positions=frames)
    found = settle(scene, record, None)
    assert found['at_rest'] == 1.0 and found['frame_error'] is None
    assert found['rest_time'] == pytest.approx(4 * FRAME)
    assert found['height'] == pytest.approx(1.0)
    assert found['neighbours'] == pytest.approx(2.0 / 3.0)


def test_one_frame_is_taken_from_true_states() -> None:
    steps = np.arange(100.0)[:, None, None]
    places = np.zeros((100, 1, 3)) + [0.0, 0.0, 5.0] + 0.1 * steps * [1.0, 0.0, 0.0]
    truth = Trajectory(
        positions=places,
        quaternions=np.tile([0.0, 0.0, 0.0, 1.0], (100, 1, 1)),
        velocities=np.zeros((100, 1, 3)) + [1.0, 0.0, 0.0],
        angular_velocities=np.zeros((100, 1, 3)),
        dt=FRAME,
    )

    def start(scene: Scene, state: State) -> Run:
        return Script([state.positions + FRAME * state.velocities + [0.0, 0.0, 0.25]])

    assert frame_error(STILL, Peer('p', 'p', '', start), truth) == pytest.approx(0.25)


def test_a_failed_process_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fresh_process, '__name__', 'rigid_gns_core.no_such')
    with pytest.raises(OSError, match='a process to measure failed'):
        fresh_process.memory_per_sphere(1)


def test_quick_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for package in ('pybullet', 'mujoco', 'matplotlib'):
        pytest.importorskip(package)
    command = ['benchmark', '--quick', '--cache', str(tmp_path / 'cache')]
    command += ['--json', str(tmp_path / 'b.json'), '--figures', str(tmp_path / 'figures')]
    assert main(command) == 0
    output = capsys.readouterr().out
    for word in (*SCENES, *NOTES, 'first prediction of a fresh process', 'no coefficient of rest'):
        assert word in output
    report = read_json(tmp_path / 'b.json')
    assert str(Path(sys.prefix)) not in (tmp_path / 'b.json').read_text()
    assert str(tmp_path) not in (tmp_path / 'b.json').read_text()
    assert report['machine']['versions']['mujoco']
    assert report['reference'] == 'Bullet at 24 substeps (the teacher)'
    assert {len(scene['peers']) for scene in report['scenes']} == {len(report['peers'])}
    scenes = {scene['name']: scene for scene in report['scenes']}
    for name, scene in scenes.items():
        peers = {peer['name']: peer for peer in scene['peers']}
        assert peers['laws 8']['status'] == peers['Bullet 6']['status'] == 'ok'
        assert peers['laws 8']['compared'] == 1.0
        for peer in peers.values():
            if peer['status'] == 'refused':
                continue
            times = peer['timing']['seconds_per_frame']
            assert 0 < times['p10'] <= times['median'] <= times['p90']
        for suffix in ('png', 'svg'):
            assert (tmp_path / 'figures' / f'benchmark_{name}.{suffix}').stat().st_size > 10_000
    for peer in scenes['flight']['peers']:
        if peer['family'] not in ('GNS', 'LAMMPS', 'Rapier', 'Jolt'):
            assert peer['errors']['position_error_30'] < 1e-9
    settled = {peer['name']: peer['settling'] for peer in scenes['pile']['peers']}
    assert settled['laws 8']['frame_error'] < 0.1
    assert 0.9 < settled['laws 8']['height'] < 3.0
    assert scenes['box']['peers'][0]['settling'] is None
    what_ifs = {(row['peer'], row['threads']): row for row in report['what_ifs']['rows']}
    assert what_ifs['laws 8', 1]['height_error'] < 1e-6
    assert what_ifs['MuJoCo 24', 1]['height_error'] < 3.0
    assert [row['spheres'] for row in report['scaling']['rows']] == [1, 10, 40]
    assert report['scaling']['exponent'] is None  # none of 1000 spheres
    assert report['processes']['first_prediction']['seconds']['median'] > 0
    assert list((tmp_path / 'cache').glob('bench-flight-*.npz'))


def test_the_command_is_listed() -> None:
    from rigid_gns_core.commands.cli import COMMANDS

    assert hasattr(importlib.import_module(COMMANDS['benchmark'][0]), 'run')
