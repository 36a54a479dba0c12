# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A scene from tracks, held against the present one; and the process that does it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
import time

from launched_balls import GIVEN, launched
import pytest
from rigid_gns_core import UserError
from rigid_gns_core.data.tracks import Track
from rigid_gns_core.forecasts.learned_scene import LearnedScene, write_learned
from rigid_gns_core.relearning import background
from rigid_gns_core.relearning.background import Background
from rigid_gns_core.relearning.relearn import relearn
from rigid_gns_core.scenes.scene_file import load_scene


def thrown(count: int, seed: int = 0) -> list[Track]:
    """Half a second at 90 Hz of launched balls."""
    return [
        Track(one.name, one.times[:90:2], one.positions[:90:2], None, one.spheres)
        for one in launched(count, seed)
    ]


def answer(own: Background) -> LearnedScene:
    end = time.monotonic() + 300.0
    while (found := own.take()) is None:
        assert time.monotonic() < end, 'no answer came'
        time.sleep(0.05)
    return found


def test_a_fit_is_better_than_a_vacuum_and_not_than_itself(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(background, 'NICE', 0)  # a busy machine would never come to it
    own, tracks = Background(), thrown(12)
    own.start(tracks, GIVEN, GIVEN)
    assert own.busy
    found = answer(own)
    assert not own.busy and found.better
    assert (found.tracks, found.left_out) == (8, 4)
    assert found.after['0.2'] < 0.5 * found.before['0.2']
    # bit by bit what this process finds, so that a fit can be done again
    assert relearn(tracks, GIVEN, GIVEN) == found
    same = relearn(tracks, GIVEN, found.scene)
    assert (same.change, same.deviation, same.better) == (0.0, 0.0, False)
    assert LearnedScene.from_json(found.json) == found
    path = tmp_path / 'new' / 'learned.yaml'
    write_learned(path, found)
    write_learned(path, found)  # its own file is written anew
    assert load_scene(str(path)) == found.scene
    path.write_text('scene: {}\n')
    with pytest.raises(FileExistsError, match='was not learned by a node'):
        write_learned(path, found)


def test_too_few_tracks_and_a_process_that_fails_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    own = Background()
    own.start(thrown(3), GIVEN, GIVEN)
    with pytest.raises(UserError, match='there are 3 tracks, expected at least 10'):
        answer(own)
    monkeypatch.setattr(background, 'NICE', 'least')
    own.start(thrown(3), GIVEN, GIVEN)
    with pytest.raises(UserError, match='the process that learns ended with 1: ValueError'):
        answer(own)


def test_a_fit_that_runs_ends_with_the_node() -> None:
    own = Background()
    own.start(thrown(12), GIVEN, GIVEN)
    end = time.monotonic() + 60.0
    while own._process is None:
        assert time.monotonic() < end, 'no process began'
        time.sleep(0.01)
    process = own._process
    own.close()
    assert process.returncode is not None
    own = Background()
    own.start(thrown(12), GIVEN, GIVEN)
    own.close()  # at once
    assert own._process is None or own._process.returncode is not None


def test_a_damaged_event_is_named() -> None:
    scene = replace(GIVEN, radius=0.03)
    whole = LearnedScene(scene, 1, 2, -0.1, 0.01, {}, {}, {})
    assert LearnedScene.from_json(whole.json, 7).index == 7
    with pytest.raises(UserError, match='expected JSON with scene'):
        LearnedScene.from_json('{"scene": {}}')
