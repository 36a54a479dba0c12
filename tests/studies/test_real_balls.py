# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Benchmark of recordings, on synthetic tracks of balls that bounce in closed form."""

from __future__ import annotations

import json
from pathlib import Path

from csv_balls import RADIUS, rows_of, shots, write_csv, write_scene
from launched_balls import launched
import numpy as np
import pytest
from rigid_gns_core import ContactLaw, Plane, Scene, UserError
from rigid_gns_core.commands.cli import main
from rigid_gns_core.data.tracks import Track, TrackSet
from rigid_gns_core.files.strict_json import read_json
from rigid_gns_core.scenes.state import State
from rigid_gns_core.studies.real_balls.bullet import bullet_scene, BulletSimulator
from rigid_gns_core.studies.real_balls.described_scene import described_scene
from rigid_gns_core.studies.real_balls.recorded_sets import find_sets, halves

ABOUT = {
    'radius_m': RADIUS,
    'mass_kg': 0.0027,
    'table_plane': {'centre_at_contact': [1.0, 0.0, RADIUS], 'normal': [0.0, 0.0, 1.0]},
    'source': 'closed form',
}


def tracks(count: int, frames: int = 20, spheres: tuple[str, ...] = ('0',)) -> TrackSet:
    times = np.arange(frames) / 100.0
    places = np.ones((frames, len(spheres), 3)) * times[:, None, None]
    found = (Track(f'{k}', times, places, None, spheres) for k in range(count))
    return TrackSet(tuple(found), Scene(), 1e-3)


