# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node's benchmark: every part runs, and its report holds what is promised. No timings."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
import subprocess
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / 'benchmarks' / 'node' / 'node_benchmark.py'
CASES = {
    'rate': '50 spheres, 71 Hz, every, idle',
    'horizon': '50 spheres of 1 m, tracker at 10 Hz, first',
    'learn': 'one ball, throws at 240 Hz, learning',
    'soak': '50 spheres of 10 mm, 100 Hz',
}
LENGTH = ('--seconds', '2', '--minutes', '0.05')


def benchmark(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(SCRIPT), *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


@pytest.fixture(scope='module')
def report(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    path = tmp_path_factory.mktemp('benchmark') / 'report.json'
    for part, only in CASES.items():
        done = benchmark(part, '--only', only, '--json', str(path), *LENGTH)
        assert done.returncode in (0, 1), done.stderr  # 1: too slow here
        assert not done.stderr and only in done.stdout
    return path, json.loads(path.read_text(encoding='utf-8'))


@pytest.mark.slow
def test_each_part_measures_its_case(report: tuple[Path, dict[str, Any]]) -> None:
    path, content = report
    assert {part: list(cases) for part, cases in content['parts'].items()} == {
        part: [only] for part, only in CASES.items()
    }
    rate, horizon, learn, soak = (content['parts'][part][only] for part, only in CASES.items())
    for case in (rate, horizon, learn, soak):
        assert case['errors'] == len(case['first_errors'])
        # a machine with other work to do may say so
        assert all('this machine cannot keep up' in line for line in case['first_errors'])
        assert set(case['counts']) == {'published', 'late', 'skipped', 'rejected'}
        assert set(case['load_average']) == {'before', 'after'}
    assert rate['spheres'] == horizon['spheres'] == soak['spheres'] == 50
    # three throws of 0.6 s, with pauses of 0.35 s between: too few for a fit
    assert learn['throws'] >= 2 and learn['learned_scenes'] == 0 and learn['missed'] >= 0
    for case in (rate, learn, soak):
        assert case['lost_in_bag'] == case['heard_but_not_in_bag'] == 0
        assert case['in_bag'] == case['counts']['published'] > 0 and not case['bag_warnings']
        assert case['heard'] > 0
        for key in ('lateness_heard_ms', 'lateness_bag_ms', 'step_time_ms'):
            assert 0 <= case[key]['p50'] <= case[key]['p99'] <= case[key]['worst']
    assert rate['predictions_hz'] == pytest.approx(70.711, abs=0.01)
    assert soak['predictions_hz'] == pytest.approx(100.0, abs=0.1)
    for key in ('horizon_heard_ms', 'horizon_bag_ms'):
        assert 0 < horizon[key]['p50'] <= horizon[key]['worst']
    assert horizon['message_bytes'] > 50_000
    assert soak['memory_settled_bytes'] > 10**7
    assert soak['expected'] == soak['in_bag'] + soak['missed']
    assert str(path.parent) not in path.read_text(encoding='utf-8')


@pytest.mark.slow
def test_what_is_measured_is_kept(report: tuple[Path, dict[str, Any]]) -> None:
    path, content = report
    done = benchmark('soak', 'kills', '--only', '50', '--json', str(path), *LENGTH)
    assert 'recorder' in done.stdout and CASES['soak'] in done.stdout
    after = json.loads(path.read_text(encoding='utf-8'))
    assert after['parts']['soak'] == content['parts']['soak']
    assert after['parts']['kills']['made_by'] == 'benchmarks/bags/bag_kills.py'


@pytest.mark.slow
def test_figures_of_another_machine_are_not_mixed_in(
    report: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    _, content = report
    other = tmp_path / 'other.json'
    other.write_text(json.dumps(content | {'machine': {'cpu': 'abacus'}}), encoding='utf-8')
    done = benchmark('kills', '--json', str(other))
    assert done.returncode == 2 and 'another machine' in done.stderr


def test_an_unknown_part_is_an_error() -> None:
    done = benchmark('rates')
    assert done.returncode == 2 and "no part 'rates'" in done.stderr


def test_missed_steps_are_the_hosts_only_where_it_took_their_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Ten steps are missed twice, and the host took 0.08 s of the second gap of 0.11 s."""
    monkeypatch.syspath_prepend(str(SCRIPT.parent))
    parts = importlib.import_module('parts')
    steps = np.delete(np.arange(1000), [*range(200, 210), *range(600, 610)])
    polls = np.arange(100) * 10**8
    taken = np.where(polls > 6.05e9, 0.08, 0.0)
    outcome = SimpleNamespace(
        stolen=np.column_stack([polls, taken]),
        period=0.01,
        recorded=SimpleNamespace(stamps=steps * 10**7),
    )
    assert parts.of_the_host(outcome) == {
        'missed_while_host_took_time': 10,
        'taken_by_host_s': 0.08,
    }
    outcome.stolen[:, 1] /= 2  # less than half of the gap
    assert parts.of_the_host(outcome)['missed_while_host_took_time'] == 0
