# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""All sets of a folder, one after another; a set that is done is not done again."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .figure import draw_coverage, draw_set
from .judged import judge_set, RIVALS, Say
from .recorded_sets import halves, imported_tracks, RecordedSet
from ...data.tracks import read_tracks, tracks_hash, TrackSet
from ...errors import UserError
from ...files.strict_json import read_json, write_json
from ...installation.versions import PACKAGE, version_of
from ...rollout.simulator import Simulator
from ...scenes.scene_file import load_scene

_REPORT = 'report.json'
"""Of a set that is done, in its folder."""


def run_sets(
    sets: Sequence[RecordedSet], out: Path, simulator: Simulator, seed: int, say: Say
) -> dict[str, Any]:
    """Judge each set; report by name.

    Args:
        sets: The sets.
        out: Folder with one for each set: its tracks, fitted scenes and report.
        simulator: The laws.
        seed: Of halves and draws.
        say: Called with lines of progress.

    Raises:
        UserError: Tracks cannot be read, or there are too few.
    """
    found = {}
    for one in sets:
        folder = out / one.name
        try:
            found[one.name] = _run_set(one, folder, simulator, seed, say)
        except UserError as error:
            raise UserError(f'set {one.name}: {error}') from error
    return found


def _run_set(
    one: RecordedSet, folder: Path, simulator: Simulator, seed: int, say: Say
) -> dict[str, Any]:
    tracks = imported_tracks(one, folder)
    made_of = {
        'sha256': tracks_hash(tracks.tracks),
        'seed': seed,
        'version': version_of(PACKAGE) or 'unknown',
    }
    done = folder / _REPORT
    if done.is_file() and (report := read_json(done))['made_of'] == made_of:
        say(f'{one.name}: done before, see {done}')
        return report
    say(f'{one.name}: {len(tracks.tracks)} tracks')
    inside, outside = halves(tracks, seed)
    folder.mkdir(parents=True, exist_ok=True)

    def step(text: str) -> None:
        say(f'{one.name}: {text}')

    report = {
        'made_of': made_of,
        'source': one.source,
        'left_out': [text for file in tracks.origin['files'] for text in file['left_out']],
        'cut': len(inside.tracks) + len(outside.tracks) > len(tracks.tracks),
        **judge_set(inside, outside, simulator, seed, folder, step),
    }
    write_json(done, report)
    return report


def draw_sets(
    reports: dict[str, Any],
    sets: Sequence[RecordedSet],
    out: Path,
    figures: Path,
    simulator: Simulator,
) -> list[Path]:
    """Pictures of judged sets; their paths."""
    figures.mkdir(parents=True, exist_ok=True)
    paths = []
    for one in sets:
        report, folder = reports[one.name], out / one.name
        _, outside = halves(_tracks(one, folder), report['made_of']['seed'])
        scenes = {
            name: load_scene(folder / f'{name}.yaml')
            for name in RIVALS
            if name in report['rivals']
        }
        paths.append(figures / f'{one.name}.png')
        draw_set(report, outside, scenes, simulator, paths[-1])
    paths.append(figures / 'coverage.png')
    draw_coverage(reports, paths[-1])
    return paths


def _tracks(one: RecordedSet, folder: Path) -> TrackSet:
    return read_tracks(one.tracks if one.tracks.is_dir() else folder / 'data')
