# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""From tracks to a scene: air, contact laws, the tracker's frame and noise, and spins."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .collision_forecasts import Name, told_by_forecasts, with_value
from .collisions import shown_collisions, usual_restitution
from .correction_fit import CorrectionFit, kept, Missed, missed_by
from .coverage import fit_coverage
from .diagnostics import Diagnostics, diagnostics_of
from .enough import check_enough
from .first_look import shown_noise, shown_restitution
from .jackknife import fits_without, groups_of, jackknife_errors, LeftOut
from .ladder import fit_setup, Fold, Ladder, Setup, Tried
from .left_out import CLOSE, Part
from .parameters import Laws
from .shown_planes import placed_surfaces
from .stretches import pieces, Stretch, stretches
from .terms import core_terms, further_terms, Met, met_by
from ..data.tracks import Track
from ..errors import UserError
from ..scenes.scene import Scene
from ..scenes.tracker import Spins, Tracker
from ..tracking.ball_contact import FREE
from ..tracking.start_prior import StartPrior

# folds of the tracks; many tracks make two do
_FOLDS, _MANY = 3, 60
# most stretches of a fold, and of the last fit
_MOST, _MOST_LAST = 250, 600
# fits without a group of tracks each, for standard errors
_GROUPS = 8
# most windows of spins that a scene keeps
_WINDOWS = 150
# before the residuals are known: drift [m^2/s^3] and kick
_DRIFT, _KICK = 1e-2, 0.02
# states drawn for the covariance of a forecast
_SAMPLES = 32
# of fewer tracks than this the pieces between unknown contacts are left out one by one
_FEW_TRACKS = 8


@dataclass(frozen=True)
class Told:
    """One parameter.

    Args:
        value: Fitted value.
        error: Standard error: the largest of that of the residuals, of the tracks' scores, and of
            fits without a part of the tracks.
        unit: Its unit.
    """

    value: float
    error: float
    unit: str


@dataclass(frozen=True)
class Learned:
    """What tracks tell.

    Args:
        scene: The scene with it.
        parameters: Values and standard errors by name.
        table: The terms that were tried.
        coverage: Number and parts of left-out forecasts in the regions of 50 and 90 %, by horizon.
        counts: Numbers of tracks, stretches, and stretches left out as they hold what the laws do
            not know.
        notes: What the data do not tell, in words.
        diagnostics: What the fit leaves.
        left_out: The same by fits without a part of the tracks each.
    """

    scene: Scene
    parameters: dict[str, Told]
    table: tuple[Tried, ...]
    coverage: dict[str, list[float]]
    counts: dict[str, int]
    notes: tuple[str, ...]
    diagnostics: Diagnostics
    left_out: tuple[LeftOut, ...]


def learn(
    tracks: Sequence[Track],
    scene: Scene,
    labels: Sequence[str],
    say: Callable[[Tried], object] = lambda _: None,
    terms: Collection[str] | None = None,
) -> Learned:
    """Fit a scene to tracks.

    Args:
        tracks: Stamped positions.
        scene: Surfaces, radii, masses; where fits begin.
        labels: Labels of the scene's spheres in the tracks.
        say: Called with each line of the table.
        terms: Names of the terms that are fitted, of those of the core, for a comparison; None:
            all that earn their place.

    Raises:
        UserError: There are too few tracks, or none has enough frames, or a surface changes place,
            or no ball moves.
    """
    for k, surface in enumerate(scene.surfaces):
        if surface.changes_place:
            raise UserError(
                f'surface {k} of the scene moves, and tracks do not say where it was; fit a scene '
                'without it, and add it to the result'
            )
    recorded = tracks
    laws = Laws(scene, max(len(labels), 1))
    noise = 1e-3
    for _ in range(2):  # where tracks are cut depends on the noise
        found = pieces(tracks, scene, labels, laws.models, noise)
        noise = shown_noise(found)
    scene, placed = placed_surfaces(scene, tracks, labels, noise)
    if placed:
        laws = Laws(scene, max(len(labels), 1))
        found = pieces(tracks, scene, labels, laws.models, noise)
        noise = shown_noise(found)
    few = len({one.track for one in found}) < _FEW_TRACKS
    if few:  # the flights of a few long recordings, in the order of time
        found.sort(key=lambda one: (one.track, one.times[0]))
        tracks = [_track_of(one, labels, k) for k, one in enumerate(found)]
        found = [replace(one, track=k) for k, one in enumerate(found)]
    every = stretches(found, laws.models, noise)
    numbers = sorted({one.track for one in every})
    found = [one for one in found if one.track in numbers]
    check_enough(recorded, found, every, noise)
    met = met_by(laws, every, noise)
    _look(laws, found, met)
    ladder = _ladder(laws, found, numbers, noise, few)
    _climb(ladder, laws, met, say, terms)
    learned = _finish(ladder, laws, met, every, {k: tracks[k] for k in numbers})
    learned = replace(learned, notes=(*placed, *learned.notes))
    return _with_collisions(learned, recorded, laws.models[0].radius, noise)


