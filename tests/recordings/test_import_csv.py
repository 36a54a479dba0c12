# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns import` of CSV files: what comes out, and what is wrong with bad ones."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from csv_balls import bounces, RADIUS, RATE, Row, rows_of, shots, write_csv, write_scene
import numpy as np
import pytest
from rigid_gns_core.commands.cli import main
from rigid_gns_core.data.records import Dataset
from rigid_gns_core.data.tracks import load_tracks, read_tracks, Track
from rigid_gns_core.recordings.importing.import_bags import import_bags
from rigid_gns_core.recordings.importing.options import ImportOptions
from rigid_gns_core.recordings.importing.units_and_axes import AXES, turned
from rigid_gns_core.scenes.state import quaternion_multiply, rotate_quaternions

NOISE = 0.7e-3


def changed(change: Callable[[np.ndarray], np.ndarray]) -> list[Row]:
    """Rows whose centres, shape (m, 3), are changed."""
    return rows_of((times, change(places)) for times, places in shots(noise=NOISE))


def test_a_file_becomes_a_data_set(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_csv(tmp_path / 'shots.csv', rows_of(shots(noise=NOISE)))
    scene, out = write_scene(tmp_path), tmp_path / 'data'
    assert main(['import', str(path), '--scene', str(scene), '--out', str(out)]) == 0
    printed = capsys.readouterr().out
    assert '4 tracks of 1 sphere, 724 samples, frames 5.556 ms apart' in printed
    assert f'4 tracks in {out / "tracks.h5"}\n4 records in {out}' in printed
    tracks = load_tracks(out)
    assert [track.name for track in tracks] == [f'shots_{number}' for number in range(4)]
    for track, (times, centres) in zip(tracks, shots(noise=NOISE), strict=True):
        # seven digits are written
        np.testing.assert_allclose(track.times, times, atol=1e-7)
        np.testing.assert_allclose(track.positions[:, 0], centres, atol=1e-7)
        assert track.quaternions is None
    # of 540 third differences of each track; bounces are a few outliers among them
    assert read_tracks(out).noise == pytest.approx(NOISE, rel=0.15)
    assert len(Dataset(out)) == 4, 'and what train and calibrate read'


def test_several_files_and_tracks_that_show_not_all_spheres(tmp_path: Path) -> None:
    (times, places), second = shots(2, noise=NOISE)
    rows = rows_of([(times, places)], 1)
    rows += [(*row[:4], f'{float(str(row[4])) + 5.0}', row[5]) for row in rows_of([second], 2)]
    rows = [row for row in rows if row[1] == 1 or float(str(row[2])) > 0.9]
    one = write_csv(tmp_path / 'one.csv', rows)
    two = write_csv(tmp_path / 'two.csv', rows_of(shots(1, noise=NOISE), 1))
    options = ImportOptions(scene=write_scene(tmp_path))
    first, _ = import_bags([one, two], tmp_path / 'data', options)
    assert first['records'] == [] and '10 steps of' in first['no_records']
    found = read_tracks(tmp_path / 'data')
    assert [track.spheres for track in found.tracks] == [('1', '2'), ('1',)]
    assert found.tracks[0].seen.sum(axis=0).tolist() == [181, 18]
    assert found.labels == ('1', '2')


def test_a_file_with_tracks_alone_says_so_to_others(tmp_path: Path) -> None:
    rows = rows_of(shots(1, noise=NOISE), 1) + rows_of(shots(2, noise=NOISE)[1:], 2)
    rows = [row for row in rows if (row[1] == 1) == (round(float(str(row[2])) * RATE) % 2 == 0)]
    path = write_csv(tmp_path / 'turns.csv', rows)
    import_bags([path], tmp_path / 'data', ImportOptions(scene=write_scene(tmp_path)))
    with pytest.raises(ValueError, match='holds tracks alone'):
        Dataset(tmp_path / 'data')


def test_tracks_of_files_with_one_name_are_told_apart(tmp_path: Path) -> None:
    files = []
    for seed, folder in enumerate(('monday', 'tuesday')):
        (tmp_path / folder).mkdir()
        rows = rows_of(shots(1, noise=NOISE, seed=seed))
        files.append(write_csv(tmp_path / folder / 'shots.csv', rows))
    import_bags(files, tmp_path / 'data', ImportOptions(scene=write_scene(tmp_path)))
    names = [track.name for track in load_tracks(tmp_path / 'data')]
    assert names == ['shots_0', 'shots_0~2']


@pytest.mark.parametrize('up', list(AXES))
def test_axes_are_turned_without_a_mirror(up: str) -> None:
    matrix = np.array(AXES[up], dtype=np.float64)
    assert np.linalg.det(matrix) == 1.0
    axis = np.zeros(3)
    axis['xyz'.index(up[-1])] = -1.0 if up[0] == '-' else 1.0
    np.testing.assert_array_equal(matrix @ axis, [0.0, 0.0, 1.0])


@pytest.mark.parametrize('up', list(AXES))
def test_rotations_turn_with_the_axes(tmp_path: Path, up: str) -> None:
    """A marker on the ball is where it was, seen in the new axes."""
    rng = np.random.default_rng(0)
    turns = rotate_quaternions([0.0, 0.0, 0.0, 1.0], rng.normal(size=(3, 1, 3)))
    track = Track('0', np.arange(3.0), rng.normal(size=(3, 1, 3)), turns, ('0',))
    after = turned(track, 2.0, up)
    assert after.quaternions is not None
    matrix = np.array(AXES[up], dtype=np.float64)
    for before, now in zip(turns[:, 0], after.quaternions[:, 0], strict=True):
        np.testing.assert_allclose(marker(now), matrix @ marker(before), atol=1e-12)
    np.testing.assert_allclose(after.positions, 2.0 * track.positions @ matrix.T)


def marker(quaternion: np.ndarray) -> np.ndarray:
    """Where a marker at (1, 2, 3) on the ball is."""
    there = quaternion_multiply(quaternion, [1.0, 2.0, 3.0, 0.0])
    return quaternion_multiply(there, quaternion * [-1.0, -1.0, -1.0, 1.0])[:3]


@pytest.mark.parametrize(
    ('change', 'remedy'),
    [
        (lambda p: 1000 * p, ['--scale', '0.001']),
        (lambda p: 100 * p, ['--scale', '0.01']),
        (lambda p: p / 0.3048, ['--scale', '0.3048']),
        (lambda p: p[:, [1, 2, 0]], ['--up', 'y']),
        (lambda p: p[:, [2, 0, 1]], ['--up', 'x']),
        (lambda p: p * [1, -1, -1], ['--up=-z']),
        (lambda p: 1000 * p[:, [0, 2, 1]] * [1, 1, -1], ['--scale', '0.001', '--up', 'y']),
    ],
)
def test_the_remedy_for_units_and_axes_is_the_right_one(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    change: Callable[[np.ndarray], np.ndarray],
    remedy: list[str],
) -> None:
    path, scene = write_csv(tmp_path / 'x.csv', changed(change)), write_scene(tmp_path)
    out = tmp_path / 'data'
    command = ['import', str(path), '--scene', str(scene), '--out', str(out)]
    assert main(command) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert said.startswith(f'rigid-gns import: error: {path}: ') and ' '.join(remedy) in said
    assert not out.exists()
    assert main([*command, *remedy]) == 0
    heights = np.concatenate([track.positions[:, 0, 2] for track in load_tracks(out)])
    truth = np.concatenate([places[:, 2] for _, places in shots(noise=NOISE)])
    np.testing.assert_allclose(heights, truth, atol=1e-6)


def one_sample(rows: list[Row]) -> list[Row]:
    return [row for row in rows if row[0] != 2 or row[2] == '0.0000000']


def at_rest(rows: list[Row]) -> list[Row]:
    rng = np.random.default_rng(0)
    noise = rng.normal(0.0, NOISE, (len(rows), 3)) + [0.5, 0.0, RADIUS + 3 * NOISE]
    return [(*row[:3], *noise[index]) if row[0] == 2 else row for index, row in enumerate(rows)]


def repeated(rows: list[Row]) -> list[Row]:
    """A tracker of half the rate, whose last pose is sent twice."""
    return [
        (*row[:3], *rows[index - index % 2][3:]) if row[0] == 2 and index % 2 else row
        for index, row in enumerate(rows)
    ]


def two_balls(rows: list[Row]) -> list[Row]:
    return [
        (*row[:3], float(str(row[3])) + (index % 2), *row[4:]) if row[0] == 2 else row
        for index, row in enumerate(rows)
    ]


def handed_over(rows: list[Row]) -> list[Row]:
    return [
        (*row[:3], float(str(row[3])) + 0.3 * (float(str(row[2])) > 0.5), *row[4:])
        if row[0] == 2
        else row
        for row in rows
    ]


def under_the_floor(rows: list[Row]) -> list[Row]:
    return [(*row[:5], float(str(row[5])) - 0.5) if row[0] == 2 else row for row in rows]


@pytest.mark.parametrize(
    ('spoil', 'message'),
    [
        (one_sample, r'line \d+: track bad_2 has 1 sample of a sphere, expected at least 3'),
        (at_rest, r'line \d+: track bad_2 shows no motion: .* expected at least 0.005 m.*remove'),
        (repeated, r'line \d+: track bad_2, sphere 0: \d+ of 181 samples repeat .*leave out'),
        (two_balls, r'line \d+: track bad_2, sphere 0: it is in two places.*give each its own'),
        (handed_over, r'line \d+: track bad_2, sphere 0: it jumps .* expected at most .*number'),
        (under_the_floor, r'line \d+: track bad_2, sphere 0: .*m behind surface 0 .*origin'),
    ],
)
def test_a_bad_track_has_one_line_and_nothing_is_written(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    spoil: Callable[[list[Row]], list[Row]],
    message: str,
) -> None:
    path = write_csv(tmp_path / 'bad.csv', spoil(rows_of(shots(noise=NOISE))))
    scene, out = write_scene(tmp_path), tmp_path / 'data'
    command = ['import', str(path), '--scene', str(scene), '--out', str(out)]
    with pytest.raises(ValueError, match=message):
        import_bags([path], out, ImportOptions(scene=scene))
    assert main(command) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if 'error' in line]
    assert len(lines) == 1 and '1 of 4 tracks are bad; --skip-bad leaves them out' in lines[0]
    assert sorted(one.name for one in tmp_path.iterdir()) == ['bad.csv', 'scene.yaml']
    assert main([*command, '--skip-bad']) == 0
    assert [track.name for track in load_tracks(out)] == ['bad_0', 'bad_1', 'bad_3']
    assert 'left out: ' in capsys.readouterr().out


