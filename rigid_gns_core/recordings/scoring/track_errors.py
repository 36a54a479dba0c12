# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forecasts from windows of tracks, and their errors at the stamps of what comes after."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .regions import crps, region_distance, region_probability, REGIONS
from .track_contacts import contacts_of, held_times
from ...data.tracks import Track, TrackSet
from ...errors import UserError
from ...forecasts.forecaster import scene_of
from ...rollout.simulator import Simulator
from ...scenes.scene import Scene
from ...scenes.state import Array
from ...tracking.state_estimate import estimate_state

# a sphere is forecast that was seen this often in a window
_SAMPLES = 3
# largest distance of a sample from its horizon [horizons], [median intervals of the track]
_TOLERANCE, _FRAMES = 0.02, 0.6
# contacts from this number on are one group
_MANY = 3
# a ball slower than this comes to rest soon [sqrt(g r)]
_STILL = 0.3
# start and end of a window are met to this [s]: stamps have seven digits or fewer
_SAME = 1e-6


@dataclass(frozen=True)
class Windows:
    """Which windows are taken, and how far ahead they are judged.

    Args:
        window: Time of a window [s].
        horizons: Times after it [s].
        every: Time from one window to the next [s]; None: the first of each track alone. A scene
            with a learned tracker has the frames before a window, too, as far as its memory goes.
        samples: States drawn for the regions; 0: no regions.
        seed: Seed of the draws.

    Raises:
        UserError: A time is not positive.
    """

    window: float
    horizons: tuple[float, ...]
    every: float | None = None
    samples: int = 32
    seed: int = 0

    def __post_init__(self) -> None:
        times = {'window': self.window, 'every': self.every}
        times |= {f'horizons[{index}]': value for index, value in enumerate(self.horizons)}
        for name, value in times.items():
            if value is not None and not (value > 0 and np.isfinite(value)):
                raise UserError(f'{name} is {value}, expected more than 0 s')
        if not self.horizons or self.samples < 0 or self.samples == 1:
            raise UserError(
                f'{len(self.horizons)} horizons and {self.samples} samples, expected at least one '
                'horizon, and no samples or at least two'
            )


@dataclass(frozen=True)
class Outcome:
    """One sphere at one horizon.

    Args:
        track: Name of the track.
        sphere: Label of the sphere.
        start: Time of the start in its track [s].
        horizon: The horizon [s].
        lead: Time from the start to the sample compared [s].
        error: Distance of the forecast from the sample [m]; infinite where it diverged.
        contacts: Number of contacts that the track shows after its last sample in the window.
        held: Whether a hand, or something else that the scene has not, held it on the way.
        probability: Of the smallest region about the forecast that holds the sample; None: the
            estimate has no covariance.
        distance: Of the forecast from the sample [deviations]; None: likewise.
        crps: Continuous ranked probability score [m]; None: likewise.
    """

    track: str
    sphere: str
    start: float
    horizon: float
    lead: float
    error: float
    contacts: int
    held: bool
    probability: float | None
    distance: float | None = None
    crps: float | None = None


def track_outcomes(
    simulator: Simulator,
    found: TrackSet,
    scene: Scene,
    windows: Windows,
    done: Callable[[], object] = lambda: None,
) -> list[Outcome]:
    """Forecast from windows of each track, and compare.

    Args:
        simulator: Model that predicts.
        found: The tracks.
        scene: Scene to predict in, instead of that of the import.
        windows: Which windows.
        done: Called after each track.

    Raises:
        UserError: The scene has properties of another number of spheres, or no sphere is seen
            after a window.
    """
    labels = found.labels
    if scene.sphere_count not in (None, len(labels)):
        raise UserError(
            f'the tracks have {len(labels)} spheres, but the scene has properties of '
            f'{scene.sphere_count}; give a --scene with one number for all'
        )
    outcomes: list[Outcome] = []
    for track in found.tracks:
        outcomes += outcomes_of_track(simulator, track, scene, labels, windows, found.noise)
        done()
    if not outcomes:
        longest = max((float(track.times[-1]) for track in found.tracks), default=0.0)
        too_short = longest < windows.window + windows.horizons[0]
        raise UserError(
            f'no track shows a sphere {windows.horizons[0]:g} s after a window of '
            f'{windows.window:g} s with {_SAMPLES} samples; the longest has {longest:.3g} s: give '
            + ('a shorter --window or --horizons' if too_short else 'a longer --window')
        )
    return outcomes


