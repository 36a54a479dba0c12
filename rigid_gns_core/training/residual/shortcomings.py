# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What data lack that a residual network would learn more from, and how to get it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .frames import Track
from ...data.tracks import read_tracks, TRACKS_NAME
from ...prediction.laws import UNITS
from ...scenes.similarity import Similarity

# samples of a frame beyond which nothing was gained in the worlds of studies/worlds
_ENOUGH = 8


def shortcomings(tracks: Sequence[Track], folders: Sequence[Path]) -> list[str]:
    """Sentences about training data, none where they are as good as they can be.

    Args:
        tracks: All of them.
        folders: Data sets that they are of; those that `rigid-gns import` made hold the tracker's
            own rate.
    """
    found = []
    if all(track.samples == 1 for track in tracks) and (step := _finer_step(folders)):
        found.append(
            'the data have one sample in each frame, the tracker had more: import them again with '
            f'--dt {step:.6g}, so that blows are seen'
        )
    unknown = sum(int((~track.turns).sum()) for track in tracks)
    total = sum(len(track.turns) for track in tracks)
    if unknown:
        found.append(
            f'the rotations of {unknown} of {total} spheres were not tracked: their spins are '
            'taken as 0 at the start of each frame, and nothing is learned of them'
        )
    return found


def _finer_step(folders: Sequence[Path]) -> float | None:
    """Part of a frame that is nearest to the tracker's interval [s]; None: the whole one."""
    intervals, frames = [], []
    for folder in folders:
        if not (folder / TRACKS_NAME).is_file():
            return None
        known = read_tracks(folder)
        intervals += [float(np.median(np.diff(one.times))) for one in known.tracks]
        frames.append(UNITS.dt * Similarity.between(known.scene, UNITS).time)
    if not intervals:
        return None
    frame = frames[0]
    parts = min(_ENOUGH, round(frame / float(np.median(intervals))))
    return frame / parts if parts > 1 else None
