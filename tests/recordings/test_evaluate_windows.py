# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns evaluate --window`: forecasts from windows of tracks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from csv_balls import (
    bounces,
    GRAVITY,
    RADIUS,
    RATE,
    RESTITUTION,
    rows_of,
    shots,
    write_csv,
    write_scene,
)
import numpy as np
import pytest
from rigid_gns_core.commands.cli import main
from rigid_gns_core.data.tracks import Track
from rigid_gns_core.files.strict_json import read_json
from rigid_gns_core.recordings.importing.import_bags import import_bags
from rigid_gns_core.recordings.importing.options import ImportOptions
from rigid_gns_core.recordings.scoring.track_contacts import contacts_of
from rigid_gns_core.recordings.scoring.track_errors import Outcome, report_of
from rigid_gns_core.scenes.scene import Scene

NOISE = 0.7e-3


@pytest.fixture
def data(tmp_path: Path) -> Path:
    path = write_csv(tmp_path / 'shots.csv', rows_of(shots(20, 1.2, noise=NOISE)))
    import_bags([path], tmp_path / 'data', ImportOptions(scene=write_scene(tmp_path)))
    return tmp_path / 'data'


def evaluated(data: Path, *options: str) -> dict:
    out = data.parent / 'report.json'
    assert main(['evaluate', '--data', str(data), *options, '--json', str(out)]) == 0
    found = read_json(out)
    assert isinstance(found, dict)
    return found


def test_what_obeys_the_laws_is_forecast_within_its_regions(
    data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report = evaluated(data, '--window', '0.2', '--horizons', '0.2', '0.6', '--every', '0.1')
    assert 'after 0.6 s' in capsys.readouterr().out
    early, late = report['horizons']['0.2'], report['horizons']['0.6']
    # windows end at 0.2, 0.3, ... and the last sample is at 1.2 s
    assert (early['n'], late['n']) == (20 * 9, 20 * 5)
    # of starts in flight: sqrt(P + t^2 V) of a line through 36 samples is 2 mm after 0.2 s
    flying = early['contacts']['0']
    assert flying['median_m'] < 4e-3
    assert early['time_s'] == pytest.approx(0.2, abs=0.6 / RATE)
    # 5 standard deviations of a share of n samples, of starts 0.1 s apart that share half their
    # frames: n / 2 of them count
    spread = 5 * np.sqrt(0.25 / (flying['n'] / 2))
    assert flying['coverage_50'] == pytest.approx(0.5, abs=spread)
    assert flying['coverage_90'] > 0.9 - 0.6 * spread
    groups = [own['n'] for own in early['contacts'].values()]
    assert sum(groups) == early['n'] and len(groups) > 1


def test_the_first_window_alone_without_regions(data: Path) -> None:
    report = evaluated(data, '--window', '0.2', '--samples', '0', '--horizons', '0.4', '5')
    assert list(report['horizons']) == ['0.4'] and report['starts'] == 20
    own = report['horizons']['0.4']
    assert own['n'] == 20 and own['coverage_50'] is None
    assert own['mean_m'] <= own['p90_m'] and own['median_m'] <= own['p90_m']


def test_another_scene_and_its_errors(data: Path) -> None:
    """Without the floor a ball falls on: it is g t^2 / 2 and more below."""
    other = data.parent / 'nothing.yaml'
    other.write_text('scene: {surfaces: [], radius: 0.02}')
    with_floor = evaluated(data, '--window', '0.2', '--horizons', '0.6', '--samples', '0')
    without = evaluated(
        data, '--window', '0.2', '--horizons', '0.6', '--samples', '0', '--scene', str(other)
    )
    assert without['horizons']['0.6']['mean_m'] > 10 * with_floor['horizons']['0.6']['mean_m']
    assert without['scene']['surfaces'] == []
    # contacts are those of the track, whatever the model knows
    assert '0' not in without['horizons']['0.6']['contacts']


def test_times_of_contacts_are_found() -> None:
    times = np.arange(260) / RATE
    rng = np.random.default_rng(0)
    places = bounces(times, [0.0, 0.0, 0.5], [3.0, 0.0, 0.0]) + rng.normal(0.0, NOISE, (260, 3))
    track = Track('0', times, places[:, None], None, ('0',))
    first = np.sqrt(2 * (0.5 - RADIUS) / GRAVITY)
    truth = [first * (1 + 2 * sum(RESTITUTION**k for k in range(1, n + 1))) for n in range(3)]
    truth = [time for time in truth if time < times[-1]]
    (found,) = contacts_of(track, Scene(radius=RADIUS), np.array([RADIUS]), NOISE)
    assert len(found) == len(truth)
    assert np.abs(found - truth).max() < 1.01 / RATE, 'in its interval, or in the one beside it'


def outcomes(errors: Sequence[float], contacts: Sequence[int]) -> list[Outcome]:
    return [
        Outcome('t', '0', 0.2, 0.5, 0.5, error, count, False, share)
        for error, count, share in zip(errors, contacts, (0.2, 0.6, 0.95, None), strict=True)
    ]


def test_a_report_is_of_all_and_of_groups() -> None:
    report = report_of(outcomes([0.1, 0.2, 0.3, 0.6], [0, 1, 5, 3]), [0.5, 1.0])
    assert list(report) == ['0.5']
    own = report['0.5']
    assert (own['n'], own['mean_m'], own['median_m'], own['p90_m']) == pytest.approx(
        (4, 0.3, 0.25, 0.6)
    )
    assert (own['coverage_50'], own['coverage_90']) == pytest.approx((1 / 3, 2 / 3))
    assert [(name, one['n']) for name, one in own['contacts'].items()] == [
        ('0', 1),
        ('1', 1),
        ('3+', 2),
    ]


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        (['--window', '-1'], 'window is -1.0, expected more than 0 s'),
        (['--window', '0.2', '--every', '0'], 'every is 0.0, expected more than 0 s'),
        (['--window', '0.2', '--horizons', '3'], 'no track shows a sphere 3 s after a window'),
        (['--window', '0.001'], 'with 3 samples; the longest has 1.2 s: give a longer --window'),
        (['--window', '0.2', '--steps', '3'], '--steps goes with --data: of tracks there'),
        (['--window', '0.2', '--figure', 'x.png'], '--figure goes with --data: of tracks'),
        (['--window', '0.2', '--match'], '--match goes with --bag'),
        (['--samples', '1'], 'no samples or at least two'),
    ],
)
def test_bad_options_are_named(
    data: Path, capsys: pytest.CaptureFixture[str], options: list[str], message: str
) -> None:
    assert main(['evaluate', '--data', str(data), *options]) == 2
    assert message in capsys.readouterr().err


