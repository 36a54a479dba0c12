# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Each page of README.md and docs/ does what it says: its snippets run in order, in one folder."""

from __future__ import annotations

import ast
import builtins
from collections.abc import Callable
import json
from pathlib import Path
import shutil

from csv_balls import rows_of, SCENE, shots, write_csv
import numpy as np
import pytest
from rigid_gns_core import load_simulator, Scene
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.messages.poses import encode_string, PoseArrayCodec
from snippets import check_options, check_printed, mentioned, PAGES, quick, Reader, ROOT, snippets

POSE_ARRAY = 'geometry_msgs/msg/PoseArray'
MORE_PAGES = [ROOT / 'CONTRIBUTING.md', ROOT / 'docs' / 'model' / 'README.md']


def recorded_bag(name: str) -> None:
    """Record a bag as the simulator does: 4 s of three balls, predicted as they were tracked."""
    scene = Scene()
    positions = [[0.0, 0.0, 3.0], [0.5, 0.0, 6.0], [5.0, 0.0, 4.0]]
    path = load_simulator().rollout(scene, positions, [[1.0, 0.5, 0.0]] * 3, steps=40)
    poses = np.concatenate([path.positions, path.quaternions], axis=2)
    noisy = poses + np.random.default_rng(0).normal(0.0, 1e-3, poses.shape)
    codec, start = PoseArrayCodec('world', 3), 1_700_000_000_000_000_000
    topics = {'tracked': '/tracked_poses', 'predicted': '/predicted_poses'}
    said = {'scene': scene.to_mapping(), 'model': 'laws', 'dt': path.dt, 'period': path.dt}
    with BagWriter(name) as bag:
        bag.add_topic('/simulator/scene', 'std_msgs/msg/String', 'latched')
        bag.write('/simulator/scene', encode_string(json.dumps(said | {'topics': topics})), start)
        bag.add_topic('/tracked_poses', POSE_ARRAY, 'sensor_data')
        bag.add_topic('/predicted_poses', POSE_ARRAY, 'reliable')
        for k, time in enumerate(path.times):
            stamp = start + round(1e9 * time)
            bag.write('/tracked_poses', codec.encode(noisy[k], stamp), stamp)
            bag.write('/predicted_poses', codec.encode(poses[k], stamp), stamp)


def three_bags() -> None:
    for name in ('bags/first', 'bags/second', 'recording'):
        recorded_bag(name)


def thesis() -> None:
    """Write the page that `rigid-gns experiment --page` fills, and the results it takes."""
    shutil.copytree(ROOT / 'docs' / 'thesis', 'docs/thesis')
    shutil.copy(ROOT / 'docs' / 'thesis.md', 'docs/thesis.md')


def rig() -> None:
    """Write tracks of balls that bounce, and the scene that is known of them."""
    for seed, (name, count) in enumerate({'train.csv': 8, 'test.csv': 4}.items()):
        write_csv(Path(name), rows_of(shots(count, 0.7, 0.5e-3, seed)))
    Path('rig.yaml').write_text(SCENE)


# What a page takes as given, where that is not bags.
GIVEN: dict[str, Callable[[], None]] = {
    'identification.md': rig,
    'thesis.md': thesis,
    'tutorial.md': lambda: None,
}


def tutorial(words: list[str]) -> list[str]:
    """Of the tutorial all is as printed, but for half a minute of training."""
    return {'generate': ['--workers', '1'], 'train': ['--steps', '1']}.get(words[1], [])


@pytest.mark.parametrize(
    'page', [page for page in PAGES if snippets(page)], ids=lambda page: page.stem
)
def test_snippets_run_as_printed(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for package in ('torch', 'pybullet', 'matplotlib'):
        pytest.importorskip(package, reason='a snippet needs it')
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('PWD', str(tmp_path))
    GIVEN.get(page.name, three_bags)()
    Reader(tutorial if page.name == 'tutorial.md' else quick).read(page)


@pytest.mark.parametrize(
    'page',
    [page for page in PAGES + MORE_PAGES if mentioned(page)],
    ids=lambda page: str(page.relative_to(ROOT)),
)
def test_options_in_the_text_are_there(page: Path) -> None:
    for words in mentioned(page):
        check_options(words)


@pytest.mark.parametrize(
    'expected', ['a 1 of 2', 'a 1 of 3\n0.7 m', 'a 1 of ...\n0.52 m\na 1 of 3', 'a 1']
)
def test_what_was_not_printed_is_found(expected: str) -> None:
    printed = 'a 1 of 3\n\n  0.5 m\n'
    check_printed('a 1 of ...\n...\n0.52 m', printed)
    with pytest.raises(AssertionError, match='not printed'):
        check_printed(expected, printed)


def unknown_names(code: str) -> set[str]:
    """Names that a block reads, but does not make."""
    nodes = list(ast.walk(ast.parse(code)))
    made = {
        node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
    }
    made |= {
        (alias.asname or alias.name).split('.')[0]
        for node in nodes
        if isinstance(node, (ast.Import, ast.ImportFrom))
        for alias in node.names
    }
    read = {node.id for node in nodes if isinstance(node, ast.Name)}
    return read - made - set(dir(builtins))


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.stem)
def test_a_block_that_needs_an_earlier_one_says_so(page: Path) -> None:
    lines = page.read_text(encoding='utf-8').splitlines()
    for block in snippets(page):
        if block.kind == 'python' and (names := unknown_names(block.text)):
            before = [line for line in lines[: block.line - 1] if line][-1]
            assert 'session' in before, f'{page.name}:{block.line} needs {sorted(names)}'
