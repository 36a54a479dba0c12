# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns report` without a browser: what the page holds, and messages."""

from __future__ import annotations

import base64
import hashlib
import html
from importlib import resources
import json
from pathlib import Path
import re
from typing import Any
import zlib

import numpy as np
import pytest
from rigid_gns_core import Plane, Scene
from rigid_gns_core.commands import cli
from rigid_gns_core.data.records import Record, write_record
from rigid_gns_core.scenes.state import rotate_quaternions, rotation_between, Trajectory
from rigid_gns_core.scoring.evaluate import evaluate
from rigid_gns_core.show import Comparison, write_report
from rigid_gns_core.show.comparison import cut
from rigid_gns_core.show.report.packing import pack_positions, pack_quaternions
from rigid_gns_core.show.report.tables import leaves, tables
from rigid_gns_core.show.series import charts, penetration_depths
from rigid_gns_core.show.surfaces import focus, visible_quads

STATIC = Path(str(resources.files('rigid_gns_core.show.report') / 'static'))
SCENE = Scene(surfaces=Plane.box(20.0, 20.0))


def trajectory(speed: float = 1.0, count: int = 3, frames: int = 21) -> Trajectory:
    """Spheres that move uniformly along x and turn about z."""
    times = 0.1 * np.arange(frames)[:, None, None]
    places = np.stack([np.zeros(count), 4.0 * np.arange(count), np.ones(count)], axis=-1)
    positions = places + times * [speed, 0.0, 0.0]
    identity = np.tile([0.0, 0.0, 0.0, 1.0], (frames, count, 1))
    quaternions = rotate_quaternions(
        identity, np.broadcast_to(times * [0, 0, 2.0], positions.shape)
    )
    return Trajectory.from_poses(positions, quaternions, 0.1)


def record(path: Path, speed: float = 1.0, count: int = 3, **teacher: Any) -> Path:
    return write_record(
        path,
        Record(
            trajectory=trajectory(speed, count), scene=SCENE, seed=0, name='lane', teacher=teacher
        ),
    )


def payload_of(page: str) -> dict[str, Any]:
    return json.loads(re.search(r'id="payload">(.*?)</script>', page, re.S)[1])


def unpack(text: str, dtype: str, shape: tuple[int, ...]) -> np.ndarray:
    """Integers as the page reads them, shape (frames, n, components)."""
    flat = np.frombuffer(zlib.decompress(base64.b64decode(text)), dtype=f'<{dtype}')
    differences = flat.reshape(shape[1], shape[2], shape[0])
    levels = np.cumsum(differences, axis=2, dtype=dtype)
    return np.moveaxis(levels, 2, 0).astype(np.float64)


def test_positions_come_back_to_half_a_step() -> None:
    positions = np.random.default_rng(0).uniform(-5.0, 60.0, (30, 4, 3))
    low, high = positions.min((0, 1)), positions.max((0, 1))
    packed = pack_positions(positions, low, high)
    found = np.array(packed['offset']) + packed['scale'] * unpack(
        packed['data'], 'i2', positions.shape
    )
    assert np.abs(found - positions).max() <= 0.5001 * max(packed['scale'])
    assert max(packed['scale']) < 65.0 / 65000


def test_rotations_come_back_to_a_degree() -> None:
    wanted = trajectory().quaternions
    found = unpack(pack_quaternions(wanted)['data'], 'i1', wanted.shape)
    found /= np.linalg.norm(found, axis=-1, keepdims=True)
    assert np.linalg.norm(rotation_between(wanted, found), axis=-1).max() < np.radians(1.0)


def test_every_value_of_the_evaluation_is_in_a_table() -> None:
    report = evaluate(trajectory(1.1), trajectory(), SCENE)
    report |= {
        'timing': {'lateness_p50_ms': 0.25},
        'recording': {'scene': SCENE.to_mapping(), 'model': '<b>'},
        'notes': ['one'],
    }
    text = tables(report)
    cells = dict(re.findall(r'<td data-key="([^"]+)" title="([^"]*)"', text))
    wanted = {
        path: html.escape(repr(value) if isinstance(value, float) else str(value))
        for path, value in leaves(report)
        if not path.startswith('notes')
    }
    assert cells == wanted
    assert '<b>' not in text


