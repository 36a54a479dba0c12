# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Generation: the same data whoever makes it, resumable, and stopped or crashed without damage."""

from __future__ import annotations

from dataclasses import replace
import io
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from rigid_gns_core.commands.cli import main
from rigid_gns_core.data.generate import generate, GenerateError
from rigid_gns_core.data.recipe import DataRecipe
from rigid_gns_core.data.records import Dataset, DatasetError, read_record, record_path
from rigid_gns_core.running.progress import Progress
from rigid_gns_core.scenes.sampling import sample_start
from rigid_gns_core.scenes.scene_file import load_start

pybullet = pytest.importorskip('pybullet', reason='generation runs Bullet')

RECIPE = DataRecipe(
    trajectories=3,
    seed=5,
    steps=4,
    spheres=(5, 10),
    height=(0.0, 5.0),
    box_side=(6.0, 10.0),
    teacher={'substeps': 4},
)


def test_workers_do_not_change_the_data(tmp_path: Path) -> None:
    alone = generate(RECIPE, tmp_path / 'alone', workers=1)
    together = generate(RECIPE, tmp_path / 'together', workers=2)
    for one, other in zip(alone, together, strict=True):
        assert one.read_bytes() == other.read_bytes()


def test_a_data_set_holds_what_the_recipe_says(tmp_path: Path) -> None:
    generate(RECIPE, tmp_path, workers=1)
    data = Dataset(tmp_path)
    assert len(data) == 3
    assert data.recipe.teacher['substeps'] == 4
    assert len(data.recipe.teacher) > 1, 'the defaults of the teacher are written out'
    for index, record in enumerate(data):
        scene, start = RECIPE.draw(index)
        assert record.scene == scene and record.seed == 5 and record.index == index
        assert record.teacher == {
            'engine': 'pybullet',
            'version': record.teacher['version'],
            **data.recipe.teacher,
        }
        assert record.trajectory.steps == 4 and record.trajectory.dt == 0.1
        # Bullet's own start: positions went through its units and back
        assert np.allclose(record.trajectory.positions[0], start.positions, atol=1e-9)


def test_a_second_run_makes_only_what_is_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = generate(RECIPE, tmp_path, workers=1)
    before = [path.read_bytes() for path in paths]
    paths[1].unlink()
    paths[2].write_bytes(before[2][:1000])
    (tmp_path / '.0002.h5.1.tmp').write_bytes(b'left by a run that was killed')
    kept = paths[0].stat().st_mtime_ns
    assert generate(RECIPE, tmp_path, workers=1) == paths
    assert [path.read_bytes() for path in paths] == before
    assert paths[0].stat().st_mtime_ns == kept
    assert '0002.h5: damaged' in capsys.readouterr().err
    assert not list(tmp_path.glob('.*.tmp'))


def test_a_set_can_grow(tmp_path: Path) -> None:
    generate(RECIPE, tmp_path, workers=1)
    generate(replace(RECIPE, trajectories=4), tmp_path, workers=1)
    assert len(Dataset(tmp_path)) == 4
    generate(replace(RECIPE, trajectories=2), tmp_path, workers=1)
    assert len(Dataset(tmp_path)) == 4, 'nothing is lost by asking for less'


def test_another_recipe_in_the_folder_is_named(tmp_path: Path) -> None:
    generate(RECIPE, tmp_path, workers=1)
    changed = replace(RECIPE, friction=0.1, teacher={'substeps': 8})
    with pytest.raises(DatasetError) as error:
        generate(changed, tmp_path, workers=1)
    assert 'friction: 0.5 in the folder, 0.1 now' in str(error.value)
    assert 'teacher.substeps: 4 in the folder, 8 now' in str(error.value)
    (tmp_path / 'recipe.yaml').unlink()
    with pytest.raises(DatasetError, match='holds trajectories but no recipe'):
        generate(RECIPE, tmp_path, workers=1)


@pytest.mark.parametrize('workers', [1, 2])
def test_a_failed_trajectory_is_named(tmp_path: Path, workers: int) -> None:
    # one layer of 10 spheres, half a metre apart, has no room in a box of 6 m
    recipe = replace(RECIPE, spheres=(10, 10), height=(0.0, 2.5), box_side=(6.0, 6.5), gap=0.5)
    with pytest.raises(GenerateError, match=r'trajectory \d of seed 5: SamplingError: only \d'):
        generate(recipe, tmp_path, workers=workers)