def test_good_tracks_of_hard_motions_pass(tmp_path: Path) -> None:
    """Bounces seen by a slow camera, and a blow that starts a ball from rest."""
    times = np.arange(40) / 25.0
    bouncing = [
        (times, bounces(times, [0.0, 0.0, 0.3 + 0.2 * k], [1.0 + k, 0.0, 0.0])) for k in range(4)
    ]
    hit = np.where(times < 0.5, 0.0, 3.0 * (times - 0.5))
    struck = np.stack([hit, 0.0 * hit, np.full_like(hit, RADIUS)], axis=1)
    path = write_csv(tmp_path / 'hard.csv', rows_of([*bouncing, (times, struck)]))
    import_bags([path], tmp_path / 'data', ImportOptions(scene=write_scene(tmp_path)))
    assert len(load_tracks(tmp_path / 'data')) == 5


def turned_far_away(rows: list[Row]) -> list[Row]:
    """A frame tilted by 1.1 degrees, 20 m from its origin: the ground is 0.4 m lower there."""
    return [
        (*row[:3], float(str(row[3])) + 20.0, row[4], float(str(row[5])) - 0.02 * 20.0)
        for row in rows
    ]


def false_place(rows: list[Row]) -> list[Row]:
    """A single place that the tracker takes for the ball, 0.1 m under the lowest one."""
    lowest = min(range(len(rows)), key=lambda index: float(str(rows[index][5])))
    row = rows[lowest]
    return [*rows[:lowest], (*row[:5], float(str(row[5])) - 0.1), *rows[lowest + 1 :]]


@pytest.mark.parametrize('change', [turned_far_away, false_place])
def test_a_tilted_frame_and_a_false_place_are_left_to_the_fit(
    tmp_path: Path, change: Callable[[list[Row]], list[Row]]
) -> None:
    path = write_csv(tmp_path / 'far.csv', change(rows_of(shots(noise=NOISE))))
    import_bags([path], tmp_path / 'data', ImportOptions(scene=write_scene(tmp_path)))
    assert len(load_tracks(tmp_path / 'data')) == 4


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        ({'scene': None}, 'says nothing of its scene; give --scene'),
        ({'scale': 0.0}, 'scale is 0.0, expected a positive'),
        ({'up': 'w'}, "up is 'w', expected one of z, y, x"),
    ],
)
def test_options_are_checked(tmp_path: Path, options: dict, message: str) -> None:
    path = write_csv(tmp_path / 'x.csv', rows_of(shots(1)))
    with pytest.raises(ValueError, match=message):
        import_bags(
            [path], tmp_path / 'data', ImportOptions(**{'scene': write_scene(tmp_path), **options})
        )
    assert not (tmp_path / 'data').exists()
