# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Values that no number holds, and terminals that know ASCII alone: one line, no traceback."""

from __future__ import annotations

import os
from pathlib import Path
import subprocess
import sys

import numpy as np
import pytest
from recorded_bags import START
from rigid_gns_core import Scene
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.commands import cli
from rigid_gns_core.files.config import ConfigError
from rigid_gns_core.files.strict_json import read_json
from rigid_gns_core.messages.poses import PoseArrayCodec
from rigid_gns_core.prediction.laws import LawsSimulator
from rigid_gns_core.running.progress import Progress
from rigid_gns_core.scenes.scene_file import load_start

PROGRAM = [sys.executable, '-m', 'rigid_gns_core.commands.cli']
DIGITS = '9' * 400
START_OF = 'scene: {}\nstart: {'
# content of a scene file, and what the error says
SCENES = [
    (f'{START_OF}length_x: .inf, length_y: 3.0}}', 'length_x is inf m, expected a length'),
    (f'{START_OF}length_x: 3.0, length_y: .nan}}', 'length_y is nan m, expected a length'),
    (f'{START_OF}length_x: -1.0, length_y: 3.0}}', 'length_x is -1 m, expected a length'),
    (f'{START_OF}gap: .inf}}', 'gap is inf m, expected a finite'),
    (f'{START_OF}at: [[0, 0, 1], [1.0e+200, 0, 1]]}}', r'at is .*, expected finite numbers'),
    (f'{START_OF}seed: -5}}', 'seed is -5, expected from 0 to 9223372036854775807'),
    (f'{START_OF}seed: {2**63}}}', 'start.seed is a whole number of 64 bits'),
    (f'{START_OF}seed: {DIGITS}}}', 'start.seed is a whole number of 1329 bits'),
    (f'{START_OF}spheres: {DIGITS}}}', 'start.spheres is a whole number of 1329 bits'),
    (f'{START_OF}spheres: {10**12}}}', 'spheres is 1000000000000, expected from 1'),
    (f'{START_OF}blocks: [{{count: [{10**9}, {10**9}, 1], corner: [0, 0, 1]}}]}}',
     'spheres is 1000000000000000000, expected from 1'),
    ('scene: {gravity: 1.0e+300}', r'gravity is .*, expected numbers of at most 1e\+100'),
    ('scene: {gravity: [0, 0, -1.0e+300]}', r'gravity is .*expected numbers of at most 1e\+100'),
    (f'scene: {{gravity: {DIGITS}}}', 'scene.gravity is a number too large for a double'),
    (f'scene: {{gravity: [0, 0, {DIGITS}]}}', 'is a whole number of 1329 bits'),
    (f'scene: {{radius: {DIGITS}}}', 'scene.radius .*is a whole number of 1329 bits'),
    ('scene: {radius: 1.0e+200}', r'radius is 1e\+200, expected .* at most 1e\+100'),
    ('scene: {mass: 1.0e+300}', r'mass is 1e\+300, expected .* at most 1e\+100'),
    (f'scene: {{surfaces: [{{point: [0, 0, {DIGITS}]}}]}}', r'point\[2\] is a whole number of'),
    ('scene: {surfaces: [{normal: [0, 0, 1.0e+300]}]}', 'normal of a plane is .*at most'),
    ('scene: {gravity: 2020-99-01}', 'not valid YAML: month must be in'),
    (f'scene: {{radius: {"9" * 5000}}}', 'not valid YAML: Exceeds the limit'),
    ('scene: ' + '[' * 5000, 'not valid YAML: it is nested too deeply'),
]  # fmt: skip


@pytest.mark.parametrize(('text', 'said'), SCENES, ids=range(len(SCENES)))
def test_scenes_beyond_numbers_are_refused(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / 'a.yaml').write_text(text)
    with pytest.raises(ConfigError, match=said) as error:
        load_start(tmp_path / 'a.yaml')
    assert len(str(error.value)) < 400


@pytest.mark.parametrize('gravity', [10**400, [0.0, 0.0, 10**400], 1e300])
def test_scenes_in_python_are_refused(gravity: object) -> None:
    with pytest.raises(ValueError, match=r'gravity is .*(too large for a double|at most 1e\+100)'):
        Scene(gravity=gravity)  # type: ignore[arg-type]