def test_a_worker_that_dies_is_reported(tmp_path: Path) -> None:
    script = tmp_path / 'kill.py'
    script.write_text(
        'import multiprocessing, os, signal, sys, threading, time\n'
        'from rigid_gns_core.data.generate import generate\n'
        'from rigid_gns_core.data.recipe import load_recipe\n'
        'def kill():\n'
        '    while not multiprocessing.active_children():\n'
        '        time.sleep(0.05)\n'
        '    os.kill(multiprocessing.active_children()[0].pid, signal.SIGKILL)\n'
        "if __name__ == '__main__':\n"
        '    threading.Thread(target=kill).start()\n'
        '    generate(load_recipe(sys.argv[2]), sys.argv[1], workers=2)\n'
    )
    slow = tmp_path / 'slow.yaml'  # so that both workers are still at their first trajectory
    slow.write_text('base: smoke\nsteps: 20000\n')
    done = subprocess.run(
        [sys.executable, script, tmp_path / 'data', slow],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 1
    assert 'GenerateError: a worker process died at trajectory 0 or 1 of seed 0' in done.stderr


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_stopped_run_says_so_and_goes_on(tmp_path: Path, number: signal.Signals) -> None:
    folder = tmp_path / 'data'
    recipe = tmp_path / 'long.yaml'
    recipe.write_text('base: smoke\ntrajectories: 4\nsteps: 4\nteacher: {substeps: 4}\n')
    slow = tmp_path / 'slow.yaml'
    slow.write_text('base: smoke\ntrajectories: 40\nsteps: 20000\n')
    process = subprocess.Popen(
        [
            sys.executable,
            '-m',
            'rigid_gns_core.commands.cli',
            'generate',
            '--config',
            slow,
            '--out',
            folder,
            '--workers',
            '2',
        ],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + 30
    while not (folder / 'recipe.yaml').exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(1.5)  # workers are starting, or at work
    os.killpg(process.pid, number) if number == signal.SIGINT else process.send_signal(number)
    # returns when the last worker, which shares the pipe, has ended
    _, errors = process.communicate(timeout=20)
    assert process.returncode == 130, errors
    assert 'of 40 trajectories are whole' in errors and 'give the same command again' in errors
    assert [path.name for path in folder.iterdir()] == ['recipe.yaml']
    # what is there is a data set that can be continued
    (folder / 'recipe.yaml').unlink()
    assert main(['generate', '--config', str(recipe), '--out', str(folder), '--workers', '1']) == 0
    assert len(Dataset(folder)) == 4


def test_the_command_makes_a_data_set(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ['generate', '--config', 'smoke', '--out', str(tmp_path), '--workers', '1']
    assert main([*command, '--trajectories', '1']) == 0
    assert '1 trajectories of 30 steps' in capsys.readouterr().out
    assert (
        main([*command[:4], str(tmp_path / 'short'), '--trajectories', '1', '--steps', '2']) == 0
    )
    assert read_record(tmp_path / 'short' / '0000.h5').trajectory.steps == 2
    capsys.readouterr()
    for option, message in (('--steps', 'steps is 0'), ('--trajectories', 'trajectories is 0')):
        assert main([*command, option, '0']) == 2
        assert message in capsys.readouterr().err
    assert main([*command, '--poses-only']) == 2
    assert '--poses-only goes with --scene' in capsys.readouterr().err
    assert main([*command, '--workers', '0']) == 2
    assert 'workers is 0, expected at least 1' in capsys.readouterr().err
    assert main(['generate', '--config', 'nothing', '--out', str(tmp_path)]) == 2
    assert 'smoke, thesis' in capsys.readouterr().err


def test_the_command_makes_a_record_of_a_scene(tmp_path: Path) -> None:
    file = tmp_path / 'box_154.h5'
    command = [
        'generate',
        '--scene',
        'box_154',
        '--steps',
        '2',
        '--poses-only',
        '--out',
        str(file),
    ]
    assert main(command) == 0
    record = read_record(file)
    scene, start = load_start('box_154')
    assert record.scene == scene and record.name == 'box_154'
    positions = sample_start(scene, start).positions
    # float32 of values up to 150 m
    assert np.abs(record.trajectory.positions[0] - positions).max() < 1e-5
    assert main(command) == 2, 'a record is not overwritten'
    assert record_path(tmp_path, 3).name == '0003.h5'


def test_progress_is_plain_lines_where_there_is_no_terminal() -> None:
    stream = io.StringIO()
    with Progress(4, 'sweep', unit='room', initial=1, interval=0.0, stream=stream) as progress:
        progress.update(dust=0.5)
        progress.line('a cat')
        progress.update(2)
    lines = stream.getvalue().splitlines()
    assert lines[0].startswith('sweep: room 2 of 4, 00:00 elapsed') and 'dust 0.5' in lines[0]
    assert lines[1] == 'a cat'
    assert lines[2].startswith('sweep: room 4 of 4') and len(lines) == 3
