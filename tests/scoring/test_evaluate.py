# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reports: both sides scored, summarised, written as JSON, table and picture."""

from __future__ import annotations

from dataclasses import replace
import json
from pathlib import Path

from free_fall import falling
import numpy as np
import pytest
from rigid_gns_core.commands.cli import main
from rigid_gns_core.data.records import Record, write_record
from rigid_gns_core.files.strict_json import read_json, write_json
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scoring.evaluate import evaluate, summarise
from rigid_gns_core.scoring.table import format_table

SCENE = Scene(
    surfaces=Plane.box(20.0, 20.0), restitution=0.7746, friction=0.5, rolling_friction=0.03
)


def test_both_sides_are_scored_over_the_common_time():
    report = evaluate(falling(15, offset=0.3), falling(), SCENE)
    assert report['steps'] == 12
    assert report['errors']['mse'] == pytest.approx(3 * 0.09)
    assert report['laws']['predicted'].keys() == report['laws']['reference'].keys()
    assert list(report['horizons']) == ['10']
    assert report['diverged_at'] == {'predicted': None, 'reference': None}


def test_velocities_may_be_taken_from_the_poses():
    given = evaluate(falling(), falling(), SCENE)
    poses = evaluate(
        replace(falling(), velocities=np.zeros((13, 3, 3))), falling(), SCENE, velocities='poses'
    )
    assert given['laws']['predicted']['energy_gain'] < 1e-12
    # backward differences lag by half a step: v is g dt / 2 too small, never a gain in free flight
    assert poses['laws']['predicted']['energy_gain'] < 1e-12
    assert poses['laws']['predicted'] == poses['laws']['reference']
    with pytest.raises(ValueError, match="expected 'given' or 'poses'"):
        evaluate(falling(), falling(), SCENE, velocities='measured')


def test_summary_counts_divergence_apart():
    good = evaluate(falling(offset=0.1), falling(), SCENE)
    broken = falling().positions.copy()
    broken[6:] = np.inf
    bad = evaluate(replace(falling(), positions=broken), falling(), SCENE)
    summary = summarise([good, good, bad])
    mse = summary['errors']['mse']
    assert (mse['mean'], mse['infinite'], mse['count']) == (float('inf'), 1, 3)
    assert mse['finite_mean'] == pytest.approx(0.03)
    assert summary['diverged_at']['predicted'] == {'diverged': 1, 'count': 3}
    text = format_table(summary)
    assert 'inf in 1 of 3' in text and 'predicted: 1 of 3 rollouts diverged' in text
    with pytest.raises(ValueError, match='no reports'):
        summarise([])


def test_json_is_strict_and_comes_back(tmp_path: Path):
    report = {'a': float('inf'), 'b': [-float('inf'), np.float32(0.5)], 'c': {'d': np.arange(2)}}
    write_json(tmp_path / 'new' / 'report.json', report)
    text = (tmp_path / 'new' / 'report.json').read_text()
    json.loads(text, parse_constant=lambda name: pytest.fail(f'{name} is not JSON'))
    assert read_json(tmp_path / 'new' / 'report.json') == {
        'a': float('inf'),
        'b': [-float('inf'), 0.5],
        'c': {'d': [0, 1]},
    }
    with pytest.raises(ValueError, match='not JSON compliant|NaN|nan'):
        write_json(tmp_path / 'nan.json', {'a': float('nan')})


def test_table_fits_and_names_units():
    report = evaluate(falling(40, offset=0.1), falling(40), SCENE)
    report['timing'] = {'lateness_p50_ms': 1.5, 'publishing_rate_hz': 10.0}
    text = format_table(report)
    assert max(len(line) for line in text.splitlines()) <= 100
    for words in (
        'Normalized Cumulative Energy Gain',
        'Chamfer [m²]',
        'Lateness p50 [ms]',
        'Publishing rate [Hz]',
        '10 steps, 1 s',
    ):
        assert words in text


@pytest.fixture
def data(tmp_path: Path) -> Path:
    folder = tmp_path / 'record.h5'
    write_record(folder, Record(trajectory=falling(), scene=SCENE, seed=3, name='falling'))
    return folder


def test_command_on_data(data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    pytest.importorskip('torch', reason='the model needs torch')
    pytest.importorskip('matplotlib', reason='the figure needs matplotlib')
    out, png = tmp_path / 'report.json', tmp_path / 'report.png'
    command = ['evaluate', str(data), '--steps', '6', '--json', str(out)]
    assert main([*command, '--figure', str(png)]) == 0
    printed = capsys.readouterr().out
    assert 'model laws on' in printed and 'MSE [m²]' in printed
    (report,) = read_json(out)['records'].values()
    assert report['steps'] == 6
    assert set(report['laws']['reference']) == set(report['laws']['predicted'])
    assert png.read_bytes()[:8] == b'\x89PNG\r\n\x1a\n'


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['--data', 'nosuch'], 'nosuch'),
        (['--data', '{data}', '--steps', '0'], '--steps is 0'),
        (['--data', '{data}', '--model', 'nosuch'], "no model 'nosuch'"),
        (['--data', '{data}', '--tracked', '/a'], '--tracked goes with --bag'),
        (['--bag', 'nosuch', '--steps', '5'], '--steps goes with --data'),
        (['--bag', 'nosuch', '--velocities', 'poses'], '--velocities goes with --data'),
        (['{data}', '--starts', '5'], '--starts goes with --bag'),
        (['{data}', '--match'], '--match goes with --bag'),
        (['--data', '{data}', '--reproduce'], '--reproduce goes with --bag'),
        (['--bag', 'nosuch'], 'nosuch'),
        (['nosuch'], 'nosuch: no such bag'),
    ],
)
def test_bad_input_is_one_line(
    data: Path, arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
):
    if '--model' in arguments and '--data' in arguments:
        pytest.importorskip('torch', reason='the model needs torch')
    assert main(['evaluate', *(word.format(data=data) for word in arguments)]) == 2
    error = capsys.readouterr().err
    assert message in error and 'Traceback' not in error