OPTIONS = [
    (['rollout', '--seed', '-5', '--out', 'a.h5'], "--seed: '-5', expected a whole number from 0"),
    (['rollout', '--seed', str(2**64), '--out', 'a.h5'], "--seed: '18446744073709551616', exp"),
    (['rollout', '--samples', DIGITS, '--out', 'a.h5'], "--samples: '9999"),
    (['train', '--seed', '-5'], "--seed: '-5'"),
    (['fuzz', '--seed', str(2**63)], "--seed: '9223372036854775808'"),
    (['hard-cases', '--seed', '-5'], "--seed: '-5'"),
    (['closed-forms', '--radius', '-1'], "--radius: '-1', expected a length greater than 0"),
    (['closed-forms', '--radius', 'nan'], "--radius: 'nan', expected a length greater than 0"),
    (
        ['evaluate', 'a', '--figure', 'a.txt'],
        "--figure: 'a.txt', expected a name that ends in .png",
    ),
    (
        ['calibrate', '--data', 'a', '--out', 'b', '--figure', 'a'],
        "--figure: 'a', expected a name",
    ),
]


@pytest.mark.parametrize(('words', 'said'), OPTIONS, ids=[' '.join(w)[:30] for w, _ in OPTIONS])
def test_options_beyond_numbers_are_named(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        cli.main(words)
    assert caught.value.code == cli.BAD_INPUT
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ('steps', 'said'), [(10**12, 'needs more memory than there is'), (10**26, 'at most 10000000')]
)
def test_rollouts_beyond_memory_are_refused(
    tmp_path: Path, steps: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ['rollout', '--steps', str(steps), '--out', str(tmp_path / 'a.h5')]
    assert cli.main(words) == cli.BAD_INPUT
    assert said in capsys.readouterr().err.splitlines()[-1]


def run_in_ascii(*words: str) -> subprocess.CompletedProcess[bytes]:
    """Run a command as a terminal without UTF-8 does."""
    ascii_alone = {'PYTHONIOENCODING': 'ascii', 'PYTHONUTF8': '0', 'LC_ALL': 'C'}
    return subprocess.run(
        [*PROGRAM, *words],
        env={**os.environ, **ascii_alone},
        capture_output=True,
        timeout=300,
        check=False,
    )


def falling_ball(folder: Path) -> list[str]:
    """Record a ball that falls; the words of the command that scores it."""
    poses = np.array([[0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0]])
    with BagWriter(folder) as bag:
        bag.add_topic('/tracked_poses', 'geometry_msgs/msg/PoseArray', 'reliable')
        for k in range(60):
            stamp, poses[0, 2] = START + 10_000_000 * k, 2.0 - 0.5 * 9.81 * (0.01 * k) ** 2
            bag.write('/tracked_poses', PoseArrayCodec('world', 1).encode(poses, stamp), stamp)
    words = ['evaluate', str(folder), '--topic', '/tracked_poses', '--no-figure']
    return [*words, '--scene', 'box_154', '--json', str(folder.with_suffix('.json'))]


def test_an_ascii_terminal_gets_all_numbers(tmp_path: Path) -> None:
    words = falling_ball(tmp_path / 'bag')
    ascii_alone = {'PYTHONIOENCODING': 'ascii', 'PYTHONUTF8': '0', 'LC_ALL': 'C'}
    environment = {**os.environ, **ascii_alone}
    done = subprocess.run([*PROGRAM, *words], env=environment, capture_output=True, timeout=300)
    assert done.returncode == 0, done.stderr.decode()
    assert read_json(tmp_path / 'bag.json')['frames']['tracked'] == 60
    assert done.stdout.isascii() and b'numbers: ' in done.stdout


def test_a_reader_that_leaves_costs_no_numbers(tmp_path: Path) -> None:
    command = [*PROGRAM, *falling_ball(tmp_path / 'bag')]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None and process.stderr is not None
    process.stdout.close()
    said = process.stderr.read().decode()
    assert process.wait(timeout=300) == cli.NO_READER, said
    assert read_json(tmp_path / 'bag.json')['frames']['tracked'] == 60


def test_the_time_that_is_left_does_not_count_the_compiler(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    order = []
    warm_up, begin = LawsSimulator.warm_up, Progress.__init__

    def warmed(simulator: LawsSimulator) -> None:
        warm_up(simulator)
        order.append('compiled')

    def begun(*arguments: object, **options: object) -> None:
        begin(*arguments, **options)  # type: ignore[arg-type]
        order.append('begun')

    monkeypatch.setattr(LawsSimulator, 'warm_up', warmed)
    monkeypatch.setattr(Progress, '__init__', begun)
    data = str(tmp_path / 'a.h5')
    assert cli.main(['rollout', '--steps', '1', '--out', data]) == 0
    assert cli.main(['evaluate', '--data', data]) == 0
    assert order == ['compiled', 'begun'] * 2
