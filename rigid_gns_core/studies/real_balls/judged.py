# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""One set of recordings: laws fitted to one half of its tracks, judged on the other.

All rivals are fitted to the same half. `vacuum` has contacts, `drag` air that resists too, and
`fitted` all that earns its place (`rigid-gns calibrate`), each with a noise and drift of its own.
`bullet` starts from the states that `fitted` estimates, with its gravity, surfaces, restitution,
friction and inertia, but without air.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from .bullet import BulletSimulator
from ...data.tracks import tracks_hash, TrackSet
from ...forecasts.forecaster import scene_of
from ...identification.card import card_of, write_lab
from ...identification.ladder import Tried
from ...identification.learn import learn
from ...recordings.scoring.learned_regions import with_regions
from ...recordings.scoring.track_errors import Outcome, report_of, track_outcomes, Windows
from ...rollout.simulator import Simulator
from ...scenes.scene import Scene
from ...tracking.state_estimate import estimate_state

# terms of each rival; None: all that earn their place
RIVALS: dict[str, tuple[str, ...] | None] = {
    'vacuum': ('contacts',),
    'drag': ('contacts', 'drag'),
    'fitted': None,
}
FITTED, BULLET = 'fitted', 'bullet'
HORIZONS = (0.2, 0.4, 0.6, 1.0)
FIRST = 'first'
"""Name of the protocol that starts from the first window of each track."""
EVERY = 'every'
"""Name of the one that starts all along the tracks."""
_WINDOW = 0.2
# starts all along the tracks: so far apart at least [s], and as many of them at most
_APART, _MOST = 0.1, 600
_SAMPLES = 32
# heights of balls that roll, or are not measured, change by less [m]
_LEVEL = 1e-3
# forecast of one ball that is timed [s], and how many starts are
_AHEAD, _TIMED = 1.0, 200

Say = Callable[[str], object]


@dataclass(frozen=True)
class Protocol:
    """Starts of forecasts.

    Args:
        windows: Which windows.
        text: What they are, in words.
    """

    windows: Windows
    text: str


def protocols(judged: TrackSet, seed: int) -> dict[str, Protocol]:
    """From the first 0.2 s of each track, and from every so often with what came before."""
    total = sum(float(track.times[-1]) for track in judged.tracks)
    every = max(_APART, float(np.ceil(10.0 * total / _MOST)) / 10.0)
    along = Windows(_APART, HORIZONS, every=every, samples=_SAMPLES, seed=seed)
    return {
        FIRST: Protocol(
            Windows(_WINDOW, HORIZONS, samples=_SAMPLES, seed=seed),
            f'from the first {_WINDOW:g} s of each track',
        ),
        EVERY: Protocol(along, f'from every {every:g} s of each track, with what came before'),
    }


