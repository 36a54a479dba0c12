# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A scene from the newest tracks of a tracker, and whether it is better than the present one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..data.tracks import sorted_labels, Track, TrackSet
from ..errors import UserError
from ..forecasts.learned_scene import LearnedScene
from ..identification.learn import learn
from ..prediction.load import load_simulator
from ..recordings.scoring.learned_regions import with_regions
from ..recordings.scoring.track_errors import Outcome, track_outcomes, Windows
from ..scenes.scene import Scene

FEWEST = 10
"""Tracks that a fit takes at least, with those left out."""
# of the tracks this part, the newest, is left out of the fit; at least so many
_PART, _LEFT_OUT = 1 / 3, 3
WINDOWS = Windows(window=0.1, horizons=(0.2, 0.4), every=0.1, samples=0)
"""Windows that are predicted from, and how far ahead."""
_LARGEST = 100.0  # error that counts [m]; of a forecast that diverged it is infinite

_Place = tuple[str, str, float, float]


def relearn(tracks: Sequence[Track], given: Scene, present: Scene) -> LearnedScene:
    """Fit a scene to all but the newest tracks, and predict these in it and in the present one.

    Args:
        tracks: The newest last.
        given: Where the fit begins.
        present: What it is held against.

    Raises:
        UserError: There are too few tracks, or they are too short to tell.
    """
    if len(tracks) < FEWEST:
        raise UserError(f'there are {len(tracks)} tracks, expected at least {FEWEST}')
    count = max(_LEFT_OUT, round(_PART * len(tracks)))
    inside, outside = tracks[:-count], tracks[-count:]
    labels = sorted_labels(label for track in tracks for label in track.spheres)
    learned = with_regions(learn(inside, given, labels), labels, load_simulator())
    noise = 0.0 if learned.scene.tracker is None else learned.scene.tracker.noise
    long = tuple(one for one in outside if one.times[-1] >= WINDOWS.window + WINDOWS.horizons[0])
    if len(long) < 2:
        raise UserError(
            f'{len(long)} of the newest {count} tracks are as long as a window of '
            f'{WINDOWS.window:g} s and {WINDOWS.horizons[0]:g} s after it, expected 2 or more'
        )
    left_out = TrackSet(long, given, noise)
    old, new = (_errors(left_out, scene) for scene in (present, learned.scene))
    both = sorted(set(old) & set(new))
    changes: dict[str, list[float]] = {}
    for place in both:
        was, now = (np.hypot(min(error[place], _LARGEST), noise) for error in (old, new))
        changes.setdefault(place[0], []).append(float(np.log(now / was)))
    if len(changes) < 2:
        raise UserError(f'{len(changes)} of the newest {count} tracks can be predicted')
    means = np.array([np.mean(own) for own in changes.values()])
    return LearnedScene(
        scene=learned.scene,
        tracks=len(inside),
        left_out=len(changes),
        change=float(means.mean()),
        deviation=float(means.std(ddof=1) / np.sqrt(len(means))),
        before=_medians(old, both),
        after=_medians(new, both),
        parameters={
            name: vars(one) | {'error': one.error if np.isfinite(one.error) else None}
            for name, one in learned.parameters.items()
        },
    )


def _errors(tracks: TrackSet, scene: Scene) -> dict[_Place, float]:
    """Error of each forecast that no hand is in the way of [m]."""

    def place(one: Outcome) -> _Place:
        return one.track, one.sphere, one.start, one.horizon

    outcomes = track_outcomes(load_simulator(), tracks, scene, WINDOWS)
    return {place(one): one.error for one in outcomes if not one.held}


def _medians(errors: dict[_Place, float], places: Sequence[_Place]) -> dict[str, float]:
    found: dict[str, list[float]] = {}
    for place in places:
        found.setdefault(f'{place[3]:g}', []).append(min(errors[place], _LARGEST))
    return {time: float(np.median(own)) for time, own in sorted(found.items())}