def outcomes_of_track(
    simulator: Simulator,
    track: Track,
    scene: Scene,
    labels: Sequence[str],
    windows: Windows,
    noise: float,
) -> list[Outcome]:
    """Forecast from windows of one track, and compare.

    Args:
        simulator: Model that predicts.
        track: The track.
        scene: Scene to predict in.
        labels: Labels of the scene's spheres.
        windows: Which windows.
        noise: Standard deviation of a coordinate of a position [m].
    """
    own = scene_of(scene, tuple(labels.index(label) for label in track.spheres))
    radii = own.per_sphere('radius', len(track.spheres))
    contacts = contacts_of(track, own, radii, noise)
    hands = held_times(track, own, noise)
    outcomes: list[Outcome] = []
    for chosen in _windows(track, windows):
        outcomes += _from_window(simulator, track, own, chosen, contacts, hands, windows, noise)
    return outcomes


def report_of(outcomes: Sequence[Outcome], horizons: Sequence[float]) -> dict[str, Any]:
    """Errors by horizon [s], and in each by the number of contacts.

    Returns:
        For each horizon: `n`, `time_s`, `mean_m`, `median_m`, `p90_m`, `coverage_50`,
        `coverage_90` and `crps_m` (None without regions), and the same in `contacts` for '0', '1',
        '2', '3+', and 'held' of those that were held on the way.
    """
    report: dict[str, Any] = {}
    for horizon in horizons:
        own = [one for one in outcomes if one.horizon == horizon]
        if not own:
            continue
        groups: dict[str, list[Outcome]] = {}
        for one in sorted(own, key=lambda one: (one.held, one.contacts)):
            name = str(one.contacts) if one.contacts < _MANY else f'{_MANY}+'
            name = 'held' if one.held else name
            groups.setdefault(name, []).append(one)
        by_contacts = {name: _numbers(group) for name, group in groups.items()}
        report[f'{horizon:g}'] = _numbers(own) | {'contacts': by_contacts}
    return report


