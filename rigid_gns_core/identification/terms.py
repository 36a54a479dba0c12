# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The terms that a fit tries, in the order in which they build on each other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from .ladder import always, Rung, Setup
from .parameters import Laws, WALL
from .stretches import Stretch
from ..tracking.ball_contact import FREE

# a law is fitted that so many stretches meet
_FEWEST = 3
# bandwidths of the prior that are tried [deviations of the features]
_BANDWIDTHS = (0.4, 0.2, 0.1)
# memories of estimates that are tried, each after the one before [s]; more frames take too long
_MEMORIES, _MOST_FRAMES = (0.4, 0.8, 1.6), 100
_LIFT = 'air.lift_coefficient'


@dataclass(frozen=True)
class Met:
    """What balls meet in some stretches.

    Args:
        flights: Number of stretches in the air.
        impacts: Number of stretches with impacts, by group of surfaces and obstacles.
        stays: Number of stretches on a surface, by group.
        surfaces: Surfaces with impacts.
        interval: From frame to frame [s].
    """

    flights: int
    impacts: tuple[int, ...]
    stays: tuple[int, ...]
    surfaces: tuple[int, ...]
    interval: float


def met_by(laws: Laws, found: Sequence[Stretch], noise: float) -> Met:
    """What balls meet: surfaces that frames come near to, and those that balls stay on."""
    impacts, stays = [0] * len(laws.groups), [0] * len(laws.groups)
    group_of = {k: g for g, group in enumerate(laws.groups) for k in group}
    body_of = {row: k for k, rows in enumerate(laws.rows) for row in rows}
    surfaces: dict[int, int] = {}
    flights = 0
    for one in found:
        model = laws.models[min(one.sphere, len(laws.models) - 1)]
        flights += one.on == FREE
        if one.on != FREE:
            stays[group_of[body_of[one.on]]] += 1
        step = np.linalg.norm(np.diff(one.positions, axis=0), axis=1).max()
        for k, height in enumerate(model.heights(one.positions).min(axis=1)):
            if k != body_of.get(one.on) and height < 5 * noise + 0.5 * step:
                impacts[group_of[k]] += 1
                if k < model.surfaces:
                    surfaces[k] = surfaces.get(k, 0) + 1
    touched = tuple(k for k, count in sorted(surfaces.items()) if count >= _FEWEST)
    interval = float(np.median(np.concatenate([np.diff(one.times) for one in found])))
    return Met(flights, tuple(impacts), tuple(stays), touched, interval)


def core_terms(laws: Laws, met: Met) -> list[tuple[Rung, Rung | None]]:
    """Terms that are added in turn whatever they do, each with its removal; None: it stays."""
    terms: list[tuple[Rung, Rung | None]] = [(_adding('contacts', _contacts(laws, met)), None)]
    flies = met.flights >= _FEWEST
    if flies:
        terms.append((_adding('drag', ('air.drag_coefficient',)), None))
    lift = (_LIFT,) if flies else ()
    name = 'lift and any spin' if flies else 'any spin'
    terms.append((Rung(name, lambda setup: replace(_with(lift, setup), spin='broad')), None))
    learned = Rung('spins as of other tracks', lambda setup: replace(setup, spin='learned'))
    # what other tracks tell of a spin is not given up for a draw: a window alone tells little
    broad = Rung(
        'without spins of other tracks', lambda setup: replace(setup, spin='broad'), bars=1.0
    )
    terms.append((learned, broad))
    grips = tuple(
        f'contact {g}.tangential_restitution'
        for g, count in enumerate(met.impacts)
        if count >= _FEWEST
    )
    tilts = tuple(n for n in _frame(laws, met) if 'tilt' in n)
    optional = [('grip', grips), ('gravity', _gravity(laws, flies))]
    if flies:
        optional.insert(1, ('drag by spin', ('air.drag_slope',)))
    for name, names in optional:
        if names:
            terms.append((_adding(name, names), _removing(name, names)))
    if tilts:
        terms.append((_adding('surface tilt', tilts), _removing('surface tilt', tilts)))
    return terms