def test_the_page_holds_all_it_needs_and_asks_for_nothing(tmp_path: Path) -> None:
    title = 'two </script> <b>lanes</b> {{payload}}'
    comparison = Comparison(
        title=title, scene=SCENE, predicted=trajectory(1.1), reference=trajectory()
    )
    page = write_report(tmp_path / 'new' / 'report.html', comparison).read_text('utf-8')
    assert html.escape(title) in page
    assert '<b>' not in page.split('<main>')[0]
    imports = json.loads(re.search(r'<script type="importmap">(.*?)</script>', page, re.S)[1])
    assert all(url.startswith('data:') for url in imports['imports'].values())
    markup = re.sub(r'<script.*?</script>|<!--.*?-->|<style>.*?</style>', '', page, flags=re.S)
    assert re.findall(r'(?:src|href)="([^"]*)"', markup) == ['data:,']
    assert not re.search(r'url\(|@import', re.search(r'<style>(.*?)</style>', page, re.S)[1])
    assert page.count('Permission is hereby granted') == 2  # of three.js and uPlot

    payload = payload_of(page)
    assert (payload['count'], payload['frames'], payload['dt']) == (3, 21, 0.1)
    places = payload['tracks'][1]['positions']
    found = np.array(places['offset']) + places['scale'] * unpack(places['data'], 'i2', (21, 3, 3))
    np.testing.assert_allclose(found, trajectory().positions, atol=1e-3)


def test_long_replays_keep_some_frames_and_all_of_the_curves(tmp_path: Path) -> None:
    comparison = Comparison(title='', scene=SCENE, predicted=trajectory(frames=100))
    page = write_report(tmp_path / 'a.html', comparison, max_frames=40).read_text('utf-8')
    payload = payload_of(page)
    assert (payload['frames'], round(payload['dt'], 9)) == (33 + 1, 0.3)
    assert all(len(chart['times']) == 100 for chart in payload['charts'])


def test_curves_hold_the_named_quantities() -> None:
    comparison = Comparison(
        title='',
        scene=SCENE,
        predicted=trajectory(1.5),
        reference=trajectory(1.0),
        floors={'half': trajectory(1.25)},
        recording={'lateness': (np.arange(3.0), np.array([1.0, 2.0, 3.0]))},
    )
    found = {chart['key']: chart for chart in charts(comparison)}
    curves = {c['label']: np.array(c['values']) for c in found['error']['curves']}
    times = trajectory().times[1:]
    np.testing.assert_allclose(curves['mean'][1:], 0.5 * times, rtol=1e-4)
    np.testing.assert_allclose(curves['floor: half'][1:], 0.25 * times, rtol=1e-4)
    assert curves['mean'][0] > 0  # the axis is logarithmic
    kinetic = next(c for c in found['energy']['curves'] if c['label'] == 'kinetic, reference')
    np.testing.assert_allclose(kinetic['values'], 1.5)  # three of 1 kg at 1 m/s
    horizontal = next(c for c in found['momentum']['curves'] if 'horizontal' in c['label'])
    np.testing.assert_allclose(horizontal['values'], 4.5)
    assert found['lateness']['curves'][0]['values'] == [1.0, 2.0, 3.0]


def test_penetrations_by_time() -> None:
    moving = trajectory(count=2)
    moving.positions[5, 1] = moving.positions[5, 0] + [0.0, 1.5, 0.0]  # 2 m would be touching
    moving.positions[7, 0, 2] = 0.8
    spheres, surfaces = penetration_depths(moving, SCENE)
    np.testing.assert_allclose(spheres[[4, 5, 6]], [0.0, 0.25, 0.0], atol=1e-12)
    np.testing.assert_allclose(surfaces[[6, 7, 8]], [0.0, 0.1, 0.0], atol=1e-12)


def test_what_follows_a_divergence_is_cut() -> None:
    lost = trajectory()
    lost.positions[8:] = np.nan
    found = cut(Comparison(title='', scene=SCENE, predicted=lost, reference=trajectory()))
    assert found.lost == 8 and len(found.predicted) == len(found.reference) == 8


