# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracks: the file of a data set, and reading CSV."""

from __future__ import annotations

import os
from pathlib import Path

from csv_balls import rows_of, shots, write_csv
import numpy as np
import pytest
from rigid_gns_core.data.csv_tracks import read_csv_tracks
from rigid_gns_core.data.records import DatasetError
from rigid_gns_core.data.tracks import (
    load_tracks,
    read_tracks,
    Track,
    tracks_hash,
    TRACKS_NAME,
    TrackSet,
    write_tracks,
)
from rigid_gns_core.scenes.scene import Scene

NAN = float('nan')


def two_balls(quaternions: bool = False) -> Track:
    positions = np.arange(24.0).reshape(4, 2, 3)
    positions[1, 0] = NAN
    turns = np.tile([0.0, 0.0, 0.6, 0.8], (4, 2, 1)) if quaternions else None
    return Track('lab_7', np.array([0.0, 0.1, 0.25, 0.3]), positions, turns, ('2', '10'), 1.7e9)


@pytest.mark.parametrize('quaternions', [False, True])
def test_tracks_come_back_bit_for_bit(tmp_path: Path, quaternions: bool) -> None:
    track = two_balls(quaternions)
    origin = {'files': ['a.csv']}
    write_tracks(tmp_path, TrackSet((track, track), Scene(radius=0.02), 7e-4, origin))
    found = read_tracks(tmp_path)
    assert tracks_hash(found.tracks) == tracks_hash([track, track])
    assert (found.scene, found.noise, found.origin) == (Scene(radius=0.02), 7e-4, origin)
    (first, _) = load_tracks(tmp_path)
    assert (first.name, first.spheres, first.begin) == ('lab_7', ('2', '10'), 1.7e9)
    assert (first.quaternions is not None) == quaternions
    np.testing.assert_array_equal(first.positions, track.positions)


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r'holds no tracks, tracks.h5 is absent.*import'):
        load_tracks(tmp_path)
    path = write_tracks(tmp_path, TrackSet((two_balls(),), Scene(), 0.0))
    content = bytearray(path.read_bytes())
    content[-10] ^= 1
    path.write_bytes(content)
    with pytest.raises(DatasetError, match='checksum differs; import it again'):
        load_tracks(tmp_path)
    assert [one.name for one in tmp_path.iterdir()] == [TRACKS_NAME]


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'times': np.array([0.0, 0.1, 0.1, 0.3])}, 'track lab_7: times do not rise'),
        ({'spheres': ('2',)}, r'positions have shape \(4, 2, 3\), expected \(4, 1, 3\)'),
        ({'positions': np.full((4, 2, 3), [NAN, 0.0, 0.0])}, 'finite in part'),
    ],
)
def test_a_track_is_checked(change: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Track(**{**vars(two_balls()), **change})


def test_labels_are_in_the_order_of_numbers() -> None:
    found = TrackSet((two_balls(),), Scene(), 0.0)
    assert found.labels == ('2', '10')


def test_rows_become_frames(tmp_path: Path) -> None:
    """Rows of one time are one frame, in any order of columns; others are ignored."""
    rows = [
        ('5', 'a', 'cue', '10.0', '1', '2', '3'),
        ('5', 'a', '9', '10.0', '4', '5', '6'),
        ('', 'b', '9', '20.5', '0', '0', '0'),
        ('', 'a', '9', '10.5', '7', '8', '9'),
    ]
    path = write_csv(tmp_path / 'x.csv', rows, 'speed,track,sphere,time,x,y,z')
    first, second = read_csv_tracks(path)
    track = first.track
    assert (track.name, track.spheres, track.begin) == ('a', ('9', 'cue'), 10.0)
    np.testing.assert_array_equal(track.times, [0.0, 0.5])
    np.testing.assert_array_equal(track.positions[0], [[4, 5, 6], [1, 2, 3]])
    assert np.isnan(track.positions[1, 1]).all()
    np.testing.assert_array_equal(first.lines, [[3, 2], [5, 0]])
    assert second.track.name == 'b'


def test_rotations_are_normalised(tmp_path: Path) -> None:
    row = ('0', '0', '0.0', '0', '0', '1', '0', '0', '0.7', '0.7')
    path = write_csv(tmp_path / 'x.csv', [row], 'track,sphere,time,x,y,z,qx,qy,qz,qw')
    (one,) = read_csv_tracks(path)
    assert one.track.quaternions is not None
    np.testing.assert_allclose(one.track.quaternions, [[[0, 0, np.sqrt(0.5), np.sqrt(0.5)]]])


@pytest.mark.parametrize(
    ('row', 'values', 'message'),
    [
        (5, {3: 'nan'}, "line 7: track 0, sphere 0: x is 'nan', expected a number.*leave out"),
        (5, {5: ''}, 'line 7: track 0, sphere 0: z is empty, expected a number'),
        (5, {0: 'a\0'}, r"line 7: track or sphere is 'a\\x00', expected a name"),
        (5, {1: ' '}, "line 7: track or sphere is '', expected a name of 1 to 200 char"),
        (5, {4: '1,5'}, 'header'),
        (5, {2: '0.01'}, 'line 7: track 0, sphere 0: time goes back from .* to 0.01 s.*sort'),
        (5, {2: f'{4 / 180:.7f}'}, 'line 7: .*a second row at 0.0222222 s.*two numbers'),
    ],
)
def test_a_bad_row_is_named(tmp_path: Path, row: int, values: dict, message: str) -> None:
    rows = [list(one) for one in rows_of(shots(1))]
    for place, value in values.items():
        rows[row][place] = value
    if message == 'header':  # a comma as decimal point gives a cell too many, which is ignored
        rows[row] = rows[row][:4]
        message = 'line 7: 4 cells, expected 6'
    with pytest.raises(ValueError, match=message):
        read_csv_tracks(write_csv(tmp_path / 'bad.csv', map(tuple, rows)))


@pytest.mark.parametrize(
    ('header', 'message'),
    [
        ('track,sphere,t,x,y,z', "0 columns 'time', expected one; columns are track,.*begin"),
        ('track;sphere;time;x;y;z', 'divided by commas'),
        ('track,sphere,time,x,y,z,qx', 'has qx of a quaternion; expected all'),
        ('', 'columns are 0, 0, 0.0000000'),
    ],
)
def test_a_bad_header_is_named(tmp_path: Path, header: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_csv_tracks(write_csv(tmp_path / 'bad.csv', rows_of(shots(1)), header))


def test_a_file_without_rows_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match='holds no rows after its header'):
        read_csv_tracks(write_csv(tmp_path / 'none.csv', []))


def test_lines_without_a_value_are_none(tmp_path: Path) -> None:
    rows = rows_of(shots(1))
    (plain,) = read_csv_tracks(write_csv(tmp_path / 'a.csv', rows))
    head, *lines = (tmp_path / 'a.csv').read_text().splitlines()
    path = tmp_path / 'b.csv'
    path.write_text('\n'.join(['', '  ', head, '', lines[0], ',' * 5, *lines[1:], '   ', '']))
    (found,) = read_csv_tracks(path)
    np.testing.assert_array_equal(found.track.positions, plain.track.positions)
    assert found.lines[0, 0] == 5


def test_a_name_that_is_no_unicode_is_stored_with_marks(tmp_path: Path) -> None:
    track = Track(os.fsdecode(b'x\xff'), np.arange(2.0), np.zeros((2, 1, 3)), None, ('0',))
    write_tracks(tmp_path, TrackSet((track,), Scene(), 0.0))
    assert read_tracks(tmp_path).tracks[0].name == 'x?'