@pytest.mark.slow
def test_a_folder_is_fitted_judged_and_resumed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Shots with air and spin: what is fitted is better than what knows no air."""
    folder, out = tmp_path / 'balls', tmp_path / 'runs'
    folder.mkdir()
    shot = ((track.times, track.positions[:, 0]) for track in launched(8))
    write_csv(folder / 'shots.csv', rows_of(shot))
    (folder / 'shots.json').write_text(json.dumps(ABOUT | {'inertia_factor': 2 / 3}))
    command = ['benchmark', 'recordings', str(folder), '--out', str(out)]
    numbers, figures = tmp_path / 'r.json', tmp_path / 'figures'
    options = ['--json', str(numbers), '--figures', str(figures)]
    assert main([*command, *options]) == 0
    printed = capsys.readouterr()
    assert 'shots: 4 tracks fitted, 4 judged' in printed.out
    assert 'fitted: as given' in printed.err
    report = read_json(numbers)['sets']['shots']
    assert report['source'] == {'source': 'closed form'}
    assert set(report['rivals']) == {'bullet', 'vacuum', 'drag', 'fitted'}
    after = {name: own['first']['0.4']['mean_m'] for name, own in report['rivals'].items()}
    # a vacuum at 4.5 m/s is off by (drag of 4 m/s^2) t^2 / 2: 30 cm after 0.4 s, half of it as the
    # velocity is that of the window's end
    assert min(after['bullet'], after['vacuum']) > 2.5 * after['fitted']
    assert after['fitted'] < 0.06
    assert report['rivals']['fitted']['every']['0.2']['coverage_90'] is not None
    assert report['rivals']['bullet']['every']['0.2']['coverage_90'] is None
    assert report['rivals']['vacuum']['card']['parameters'].keys() >= {'contact 0.restitution'}
    assert report['rivals']['fitted']['times']['both']['p99_s'] > 0
    for name in ('shots', 'coverage'):
        assert (figures / f'{name}.png').read_bytes()[1:4] == b'PNG'
    # the scenes are those of anyone's forecasts
    data, scene = str(out / 'shots' / 'data'), str(out / 'shots' / 'fitted.yaml')
    assert main(['evaluate', '--data', data, '--scene', scene, '--horizons', '0.2']) == 0
    # what is done is not done again, and another seed is another run
    assert main([*command, '--json', str(numbers)]) == 0
    assert 'shots: done before' in capsys.readouterr().err
    assert read_json(numbers)['sets']['shots'] == report


def test_what_a_folder_lacks_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match='holds no recordings; expected NAME.csv'):
        find_sets(tmp_path)
    with pytest.raises(UserError, match='is not a folder'):
        find_sets(tmp_path / 'absent')
    csv = write_csv(tmp_path / 'shots.csv', rows_of(shots(1)))
    with pytest.raises(UserError, match=r'put shots.yaml \(a scene file\) or shots.json'):
        find_sets(tmp_path)
    csv.with_suffix('.json').write_text('{')
    with pytest.raises(UserError, match='shots.json: not JSON'):
        find_sets(tmp_path)
    csv.with_suffix('.json').write_text('{"mass_kg": 1}')
    with pytest.raises(UserError, match="has no set 'throws'; it has shots"):
        find_sets(tmp_path, ['throws'])
    assert main(['benchmark', 'recordings', str(tmp_path), '--out', str(tmp_path / 'o')]) == 2


def test_a_scene_file_goes_before_a_description(tmp_path: Path) -> None:
    csv = write_csv(tmp_path / 'shots.csv', rows_of(shots(1)))
    write_scene(tmp_path).rename(csv.with_suffix('.yaml'))
    csv.with_suffix('.json').write_text(json.dumps(ABOUT))
    (one,) = find_sets(tmp_path)
    assert one.scene == csv.with_suffix('.yaml') and one.source == {'source': 'closed form'}


def test_a_description_tells_table_and_cushions() -> None:
    about = ABOUT | {
        'table_extent': {'x': [-0.5, 2.5], 'x_width': 1.5},
        'cushions': {'x': [0.0, 2.0], 'y': [0.0, 1.0], 'nose_height_m': 0.025},
    }
    table, *cushions = described_scene(about, 'x.json').surfaces
    assert table.length_x == 3.0 and np.isinf(table.length_y)
    np.testing.assert_allclose(table.point, [1.0, 0.0, 0.0], atol=1e-12)
    assert len(cushions) == 4
    # a ball on the table touches each nose, of height 0.025, from inside
    reach = np.sqrt(RADIUS**2 - 0.005**2)
    for centre, cushion in zip(
        ([reach, 0.5], [2 - reach, 0.5], [1.0, reach], [1.0, 1 - reach]), cushions, strict=True
    ):
        off = np.array([*centre, RADIUS]) - cushion.point
        assert off @ np.asarray(cushion.normal) == pytest.approx(RADIUS, abs=1e-12)
    with pytest.raises(UserError, match='x.json: radius_m is None, expected the radius'):
        described_scene({}, 'x.json')
    with pytest.raises(UserError, match='x.json: surfaces cannot be read'):
        described_scene(ABOUT | {'table_plane': {'normal': 'up'}}, 'x.json')


def test_halves_are_of_whole_tracks_and_drawn_by_the_seed() -> None:
    found = tracks(9)
    names = [one.name for one in found.tracks]
    drawn = [halves(found, seed) for seed in range(8)]
    for inside, outside in drawn:
        inner, outer = ({one.name for one in half.tracks} for half in (inside, outside))
        assert sorted(inner | outer) == names and not inner & outer
        assert len(inner) == 5
        # one of each two in a row
        assert all(len({names[k], names[k + 1]} & inner) == 1 for k in range(0, 8, 2))
    assert len({tuple(one.name for one in inside.tracks) for inside, _ in drawn}) > 4
    assert [t.name for t in halves(found, 3)[0].tracks] == [t.name for t in drawn[3][0].tracks]


def test_a_single_recording_is_halved_in_time() -> None:
    inside, outside = halves(tracks(1, frames=21, spheres=('0', '1')), 0)
    (first,), (second,) = inside.tracks, outside.tracks
    assert len(first.times) + len(second.times) == 21
    assert second.times[0] == 0.0 and second.begin == pytest.approx(0.1)
    np.testing.assert_array_equal(second.positions[0], np.full((2, 3), 0.1))


def test_bullet_gets_the_values_of_contact_laws() -> None:
    law = ContactLaw(restitution=0.7, friction=0.25, rolling_friction=0.012)
    pair = ContactLaw(restitution=0.9, friction=0.05)
    scene = Scene(surfaces=Plane(contact=law), sphere_contact=pair, radius=0.03)
    one, two = bullet_scene(scene, 1), bullet_scene(scene, 2)
    for found, count in ((one, 1), (two, 2)):
        own = found.per_sphere('restitution', count)[0]
        assert own * found.surface_values('restitution')[0] == pytest.approx(0.7)
        rub = found.per_sphere('friction', count)[0]
        assert rub * found.surface_values('friction')[0] == pytest.approx(0.25)
        assert found.rolling_friction == 0.012 and found.surfaces[0].contact is None
    assert two.per_sphere('restitution', 2)[0] ** 2 == pytest.approx(0.9)


def test_bullet_flies_without_air() -> None:
    pytest.importorskip('pybullet')
    simulator = BulletSimulator()
    scene = Scene(surfaces=(), radius=0.02)
    start = State(positions=[[0.0, 0.0, 1.0]], velocities=[[3.0, 0.0, 0.0]])
    (run,) = simulator.rollout_batch(scene, [start], 10, workers=1)
    time = 10 * simulator.native_dt(scene)
    fallen = [3.0 * time, 0.0, 1.0 - 0.5 * 9.81 * time**2]
    # Bullet computes in single precision
    np.testing.assert_allclose(run.positions[-1, 0], fallen, atol=1e-5)
