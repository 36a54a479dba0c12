# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The nodes of the pages start as printed there, and end when they are told to."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import signal
import sys
from typing import Any

import pytest
from rigid_gns_core import Scene
from snippets import commands, NODES, PAGES, ROOT, SHARE, snippets
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
    for name in ('my_scene.yaml', 'lab.yaml', 'fitted.yaml'):  # what pages have made before
        (tmp_path / name).write_text(yaml.safe_dump({'scene': Scene().to_mapping()}))
    script, *arguments = (
        word.replace('$PWD', str(tmp_path)).replace(SHARE, str(ROOT)) for word in nodes()[printed]
    )
    in_folder = ['env', '-C', str(tmp_path), sys.executable, '-m']
    run = run_process([*in_folder, f'rigid_gns_ros.{script}_node', *arguments])
    run.wait_for('ready: ')
    if 'tracked_poses:=/mocap/balls' in arguments:
        assert 'frames on /mocap/balls' in run.output
    run.signal(signal.SIGINT)
    assert run.exit_code() == 0, run.output
