# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Launch files: run where `launch` is installed, else read as syntax trees."""

from __future__ import annotations

import ast
import importlib.util
from pathlib import Path
import runpy

import pytest

FOLDER = Path(__file__).resolve().parents[2] / 'launch'
FILES = sorted(FOLDER.glob('*.py'))
ARGUMENTS = {'params_file', 'namespace', 'model', 'scene', 'record'}


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
    assert all(module and module.split('.')[0] in ('launch', 'launch_ros') for module in modules)


@pytest.mark.parametrize('file', FILES, ids=lambda file: file.stem)
def test_description(file: Path) -> None:
    if not has_launch():
        pytest.skip('launch and launch_ros come with an apt installation of ROS only')
    description = runpy.run_path(str(file))['generate_launch_description']()
    assert {argument.name for argument in description.get_launch_arguments()} >= ARGUMENTS