def further_terms(laws: Laws, met: Met) -> list[Rung]:
    """Terms that are added only where they help."""
    terms = [
        Rung(
            f'spins of like windows, {width:g}',
            partial(_at_bandwidth, width),
            lambda setup: setup.spin == 'learned',
        )
        for width in _BANDWIDTHS
    ]
    for before, memory in pairwise(_MEMORIES):
        if memory <= _MOST_FRAMES * met.interval:
            terms.append(_remembering(before, memory))
    terms.append(Rung('drift a tenth', _stiffer))
    terms.append(Rung('noise doubled, drift a fifth', _doubled))
    if met.flights >= _FEWEST:
        for field in ('lift_half_ratio', 'spin_decay'):
            terms.append(_adding(field.replace('_', ' '), (f'air.{field}',), _spins))
        crisis = ('air.drag_drop', 'air.crisis_speed')
        terms.append(_adding('drag over speed', crisis))
        level = [a for a, up in zip('xyz', np.abs(laws.scene.up), strict=True) if up < 0.5]
        terms.append(_adding('wind', tuple(f'air.wind_{axis}' for axis in level)))
    for g, count in enumerate(met.impacts):
        if count >= _FEWEST:
            names = (f'contact {g}.restitution_drop', f'contact {g}.restitution_speed')
            terms.append(_adding(f'restitution over speed, {g}', names))
            planes = [
                laws.scene.surfaces[k] for k in laws.groups[g] if k < len(laws.scene.surfaces)
            ]
            if any(abs(np.dot(plane.normal, laws.scene.up)) < WALL for plane in planes):
                terms.append(_adding(f'lean of walls, {g}', (f'contact {g}.lean',)))
    for g, count in enumerate(met.stays):
        if count >= _FEWEST:
            terms.append(
                _adding(f'rolling over speed, {g}', (f'contact {g}.rolling_friction_slope',))
            )
            names = (f'contact {g}.spinning_friction',)
            terms.append(_adding(f'spinning friction, {g}', names, _spins))
    return terms


def _contacts(laws: Laws, met: Met) -> tuple[str, ...]:
    names: list[str] = []
    for g, (hits, stays) in enumerate(zip(met.impacts, met.stays, strict=True)):
        if hits >= _FEWEST:
            names.append(f'contact {g}.restitution')
        if max(hits, stays) >= _FEWEST:
            names.append(f'contact {g}.friction')
        if stays >= _FEWEST:
            names.append(f'contact {g}.rolling_friction')
    return (*names, *(n for n in _frame(laws, met) if 'height' in n))


def _frame(laws: Laws, met: Met) -> tuple[str, ...]:
    """Heights of surfaces with impacts, and tilts of those that carry."""
    names = []
    for k in met.surfaces:
        names.append(f'surface {k}.height')
        if np.asarray(laws.scene.surfaces[k].normal) @ laws.scene.up > WALL:
            names += [f'surface {k}.tilt_x', f'surface {k}.tilt_y']
    return tuple(names)


def _gravity(laws: Laws, flies: bool) -> tuple[str, ...]:
    """Components of gravity; without flights those along the surfaces only."""
    up = np.abs(laws.scene.up)
    return tuple(
        f'gravity.{axis}' for axis, part in zip('xyz', up, strict=True) if flies or part < 0.5
    )


def _adding(name: str, names: tuple[str, ...], needs: Callable[[Setup], bool] = always) -> Rung:
    return Rung(name, partial(_with, names), needs)


def _removing(name: str, names: tuple[str, ...]) -> Rung:
    return Rung(f'without {name}', partial(_without, names))


def _spins(setup: Setup) -> bool:
    return setup.spin != 'none'


def _with(names: tuple[str, ...], setup: Setup) -> Setup:
    return replace(setup, names=tuple(dict.fromkeys((*setup.names, *names))))


def _without(names: tuple[str, ...], setup: Setup) -> Setup:
    return replace(setup, names=tuple(name for name in setup.names if name not in names))


def _at_bandwidth(width: float, setup: Setup) -> Setup:
    return replace(setup, bandwidth=width)


def _remembering(before: float, memory: float) -> Rung:
    """A spin that contacts alone show is remembered from one to the next."""
    return Rung(
        f'memory of {memory:g} s',
        lambda setup: replace(setup, memory=memory),
        lambda setup: setup.memory == before,
    )


def _stiffer(setup: Setup) -> Setup:
    """Stretches that the laws miss tell a larger drift than most have."""
    noise, drift, impact = setup.noise
    return replace(setup, noise=(noise, 0.1 * drift, impact))


def _doubled(setup: Setup) -> Setup:
    """Residuals that are correlated within the filter's reach weigh less."""
    noise, drift, impact = setup.noise
    return replace(setup, noise=(2.0 * noise, 0.2 * drift, impact))
