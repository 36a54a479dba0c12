# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sets of recordings in a folder, and their halves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
import json
from pathlib import Path
import shutil
from typing import Any

import numpy as np
import yaml

from .described_scene import described_scene
from ...data.tracks import read_tracks, Track, TRACKS_NAME, TrackSet
from ...errors import UserError
from ...recordings.importing.import_bags import import_bags
from ...recordings.importing.options import ImportOptions

# fewer tracks than this are halved in time, each of them
_FEWEST = 4
# kept of a description, for the report
_SOURCE = ('what', 'source', 'commit', 'licence', 'rate_hz', 'noise_m')


@dataclass(frozen=True)
class RecordedSet:
    """Where a set of recordings lies.

    Args:
        name: Name: that of the file or folder.
        tracks: CSV file, or data set made by `rigid-gns import`.
        scene: Scene file or shipped name of a CSV file; None: by the description.
        about: Description of the recordings.
    """

    name: str
    tracks: Path
    scene: Path | None
    about: dict[str, Any]

    @property
    def source(self) -> dict[str, Any]:
        """Where it comes from, as the description says."""
        return {key: self.about[key] for key in _SOURCE if key in self.about}


def find_sets(folder: Path, names: Sequence[str] | None = None) -> list[RecordedSet]:
    """Sets of a folder: CSV files with a description or a scene file, and data sets.

    Raises:
        UserError: The folder has no set, none of a name, or a CSV file has neither.
    """
    if not folder.is_dir():
        raise UserError(f'{folder} is not a folder; give one with NAME.csv and NAME.json or .yaml')
    found = {path.stem: _of_csv(path) for path in sorted(folder.glob('*.csv'))}
    for path in sorted(folder.glob(f'*/{TRACKS_NAME}')):
        found[path.parent.name] = RecordedSet(path.parent.name, path.parent, None, {})
    if not found:
        raise UserError(
            f'{folder} holds no recordings; expected NAME.csv with NAME.json or NAME.yaml, or '
            'data sets made by `rigid-gns import`'
        )
    unknown = sorted(set(names or ()) - set(found))
    if unknown:
        raise UserError(f'{folder} has no set {unknown[0]!r}; it has {", ".join(found)}')
    return [found[name] for name in names or found]


def _of_csv(path: Path) -> RecordedSet:
    about, scene = path.with_suffix('.json'), path.with_suffix('.yaml')
    if not about.is_file() and not scene.is_file():
        raise UserError(
            f'{path} says nothing of its scene; put {scene.name} (a scene file) or {about.name} '
            '(radius_m, table_plane, ...) beside it'
        )
    description: dict[str, Any] = {}
    if about.is_file():
        try:
            description = json.loads(about.read_text(encoding='utf-8'))
        except ValueError as error:
            raise UserError(f'{about}: not JSON: {error}') from error
        if not isinstance(description, dict):
            raise UserError(f'{about}: expected a mapping of names to values')
    return RecordedSet(path.stem, path, scene if scene.is_file() else None, description)


def imported_tracks(one: RecordedSet, folder: Path) -> TrackSet:
    """Tracks of a set; of a CSV file they are imported into `folder`, as a user would.

    Raises:
        UserError: They cannot be read, or are not usable.
    """
    if one.tracks.is_dir():
        return read_tracks(one.tracks)
    folder.mkdir(parents=True, exist_ok=True)
    scene = one.scene
    if scene is None:
        scene = folder / 'scene.yaml'
        where = str(one.tracks.with_suffix('.json'))
        text = yaml.safe_dump({'scene': described_scene(one.about, where).to_mapping()})
        scene.write_text(text, encoding='utf-8')
    data = folder / 'data'
    shutil.rmtree(data, ignore_errors=True)
    import_bags([one.tracks], data, ImportOptions(scene=scene))
    return read_tracks(data)


def halves(found: TrackSet, seed: int) -> tuple[TrackSet, TrackSet]:
    """Tracks to fit to, and those to judge by.

    Of each two tracks in a row one is drawn, as recordings change over time. Where there are too
    few to leave some out, each is cut in the middle of its time: its first half is fitted.
    """
    tracks = found.tracks
    if len(tracks) < _FEWEST:
        parts = [_cut(track) for track in tracks]
        first, second = (replace(found, tracks=tuple(p[k] for p in parts)) for k in (0, 1))
        return first, second
    pairs = (len(tracks) + 1) // 2
    drawn = np.random.default_rng(seed).integers(0, 2, pairs)
    inside = np.array([drawn[k // 2] == k % 2 for k in range(len(tracks))])
    if len(tracks) % 2:  # the last is alone: a track more to fit to
        inside[-1] = True
    fitted, judged = (
        tuple(track for track, own in zip(tracks, inside, strict=True) if own == side)
        for side in (True, False)
    )
    return replace(found, tracks=fitted), replace(found, tracks=judged)


def _cut(track: Track) -> tuple[Track, Track]:
    middle = int(np.searchsorted(track.times, 0.5 * track.times[-1]))
    parts = []
    for name, own in (('a', slice(0, middle)), ('b', slice(middle, None))):
        times, turns = track.times[own], track.quaternions
        seen = np.asarray(track.seen[own].any(axis=0))
        parts.append(
            Track(
                name=f'{track.name}{name}',
                times=times - times[0],
                positions=track.positions[own][:, seen],
                quaternions=None if turns is None else turns[own][:, seen],
                spheres=tuple(
                    s for s, is_seen in zip(track.spheres, seen, strict=True) if is_seen
                ),
                begin=track.begin + float(times[0]),
            )
        )
    return parts[0], parts[1]
