# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns calibrate` of stamped positions: air, contact laws, tracker and spins."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import json
from pathlib import Path
import sys

from ..data.tracks import read_tracks, Track, tracks_hash, TRACKS_NAME, TrackSet
from ..errors import UserError
from ..files.atomic_file import whole_file
from ..files.tables import format_rows, number
from ..identification.card import card_of, write_lab
from ..identification.ladder import Tried
from ..identification.learn import learn, Learned
from ..identification.left_out import HORIZONS
from ..prediction.load import load_simulator
from ..recordings.scoring.learned_regions import with_regions
from ..scenes.scene_file import load_scene
from ..show.learned import draw_learned


def hold_positions_only(folders: Sequence[Path]) -> bool:
    """Whether all data sets have tracks, and rotations were tracked in none of them."""
    for folder in folders:
        if not ((folder / TRACKS_NAME).is_file() or folder.name == TRACKS_NAME):
            return False
        if any(track.quaternions is not None for track in read_tracks(folder).tracks):
            return False
    return True


def calibrate_tracks(arguments: argparse.Namespace) -> int:
    """Fit a scene to the tracks of data sets, print what they tell, and write it."""
    sets = [read_tracks(folder) for folder in arguments.data]
    _refuse_twice(arguments.data, sets)
    labels = _labels(sets)
    tracks = [track for found in sets for track in found.tracks]
    scene = load_scene(arguments.scene) if arguments.scene else sets[0].scene
    print(_header(), file=sys.stderr, flush=True)
    learned = learn(tracks, scene, labels, _say)
    learned = with_regions(learned, labels, load_simulator())
    card = card_of(learned, _origin(arguments.data, tracks))
    write_lab(arguments.out, learned, card)  # before it is printed, as the reader may leave
    if arguments.json is not None:
        with whole_file(arguments.json) as partial:
            partial.write_text(json.dumps(card, indent=1) + '\n', 'utf-8')
    print(format_learned(learned))
    if arguments.figure is not None:
        draw_learned(learned, arguments.figure)
    print(f'scene: {arguments.out}')
    return 0


def _refuse_twice(folders: Sequence[Path], sets: Sequence[TrackSet]) -> None:
    """Raise UserError where two data sets hold the same tracks."""
    first: dict[str, Path] = {}
    for folder, found in zip(folders, sets, strict=True):
        same = first.setdefault(tracks_hash(found.tracks), folder)
        if same is not folder:
            raise UserError(
                f'{folder} holds the tracks of {same}: one would be fitted where the other is '
                'left out; give each once'
            )


def format_learned(learned: Learned) -> str:
    """Tables of the parameters and of the regions, and what the data do not tell."""
    rows = [
        [name, number(one.value, 4), number(one.error, 2), one.unit]
        for name, one in learned.parameters.items()
    ]
    lines = [format_rows(['parameter', 'value', 'error', 'unit'], rows, left=(0, 3))]
    held = ', '.join(
        f'{100 * parts[1]:.0f} and {100 * parts[2]:.0f} % of {parts[0]:.0f} at {horizon} s'
        for horizon, parts in learned.coverage.items()
    )
    lines.append(f'regions of 50 and 90 % hold of left-out tracks: {held}')
    counts = learned.counts
    lines.append(
        f'{counts["tracks"]} tracks in {counts["stretches"]} stretches, of which '
        f'{counts["unknown"]} hold what the laws do not know and were left out'
    )
    return '\n'.join([*lines, *learned.notes])


def _labels(sets: Sequence[TrackSet]) -> list[str]:
    """Labels of the spheres; of several data sets they must agree."""
    labels = list(sets[0].labels)
    for found in sets[1:]:
        if list(found.labels) != labels:
            raise UserError(
                f'data sets with spheres {", ".join(labels)} and {", ".join(found.labels)} are '
                'not of one scene; calibrate each alone'
            )
    return labels


def _origin(folders: Sequence[Path], tracks: Sequence[Track]) -> dict[str, object]:
    return {'sets': [folder.name for folder in folders], 'sha256': tracks_hash(tracks)}


def _header() -> str:
    horizons = ''.join(f'{f"{horizon:g} s":>15}' for horizon in HORIZONS)
    return (
        'errors of left-out tracks, mean / median [cm], from windows of 0.2 to 0.4 s\n'
        f'{"term":32}{"log error":>16} {horizons}'
    )


def _say(line: Tried) -> None:
    change = f'{line.change:+.3f} +- {line.deviation:.3f}' if line.deviation else ''
    errors = ''
    for horizon in HORIZONS:
        found = line.every.get(f'{horizon:g}')
        errors += f'{f"{100 * found[1]:.3g} / {100 * found[2]:.3g}" if found else "":>15}'
    text = f'{line.name:30}{"+" if line.kept else " ":2}{change:>16} {errors}'
    print(text, file=sys.stderr, flush=True)
