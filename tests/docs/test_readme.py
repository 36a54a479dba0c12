# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""README.md only says what is there: its stages run, its numbers are measured, its links lead on.

Its snippets run in test_docs.py.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path
import re

import pytest
from snippets import Reader, README, ROOT

TEXT = README.read_text(encoding='utf-8')


def test_stages_run_as_printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The commands in the table of stages, one after the other."""
    for package in ('torch', 'pybullet'):
        pytest.importorskip(package, reason='a stage needs it')
    monkeypatch.chdir(tmp_path)
    stages = re.findall(r'^\|.*`(rigid-gns [^`]+)`', TEXT, re.M)
    # those of bags are run in the sections above, where there is a bag
    Reader().type(
        '\n'.join(stage for stage in stages if 'bags' not in stage and 'tracked' not in stage)
    )
    for made in ('data/smoke/0000.h5', 'runs/gns/best.safetensors', 'rollout.h5'):
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
    folders = re.findall(r'`(\w+(?:/\w+)*/)`', '\n'.join(table))
    assert links
    assert folders
    for name in links:
        assert (ROOT / name.partition('#')[0]).exists(), name
    for name in folders:
        assert (ROOT / name).is_dir() or (ROOT / 'rigid_gns_core' / name).is_dir(), name


def test_nothing_is_left_open() -> None:
    for name in ('README.md', 'CONTRIBUTING.md', 'CHANGELOG.rst', 'docs/decisions.md'):
        text = (ROOT / name).read_text(encoding='utf-8')
        assert not re.search(r'\b(TODO|TBD|FIXME|XXX)\b|@[A-Z]+@', text), name