def _numbers(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    errors = np.array([one.error for one in outcomes])
    known = [one.probability for one in outcomes if one.probability is not None]
    numbers: dict[str, Any] = {
        'n': len(errors),
        'time_s': float(np.mean([one.lead for one in outcomes])),
        'mean_m': float(errors.mean()),
        'median_m': float(np.median(errors)),
        'p90_m': float(np.quantile(errors, 0.9, method='higher')),
    }
    for region in REGIONS:
        inside = float(np.mean(np.array(known) <= region)) if known else None
        numbers[f'coverage_{100 * region:.0f}'] = inside
    scores = [one.crps for one in outcomes if one.crps is not None]
    numbers['crps_m'] = float(np.mean(scores)) if scores else None
    return numbers


def _windows(track: Track, windows: Windows) -> Iterator[NDArray[np.int64]]:
    """Frames of each window."""
    begin = 0.0
    while begin + windows.window <= track.times[-1] + _SAME:
        inside = (track.times >= begin - _SAME) & (track.times <= begin + windows.window + _SAME)
        yield np.flatnonzero(inside)
        if windows.every is None:
            return
        begin += windows.every


def _from_window(
    simulator: Simulator,
    track: Track,
    scene: Scene,
    frames: NDArray[np.int64],
    contacts: Sequence[Array],
    hands: Sequence[Array],
    windows: Windows,
    noise: float,
) -> list[Outcome]:
    """Outcomes of the forecast from one window."""
    if not len(frames):
        return []
    start = float(track.times[frames[-1]])
    counts = track.seen[frames].sum(axis=0)
    compared = _compared(track, np.flatnonzero(counts >= _SAMPLES), start, windows.horizons)
    if not compared:
        return []
    # others are in the way where they came to rest: of a ball at rest some trackers say nothing
    used = np.array(
        [k for k, n in enumerate(counts) if n or _rests(track, k, int(frames[-1]), scene)],
        dtype=np.int64,
    )
    positions = track.positions[frames][:, used]
    turns = None if track.quaternions is None else track.quaternions[frames][:, used]
    for column, sphere in enumerate(used):
        if not counts[sphere]:
            last = int(np.flatnonzero(track.seen[: frames[-1] + 1, sphere])[-1])
            positions[-1, column] = track.positions[last, sphere]
            if turns is not None and track.quaternions is not None:
                turns[-1, column] = track.quaternions[last, sphere]
    own = scene_of(scene, tuple(used.tolist()))
    times = track.times[frames]
    if windows.every is not None and own.tracker is not None:
        # a tracker at work has what came before as well, of which its memory counts
        earlier = np.arange(frames[0])
        times = track.times[: frames[-1] + 1]
        positions = np.concatenate([track.positions[earlier][:, used], positions])
        if turns is not None and track.quaternions is not None:
            turns = np.concatenate([track.quaternions[earlier][:, used], turns])
    estimate = estimate_state(own, times, positions, turns, noise=noise)
    leads = np.unique([lead for _, _, lead, _ in compared])
    forecast = simulator.forecast(own, estimate, leads, windows.samples, windows.seed)
    regions = None if own.tracker is None else own.tracker.regions
    outcomes = []
    for sphere, horizon, lead, place in compared:
        step, column = int(np.searchsorted(leads, lead)), int(np.searchsorted(used, sphere))
        off = forecast.positions[step, column] - place
        error, spread = float(np.linalg.norm(off)), forecast.covariance[step, column]
        between, hand = contacts[sphere], hands[sphere]
        # what its frames do not show yet lies ahead, where others are seen later
        shown = track.times[frames[track.seen[frames, sphere]][-1]]
        known = (off, spread, noise) if windows.samples else None
        outcomes.append(
            Outcome(
                track=track.name,
                sphere=track.spheres[sphere],
                start=start,
                horizon=horizon,
                lead=lead,
                error=error if np.isfinite(error) else float('inf'),
                contacts=int(((between > shown) & (between < start + lead)).sum()),
                held=bool(((hand >= start) & (hand <= start + lead)).any()),
                probability=known and region_probability(*known, lead, regions),
                distance=known and region_distance(*known),
                crps=known and crps(*known),
            )
        )
    return outcomes


def _rests(track: Track, sphere: int, last: int, scene: Scene) -> bool:
    """Whether a sphere was seen up to a frame, and hardly moved when it was seen last."""
    seen = np.flatnonzero(track.seen[: last + 1, sphere])[-_SAMPLES:]
    if not len(seen):
        return False
    way = np.linalg.norm(track.positions[seen[-1], sphere] - track.positions[seen[0], sphere])
    radius = float(np.mean(scene.radius))
    still = _STILL * np.sqrt(radius * (np.linalg.norm(scene.gravity) or 9.81))
    return bool(way <= still * (track.times[seen[-1]] - track.times[seen[0]]))


def _compared(
    track: Track, spheres: NDArray[np.int64], start: float, horizons: Sequence[float]
) -> list[tuple[int, float, float, Array]]:
    """Sphere, horizon, time from the start, and sample nearest to each horizon."""
    found = []
    for sphere in spheres.tolist():
        times, places = track.samples(sphere)
        frame = _FRAMES * float(np.median(np.diff(times)))
        for horizon in horizons:
            nearest = int(np.abs(times - start - horizon).argmin())
            lead = float(times[nearest]) - start
            if abs(lead - horizon) <= max(_TOLERANCE * horizon, frame):
                found.append((sphere, horizon, lead, places[nearest]))
    return found
