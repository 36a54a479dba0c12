# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns calibrate` of stamped positions, and what its scene is good for."""

from __future__ import annotations

import json
from pathlib import Path

from csv_balls import rows_of, SCENE, shots, write_csv
import pytest
from rigid_gns_core import load_scene
from rigid_gns_core.commands.cli import main
import yaml


@pytest.mark.slow
def test_a_scene_with_its_card_from_a_csv_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Balls that bounce in closed form, in a vacuum: restitution 0.9, which the scene has at 1."""
    tracks = shots(count=8, duration=0.7, noise=0.5e-3)
    write_csv(tmp_path / 'shots.csv', rows_of(tracks))
    given = SCENE.replace('restitution: 0.9', 'restitution: 0.8')
    (tmp_path / 'rig.yaml').write_text(given)
    arguments = ['import', str(tmp_path / 'shots.csv'), '--scene', str(tmp_path / 'rig.yaml')]
    assert main([*arguments, '--out', str(tmp_path / 'data')]) == 0
    out, told = tmp_path / 'lab.yaml', tmp_path / 'lab.json'
    calibrate = ['calibrate', '--data', str(tmp_path / 'data'), '--out', str(out)]
    figure = tmp_path / 'lab.png'
    assert main([*calibrate, '--json', str(told), '--figure', str(figure)]) == 0
    assert figure.read_bytes()[1:4] == b'PNG'
    printed = capsys.readouterr()
    assert 'contact 0.restitution' in printed.out and 'as given' in printed.err
    scene = load_scene(out)
    law = scene.surfaces[0].contact
    assert law is not None and scene.tracker is not None
    found = json.loads(told.read_text())['parameters']['contact 0.restitution']
    assert abs(found['value'] - 0.9) < 4 * found['error'] < 0.1
    card = yaml.safe_load(out.read_text())['card']
    assert card['data']['tracks'] == 8 and len(card['data']['sha256']) == 64
    first = {line['name']: line for line in card['terms']}['as given']
    assert first['every']['0.4'][1] > 5 * card['terms'][-1]['every']['0.4'][1]
    # true, or doubled, which makes the window's frames count less
    assert 0.8 < scene.tracker.noise / 0.5e-3 < 2.2
    # every region is told, and judged by tracks that neither the fit nor the region knew
    assert scene.tracker.regions is not None
    assert set(card['coverage']) == {f'{row[0]:g}' for row in scene.tracker.regions.rows}
    # the scene is one for forecasts, too
    evaluate = ['evaluate', '--data', str(tmp_path / 'data'), '--scene', str(out)]
    assert main([*evaluate, '--window', '0.2', '--horizons', '0.3', '--samples', '8']) == 0


def test_data_given_twice_and_outputs_of_one_name_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Twice, a track would be left out and fitted at once; the JSON would replace the scene."""
    write_csv(tmp_path / 'shots.csv', rows_of(shots(count=2, duration=0.3)))
    (tmp_path / 'rig.yaml').write_text(SCENE)
    data, again, out = (str(tmp_path / name) for name in ('data', 'again', 'lab.yaml'))
    for folder in (data, again):
        made = ['import', str(tmp_path / 'shots.csv'), '--scene', str(tmp_path / 'rig.yaml')]
        assert main([*made, '--out', folder]) == 0
    for others in ([data], [again]):
        assert main(['calibrate', '--data', data, *others, '--out', out]) == 2
        assert f'holds the tracks of {data}' in capsys.readouterr().err
    assert main(['calibrate', '--data', data, '--out', out, '--json', out]) == 2
    assert '--out, --json and --figure name one file' in capsys.readouterr().err
    assert not Path(out).exists()


@pytest.mark.parametrize('command', ['calibrate', 'import'])
def test_a_file_where_a_folder_should_be_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    write_csv(tmp_path / 'shots.csv', rows_of(shots(count=2, duration=0.3)))
    (tmp_path / 'rig.yaml').write_text(SCENE)
    source = ['--data', 'data']
    if command == 'import':
        source = [str(tmp_path / 'shots.csv'), '--scene', str(tmp_path / 'rig.yaml')]
    out = tmp_path / 'shots.csv' / 'deep' / 'lab'
    assert main([command, *source, '--out', str(out)]) == 2
    told = f'{out} cannot be written: {tmp_path / "shots.csv"} is no folder'
    assert told in capsys.readouterr().err