def _with_collisions(
    learned: Learned, tracks: Sequence[Track], radius: float, noise: float
) -> Learned:
    """The same with restitution and friction of two balls, where enough collisions show them.

    Restitution as parabolas on both sides show it, unless forecasts through collisions are better
    by more than an error bar with another; friction by forecasts.
    """
    shown = shown_collisions(tracks, radius)
    value, error = usual_restitution(shown) if len(shown) else (0.0, np.inf)
    if np.isfinite(error):
        learned = _of_balls(learned, 'restitution', value, error)
    told = told_by_forecasts(learned.scene, tracks, noise, 'restitution')
    if told is not None:
        learned = _of_balls(learned, 'restitution', *told)
    elif len(shown) and not np.isfinite(error):
        note = f'{len(shown)} collisions of two balls show, too few to tell their restitution'
        learned = replace(learned, notes=(*learned.notes, note))
    told = told_by_forecasts(learned.scene, tracks, noise, 'friction')
    return learned if told is None else _of_balls(learned, 'friction', *told)


def _of_balls(learned: Learned, name: Name, value: float, error: float) -> Learned:
    """The same with a value of two balls, in the fits without a part of the tracks, too."""
    left_out = tuple(
        replace(part, scene=with_value(part.scene, name, value)) for part in learned.left_out
    )
    told = learned.parameters | {f'balls.{name}': Told(value, error, '')}
    scene = with_value(learned.scene, name, value)
    return replace(learned, scene=scene, parameters=told, left_out=left_out)


def _look(laws: Laws, found: Sequence[Stretch], met: Met) -> None:
    """Begin restitutions where bounces show them, and a drag crisis at the usual speed."""
    flying = [one for one in found if one.on == FREE]
    speeds = [
        np.linalg.norm(np.diff(one.positions, axis=0), axis=1) / np.diff(one.times)
        for one in flying
    ]
    if speeds:
        laws.shown['air.crisis_speed'] = max(float(np.median(np.concatenate(speeds))), 1.0)
    for group, count in enumerate(met.impacts):
        shown = shown_restitution(laws, found, group) if count else None
        if shown is not None:
            laws.shown[f'contact {group}.restitution'] = shown


def _track_of(one: Stretch, labels: Sequence[str], number: int) -> Track:
    label = labels[one.sphere] if labels else '0'
    times = one.times - one.times[0]
    return Track(f'piece {number}', times, one.positions[:, None], None, (label,))


def _ladder(
    laws: Laws, found: Sequence[Stretch], numbers: Sequence[int], noise: float, together: bool
) -> Ladder:
    count = _FOLDS if len(numbers) < _MANY else 2
    folds = []
    for outside in groups_of(numbers, count, together):
        inside = stretches([one for one in found if one.track not in outside], laws.models, noise)
        folds.append(
            Fold(_some(inside, _MOST), _some([o for o in found if o.track in outside], _MOST))
        )
    setup = Setup((), 'none', np.inf, (noise, _DRIFT, _KICK))
    return Ladder(laws, folds, setup, together=together)


def _climb(
    ladder: Ladder,
    laws: Laws,
    met: Met,
    say: Callable[[Tried], object],
    terms: Collection[str] | None,
) -> None:
    def done() -> None:
        say(ladder.table[-1])

    ladder.begin()
    done()
    core = core_terms(laws, met)
    for rung, _ in core:
        if terms is None or rung.name in terms:
            ladder.add(rung)
            done()
    ladder.refit_noise()
    done()
    if terms is not None:
        return
    for rung in further_terms(laws, met):
        if ladder.climb(rung) is not None:
            done()
    for _, removal in core:
        if removal is not None and ladder.drop(removal) is not None:
            done()
    if ladder.settle():
        done()
    if ladder.correct() is not None:
        done()


