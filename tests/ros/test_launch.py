# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Launch files: run where `launch` is installed, else read as syntax trees."""

from __future__ import annotations

import ast
import importlib.util
from pathlib import Path
import runpy
import sys
from unittest import mock

import pytest

FOLDER = Path(__file__).resolve().parents[2] / 'launch'
FILES = sorted(FOLDER.glob('*.py'))
ARGUMENTS = {'params_file', 'namespace', 'model', 'scene', 'record', 'start', 'horizon'}
KNOWN = ('launch', 'launch_ros', 'pathlib')
ARGUMENTS |= {'predicted_poses', 'log_level'}


def has_launch() -> bool:
    # the folder launch/ of a source tree is importable too, as an empty namespace
    return all(
        (spec := importlib.util.find_spec(name)) is not None and spec.origin is not None
        for name in ('launch', 'launch_ros')
    )


def test_names_follow_the_convention() -> None:
    assert {file.name for file in FILES} == {
        'demo_launch.py',
        'playback_launch.py',
        'simulator_launch.py',
    }


@pytest.mark.parametrize('file', FILES, ids=lambda file: file.stem)
def test_syntax(file: Path) -> None:
    tree = ast.parse(file.read_text(encoding='utf-8'), str(file))
    compile(tree, str(file), 'exec')
    functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    assert 'generate_launch_description' in functions
    texts = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}
    assert texts >= ARGUMENTS
    modules = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert all(module and module.split('.')[0] in KNOWN for module in modules)


@pytest.mark.parametrize('file', FILES, ids=lambda file: file.stem)
def test_description(file: Path) -> None:
    if not has_launch():
        pytest.skip('launch and launch_ros come with an apt installation of ROS only')
    description = runpy.run_path(str(file))['generate_launch_description']()
    assert {argument.name for argument in description.get_launch_arguments()} >= ARGUMENTS


@pytest.fixture
def arguments(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """Launch arguments as given; `launch` is stood in for where no apt ROS has brought it."""
    given: dict[str, str] = {}
    names = ('launch', 'launch.actions', 'launch.event_handlers', 'launch.events')
    names += ('launch.events.process', 'launch.launch_description_sources')
    names += ('launch.substitutions', 'launch_ros', 'launch_ros.actions')
    names += ('launch_ros.parameter_descriptions', 'launch_ros.substitutions')
    modules = {name: mock.MagicMock() for name in names}
    modules['launch.substitutions'].LaunchConfiguration = lambda name: mock.MagicMock(
        perform=lambda _: given.get(name, '')
    )
    modules['launch_ros.parameter_descriptions'].ParameterValue = lambda value, value_type: (
        value_type(value)
    )
    modules['launch_ros.actions'].Node = dict
    modules['launch.actions'].Shutdown = lambda reason: reason
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    return given


def test_arguments_become_parameters_topics_and_log_level(
    arguments: dict[str, str], tmp_path: Path
) -> None:
    nodes = runpy.run_path(str(FOLDER / 'simulator_launch.py'))['nodes']
    arguments['params_file'] = str(FOLDER.parent / 'config' / 'simulator.yaml')
    (node,) = nodes(None)
    assert node['parameters'] == [arguments['params_file']]
    assert not node['remappings'] and not node['arguments']
    arguments |= {'scene': '154', 'horizon': '2', 'use_sim_time': 'True', 'start': 'every'}
    arguments |= {'tracked_poses': '/vicon/balls', 'log_level': 'debug'}
    (node,) = nodes(None)
    overrides = {'scene': '154', 'start': 'every', 'horizon': 2.0, 'use_sim_time': True}
    assert node['parameters'][1] == overrides
    assert isinstance(node['parameters'][1]['horizon'], float)
    assert node['remappings'] == [('tracked_poses', '/vicon/balls')]
    assert node['arguments'] == ['--ros-args', '--log-level', 'debug']
    for name, bad, said in (
        ('horizon', 'long', "horizon is 'long', expected a number"),
        ('use_sim_time', '2', "use_sim_time is '2', expected true or false"),
        ('params_file', str(tmp_path / 'a.yaml'), r"params_file is '.*a\.yaml': no such file"),
    ):
        before, arguments[name] = arguments[name], bad
        with pytest.raises(RuntimeError, match=said):
            nodes(None)
        arguments[name] = before


def test_the_bag_begins_with_the_simulator_and_ends_the_launch(arguments: dict[str, str]) -> None:
    both = runpy.run_path(str(FOLDER / 'playback_launch.py'))['Playback']()
    compiling, ready = (
        mock.MagicMock(text=text) for text in (b'rigid_gns: compiling', b'[INFO] ready: laws')
    )
    assert both.on_output(compiling) is None
    assert both.on_output(ready) == [both.play]
    assert both.on_output(ready) is None  # once
    assert both.on_exit(mock.MagicMock(action=both.play), None) == ['the bag is played']
    assert both.on_exit(mock.MagicMock(action=None), None) == ['the simulator has ended']