def judge_set(
    inside: TrackSet, outside: TrackSet, simulator: Simulator, seed: int, folder: Path, say: Say
) -> dict[str, Any]:
    """Fit to one half and judge on the other.

    Args:
        inside: Tracks to fit to.
        outside: Tracks to judge by.
        simulator: The laws.
        seed: Seed of the draws of states.
        folder: Where scene files of the rivals are written.
        say: Called with lines of progress.

    Raises:
        UserError: There are too few tracks to fit to.
    """
    scenes: dict[str, Scene] = {}
    report: dict[str, Any] = {
        'tracks': {'fitted': len(inside.tracks), 'judged': len(outside.tracks)},
        'hashes': {
            'fitted': tracks_hash(inside.tracks), 'judged': tracks_hash(outside.tracks)
        },
        'noise_m': inside.noise,
        'rivals': {},
    }  # fmt: skip
    for name, terms in RIVALS.items():
        if name == 'drag' and not _flies(inside):
            continue
        began = perf_counter()

        def step(line: Tried, name: str = name) -> None:
            say(f'{name}: {line.name}')

        learned = learn(inside.tracks, inside.scene, inside.labels, step, terms)
        learned = with_regions(learned, inside.labels, simulator)
        card = card_of(learned, {'sha256': report['hashes']['fitted']})
        write_lab(folder / f'{name}.yaml', learned, card)
        scenes[name] = learned.scene
        report['rivals'][name] = {'fit_s': perf_counter() - began, 'card': card}
    ways = protocols(outside, seed)
    report['protocols'] = {name: way.text for name, way in ways.items()}
    for name, scene in scenes.items():
        say(f'{name}: judged')
        found = {k: track_outcomes(simulator, outside, scene, w.windows) for k, w in ways.items()}
        report['rivals'][name] |= _errors(found)
        report['rivals'][name]['times'] = _times(simulator, outside, scene)
        if name == FITTED:
            report['shown'] = _usual([one for one in found[FIRST] if not one.held])
            held = {way: sum(one.held for one in outcomes) for way, outcomes in found.items()}
            report['held'] = held
    try:
        bullet = BulletSimulator()
    except ModuleNotFoundError as error:
        report['rivals'][BULLET] = {'absent': str(error)}
        return report
    say(f'{BULLET}: judged')
    bare = {name: replace(way.windows, samples=0) for name, way in ways.items()}
    report['rivals'][BULLET] = _errors(
        {k: track_outcomes(bullet, outside, scenes[FITTED], w) for k, w in bare.items()}
    )
    return report


def _flies(found: TrackSet) -> bool:
    """Whether a ball leaves the height at which it was seen first."""
    heights = [track.positions @ found.scene.up for track in found.tracks]
    return any(bool((np.nanmax(own, 0) - np.nanmin(own, 0) > _LEVEL).any()) for own in heights)


def _errors(found: Mapping[str, Sequence[Outcome]]) -> dict[str, Any]:
    """Errors by protocol, see `report_of`: of balls that nothing unknown held on the way."""
    return {
        way: report_of([one for one in outcomes if not one.held], HORIZONS)
        for way, outcomes in found.items()
    }


def _usual(outcomes: Sequence[Outcome]) -> str:
    """Track with the median error at the last horizon that half of the tracks reach."""
    names = {one.track for one in outcomes}
    for horizon in reversed(HORIZONS):
        own = sorted((one for one in outcomes if one.horizon == horizon), key=lambda o: o.error)
        if len(own) >= 0.5 * len(names):
            return own[len(own) // 2].track
    return outcomes[0].track


def _times(simulator: Simulator, outside: TrackSet, scene: Scene) -> dict[str, Any]:
    """Seconds of an estimate of one ball from 0.4 s, and of its forecast of 1 s."""
    memory = 0.4 if scene.tracker is None else scene.tracker.memory
    leads = np.array([_AHEAD])
    seconds: list[tuple[float, float]] = []
    for track in outside.tracks:
        for column in range(len(track.spheres)):
            own = scene_of(scene, (outside.labels.index(track.spheres[column]),))
            times, places = track.samples(column)
            for end in np.arange(memory, times[-1] if len(times) else 0.0, memory):
                inside = (times > end - memory) & (times <= end)
                if inside.sum() < 4 or len(seconds) >= _TIMED:
                    continue
                begin = perf_counter()
                estimate = estimate_state(own, times[inside], places[inside, None])
                middle = perf_counter()
                simulator.forecast(own, estimate, leads, samples=0)
                seconds.append((middle - begin, perf_counter() - middle))
    if not seconds:
        return {}
    spent = np.array([(a, b, a + b) for a, b in seconds])
    return {
        name: {
            'n': len(spent),
            'median_s': float(np.median(column)),
            'p99_s': float(np.quantile(column, 0.99, method='higher')),
        }
        for name, column in zip(('estimate', 'forecast', 'both'), spent.T, strict=True)
    }


def rivals_of(report: Mapping[str, Any]) -> Sequence[str]:
    """Names of the rivals that were judged, in the order of what they know."""
    order = [BULLET, *RIVALS]
    return [name for name in order if FIRST in report['rivals'].get(name, {})]