def _finish(
    ladder: Ladder, laws: Laws, met: Met, every: Sequence[Stretch], tracks: dict[int, Track]
) -> Learned:
    setup = ladder.setup
    coverage, held = fit_coverage(
        ladder.drawn(ladder.correction, CLOSE, _SAMPLES), np.array(setup.noise)
    )
    for name in setup.names:  # the last fit begins where the folds agree
        laws.shown[name] = float(
            np.median([fold.fitted.values[name] for fold in ladder.folds if fold.fitted])
        )
    chosen = _some(every, _MOST_LAST)
    fitted, prior, unknown = fit_setup(laws, setup, chosen, None)
    groups = groups_of(list(tracks), min(_GROUPS, len(tracks)), ladder.together)
    parts = fits_without(laws, setup, chosen, fitted, groups)
    errors = jackknife_errors(setup, fitted, [values for values, _ in parts])
    correction = None if ladder.correction is None else correction_of(ladder, laws, parts, groups)
    told = {
        name: Told(fitted.values[name], errors[name], laws.start_of(name).unit)
        for name in setup.names
    }
    noise, drift, impact = (float(f'{value:.4g}') for value in setup.noise)
    spread, ahead, kick, open_ = (float(f'{value:.4g}') for value in coverage)
    tracker = Tracker(
        noise=noise,
        drift=drift,
        impact=impact,
        spread=spread,
        forecast_drift=open_,
        forecast_acceleration=ahead,
        forecast_impact=kick,
        memory=setup.memory,
        spins=_spins(setup, prior),
        correction=None if correction is None else kept(correction.whole()),
    )

    def without(k: int) -> LeftOut:
        values, prior = parts[k]
        own = None if correction is None else kept(correction.without(*groups[k]))
        part = replace(tracker, spins=_spins(setup, prior), correction=own)
        scene = replace(laws.scene_at(_rounded(values)), tracker=part)
        return LeftOut(scene, tuple(tracks[number] for number in sorted(groups[k])))

    counts = {'tracks': len(tracks), 'stretches': len(chosen), 'unknown': unknown}
    scene = replace(laws.scene_at(_rounded(fitted.values)), tracker=tracker)
    return Learned(
        scene=scene,
        parameters=told,
        table=tuple(ladder.table),
        coverage=held,
        counts=counts,
        notes=_notes(laws, ladder, met, told),
        diagnostics=diagnostics_of(laws, fitted, chosen),
        left_out=tuple(without(k) for k in range(len(groups))),
    )


def correction_of(
    ladder: Ladder,
    laws: Laws,
    parts: Sequence[tuple[dict[str, float], StartPrior | None]],
    groups: Sequence[Collection[int]],
) -> CorrectionFit:
    """Correction of starts by what fits without a group of tracks each miss of that group.

    Args:
        ladder: The terms, and the pieces of tracks.
        laws: The laws.
        parts: Values and spins of the fits.
        groups: Numbers of the tracks that each has not seen.
    """
    noise, every = ladder.setup.noise, [one for fold in ladder.folds for one in fold.outside]
    missed: list[Missed] = []
    for (values, prior), group in zip(parts, groups, strict=True):
        part = Part(values, prior, [one for one in every if one.track in group])
        missed += missed_by(laws, part, np.array(noise), ladder.setup.memory)
    return CorrectionFit(missed, noise[0])


def _notes(laws: Laws, ladder: Ladder, met: Met, told: dict[str, Told]) -> tuple[str, ...]:
    notes = []
    for g, (hits, stays) in enumerate(zip(met.impacts, met.stays, strict=True)):
        if not hits and not stays:
            count = len(laws.scene.surfaces)
            first = laws.groups[g][0] < count
            numbers = ', '.join(str(k if first else k - count) for k in laws.groups[g])
            what = f'{"surface" if first else "obstacle"} {numbers}'
            notes.append(f'contact {g} ({what}): no ball meets it, kept as given')
    for line in ladder.table:
        if line.name.startswith('without') and line.kept:
            term = line.name.removeprefix('without ')
            notes.append(f'{term}: left-out tracks are predicted no worse without it')
    for name, one in told.items():
        assumed = laws.start_of(name)
        near = abs(one.value - assumed.start) < 2 * one.error
        if near and one.error > 0.7 * assumed.width:
            notes.append(f'{name}: the data hardly tell it ({one.value:.3g} +- {one.error:.2g})')
    return tuple(notes)


def _spins(setup: Setup, prior: StartPrior | None) -> Spins | None:
    """Spins of some of the windows, evenly among all; None: any spin."""
    if prior is None:  # none was told to be better than any: 0.01 rad/s
        return Spins(((0.0,) * 9 + (1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4),))
    if setup.spin == 'broad':
        return None
    chosen = np.unique(np.linspace(0, len(prior.spins) - 1, _WINDOWS).astype(int))
    upper = np.triu_indices(3)
    rows = [(*prior.features[k], *prior.spins[k], *prior.covariances[k][upper]) for k in chosen]
    windows = tuple(tuple(float(f'{value:.4g}') for value in row) for row in rows)
    return Spins(windows, prior.bandwidth, prior.shrinkage, prior.floor)


def _some(found: Sequence[Stretch], most: int) -> list[Stretch]:
    """At most so many stretches, evenly among all."""
    if len(found) <= most:
        return list(found)
    return [found[k] for k in np.linspace(0, len(found) - 1, most).astype(int)]


def _rounded(values: dict[str, float]) -> dict[str, float]:
    return {name: float(f'{value:.6g}') for name, value in values.items()}