def test_a_ball_in_a_hand_is_told_apart_and_a_lost_one_is_not_in_the_way(tmp_path: Path) -> None:
    """Thrown up from a hand and caught in it; another ball is lost in the way of the first."""
    rate = 240.0
    up = np.arange(round(0.8 * rate)) / rate
    flight = np.stack([0.5 * up, 0 * up, 1.0 + 4.0 * up - 0.5 * GRAVITY * up**2], axis=1)
    # it goes on where the flight ends, and comes to its start and velocity again by a smooth path
    rest = np.arange(1, round(0.4 * rate)) / rate
    s = rest / rest[-1]
    begin, out = flight[-1], np.array([0.5, 0.0, 4.0 - 0.8 * GRAVITY])
    catch = begin + (s * (1 - s) ** 2)[:, None] * out * rest[-1]
    times = np.concatenate([up, up[-1] + rest])
    centres = np.concatenate([flight, catch])
    lost = [(0, 1, f'{t:.7f}', f'{0.3 + t:.7f}', 0.02, f'{2.2 - t:.7f}') for t in times[:30]]
    noise = np.random.default_rng(0).normal(0.0, NOISE, centres.shape)
    rows = rows_of([(times, centres + noise)]) + lost
    path = write_csv(tmp_path / 'thrown.csv', rows)
    scene = tmp_path / 'nothing.yaml'
    scene.write_text('scene: {surfaces: [], radius: 0.035, mass: 0.12}')
    import_bags([path], tmp_path / 'data', ImportOptions(scene=scene))
    report = evaluated(
        tmp_path / 'data', '--window', '0.2', '--every', '0.1', '--horizons', '0.2', '0.5'
    )
    for values in report['horizons'].values():
        assert values['contacts']['0']['mean_m'] < 0.03
    assert report['horizons']['0.2']['contacts']['held']['mean_m'] > 0.1