def test_endless_surfaces_end_around_the_spheres_and_face_their_front() -> None:
    slope = Plane((5.0, 0.0, 9.0), (0.6, 0.0, 0.8), length_x=4.0, length_y=6.0)
    scene = Scene(surfaces=(*Plane.box(20.0, 30.0), slope))
    quads = visible_quads(scene, np.array([-4.0, -4.0, 0.0]), np.array([4.0, 4.0, 200.0]))
    for quad, plane in zip(quads, scene.surfaces, strict=True):
        one, other = quad.corners[1] - quad.corners[0], quad.corners[3] - quad.corners[0]
        normal = np.cross(one, other)
        np.testing.assert_allclose(normal / np.linalg.norm(normal), plane.normal, atol=1e-12)
        assert quad.endless == (plane is not slope)
    assert all(np.isfinite(quad.corners).all() for quad in quads)
    assert max(quad.corners[:, 2].max() for quad in quads[1:5]) < 10.0  # walls, to look over
    sides = np.linalg.norm(np.diff(quads[-1].corners, axis=0), axis=1)
    np.testing.assert_allclose(sides, [4.0, 6.0, 4.0])


def test_a_start_is_seen_whole_unless_it_is_far_above() -> None:
    for top, seen in ((8.0, True), (80.0, False)):
        moving = trajectory()
        moving.positions[0, 0, 2] = top
        _, high = focus([moving], SCENE)
        assert (high[2] >= top) == seen


def test_what_was_compared_has_units() -> None:
    page = tables({'dt': 0.1, 'tolerance': 1e-9})
    assert 'Time step <small>s</small>' in page and 'Tolerance <small>diameters</small>' in page


def test_from_records(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ours = record(tmp_path / 'ours.h5', 1.1, engine='rigid_gns', model='laws')
    bullet = record(tmp_path / 'bullet.h5', engine='pybullet', substeps=24)
    half = record(tmp_path / 'half.h5', 1.05, engine='pybullet', substeps=12)
    out = tmp_path / 'report.html'
    arguments = ['report', str(ours), '--reference', str(bullet), '--floor', str(half)]
    assert cli.main([*arguments, '--out', str(out)]) == 0
    assert f'report: {out}' in capsys.readouterr().out
    page = out.read_text('utf-8')
    payload = payload_of(page)
    assert payload['sides'] == ['predicted (laws)', 'Bullet']
    labels = [curve['label'] for curve in payload['charts'][0]['curves']]
    assert 'floor: half, 12 substeps' in labels
    assert 'data-key="errors.position_error"' in page
    assert cli.main(['report', str(ours), '--out', str(out)]) == 0  # alone: laws, no errors
    page = out.read_text('utf-8')
    assert payload_of(page)['sides'] == ['predicted (laws)']
    assert 'laws.predicted.energy_gain' in page and 'errors.position_error' not in page


@pytest.mark.parametrize(
    ('options', 'text'),
    [
        (['--out', 'report.pdf'], 'ends with .html'),
        (['--out', 'r.html', '--max-frames', '1'], '--max-frames is 1, expected at least 2'),
        (['--out', 'r.html', '--floor', 'one.h5'], '--floor needs a reference'),
        (['--out', 'r.html', '--reference', 'four.h5'], 'one.h5 and four.h5 do not compare'),
        (['--out', 'r.html', '--reference', 'no.h5'], 'no.h5: no such file'),
        (['--out', 'r.html', '--scene', 'box_154'], '--scene goes with a bag'),
    ],
)
def test_bad_input_is_reported_before_anything_is_written(
    options: list[str],
    text: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    record(Path('one.h5'))
    record(Path('four.h5'), count=4)
    assert cli.main(['report', 'one.h5', *options]) == 2
    assert text in capsys.readouterr().err
    assert not list(tmp_path.glob('*.html')) and not list(tmp_path.glob('*.pdf'))


def test_third_party_files_are_those_that_are_named() -> None:
    vendor = STATIC / 'vendor'
    rows = re.findall(
        r'^\| `([\w.]+)` .*`([0-9a-f]{64})` \|$', (vendor / 'README.md').read_text(), re.M
    )
    assert {name for name, _ in rows} == {path.name for path in vendor.glob('*.*s')}
    for name, checksum in rows:
        assert hashlib.sha256((vendor / name).read_bytes()).hexdigest() == checksum, name
