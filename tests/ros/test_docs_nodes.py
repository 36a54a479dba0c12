# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The nodes of the pages start as printed there, and end when they are told to."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import shutil
import signal
import sys
from typing import Any

import pytest
from rigid_gns_core import Scene
from snippets import commands, NODES, PAGES, ROOT, snippets
import yaml


def nodes() -> dict[str, list[str]]:
    """Each `ros2 run` of a node, once, by what is printed."""
    typed = [
        words
        for page in PAGES
        for s in snippets(page)
        if s.kind == 'sh'
        for words in commands(s.text)
    ]
    started = [words for words in typed if words[:3] == ['ros2', 'run', 'rigid_gns_ros']]
    return {' '.join(words[3:]): words[3:] for words in started if words[3] in NODES}


@pytest.mark.parametrize('printed', nodes())
def test_a_node_starts_as_printed(
    printed: str, tmp_path: Path, run_process: Callable[..., Any]
) -> None:
    shutil.copytree(ROOT / 'config', tmp_path / 'config')
    for name in ('my_scene.yaml', 'lab.yaml', 'fitted.yaml'):  # what pages have made before
        (tmp_path / name).write_text(yaml.safe_dump({'scene': Scene().to_mapping()}))
    script, *arguments = (word.replace('$PWD', str(tmp_path)) for word in nodes()[printed])
    in_folder = ['env', '-C', str(tmp_path), sys.executable, '-m']
    run = run_process([*in_folder, f'rigid_gns_ros.{script}_node', *arguments])
    run.wait_for('ready: ')
    if 'tracked_poses:=/mocap/balls' in arguments:
        assert 'frames on /mocap/balls' in run.output
    run.signal(signal.SIGINT)
    assert run.exit_code() == 0, run.output
