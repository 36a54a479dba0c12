"""README.md only says what is there: its Python runs, its commands exist, its links lead somewhere.

Commands that take minutes, or need an apt ROS, are not run here: their targets, options and
parameters are checked against the sources. `make test` is this run, and tests/ros builds with
colcon.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import re
import shlex
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from rigid_gns_core import cli

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / 'README.md').read_text(encoding='utf-8')
BLOCKS = re.findall(r'^```(\w*)\n(.*?)^```$', TEXT, re.M | re.S)
# Ways of others to install and set up, which need a network or an apt ROS.
FOREIGN = {'python3', 'pip', 'rosdep', 'colcon', '.'}


def commands() -> list[list[str]]:
    """Words of each command: lines of shell blocks, and code in the table of stages."""
    lines = [line for kind, block in BLOCKS if kind == 'sh' for line in block.splitlines()]
    lines += re.findall(r'`((?:rigid-gns|ros2 run) [^`]+)`', TEXT)
    parts = [part for line in lines for part in line.split('&&')]
    return [words for part in parts if (words := shlex.split(part, comments=True))]


def parse(words: list[str]) -> None:
    """Let the parser of a `rigid-gns` command read its options, without running it."""
    module, _ = cli.COMMANDS[words[1]]
    parser = argparse.ArgumentParser(exit_on_error=False)
    importlib.import_module(module).add_arguments(parser)
    parser.parse_args(words[2:])


def check_ros_arguments(words: list[str]) -> None:
    """`ros2 run` of a script that is installed, with parameters that its node declares."""
    assert words[:3] == ['ros2', 'run', 'rigid_gns_ros']
    setup = (ROOT / 'setup.py').read_text(encoding='utf-8')
    assert f"'{words[3]} = rigid_gns_ros." in setup
    declared = (ROOT / 'rigid_gns_ros' / 'parameters.py').read_text(encoding='utf-8')
    for parameter in (word for word in words if ':=' in word):
        name = parameter.split(':=')[0]
        assert re.search(rf"ParameterSpec\(\s*'{name}'", declared), name


@pytest.mark.parametrize('words', commands(), ids=' '.join)
def test_each_command_exists(words: list[str]) -> None:
    if words[0] == 'make':
        target = next(word for word in words[1:] if '=' not in word)
        makefile = (ROOT / 'Makefile').read_text(encoding='utf-8')
        assert re.search(rf'^{target}:.*## ', makefile, re.M)
    elif words[0] == 'rigid-gns':
        parse(words)
    elif words[0] == 'ros2':
        check_ros_arguments(words)
    else:
        assert words[0] in FOREIGN


def test_python_runs_as_printed() -> None:
    (code,) = (block for kind, block in BLOCKS if kind == 'python')
    namespace: dict = {}
    with warnings.catch_warnings():
        warnings.simplefilter('error')  # a first example has nothing to warn of
        exec(compile(code, 'README.md', 'exec'), namespace)
    trajectory = namespace['trajectory']
    shape, dt = re.search(r'# \((.*)\), ([\d.]+) s$', code, re.M).groups()
    assert trajectory.positions.shape == tuple(map(int, shape.split(',')))
    assert trajectory.dt == pytest.approx(float(dt))
    assert trajectory.diverged_at is None


# What makes a command that takes minutes or hours quick; all else is as printed.
QUICK = {
    'teacher-card': ['--quick'],
    'generate': ['--trajectories', '2', '--steps', '4'],
    'train': ['--steps', '1'],
    'rollout': ['--steps', '5'],
    'evaluate': [],
    'hard-cases': ['--quick', '--cases', 'corner', 'half_below'],
    'benchmark': ['--quick', '--scenes', 'billiards', '--no-scaling', '--no-processes'],
    'experiment': ['--budget', 'smoke', '--only', 'base'],
    'report': [],
}


def test_stages_run_as_printed(tmp_path: Path) -> None:
    """The commands of all stages, one after the other, in a folder of their own."""
    for package in ('torch', 'pybullet'):
        pytest.importorskip(package, reason='a stage needs it')
    stages = [words for words in commands() if words[0] == 'rigid-gns' and '--bag' not in words]
    assert [words[1] for words in stages] == list(QUICK)
    for words in stages:
        done = subprocess.run(
            [sys.executable, '-m', 'rigid_gns_core.cli', *words[1:], *QUICK[words[1]]],
            capture_output=True,
            text=True,
            cwd=tmp_path,
            check=False,
            env=os.environ | {'PYTHONPATH': str(ROOT)},
        )
        assert done.returncode == 0, (words, done.stderr)
    for made in ('data/boxes/0000.h5', 'runs/contact/best.safetensors', 'rollout.h5'):
        assert (tmp_path / made).is_file(), made


def test_the_measured_table_is_that_of_the_json_files() -> None:
    path = ROOT / 'benchmarks' / 'measured_table.py'
    spec = importlib.util.spec_from_file_location('measured_table', path)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    block = TEXT.split('<!-- measured: begin -->')[1].split('<!-- measured: end -->')[0]
    assert module.table() in block


def test_links_and_paths_lead_somewhere() -> None:
    links = [link for link in re.findall(r'\]\(([^)]+)\)', TEXT) if '://' not in link]
    table = [line for line in TEXT.splitlines() if line.startswith('|')]
    paths = re.findall(r'`((?:rigid_gns|config|launch)[\w/.]+)`', '\n'.join(table))
    assert links
    assert paths
    for name in links + paths:
        assert (ROOT / name).exists(), name


def test_nothing_is_left_open() -> None:
    for name in ('README.md', 'CONTRIBUTING.md', 'CHANGELOG.rst', 'docs/decisions.md'):
        text = (ROOT / name).read_text(encoding='utf-8')
        assert not re.search(r'\b(TODO|TBD|FIXME|XXX)\b|@[A-Z]+@', text), name
