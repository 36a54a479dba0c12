# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of contacts that share a sphere: blows on a floor, corners, three at once, rest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from . import laws
from .bounces import GRAVITY, Simulate
from .check import Check, check
from .runs import AHEAD, EXACT, NEAR, plate, simulated, velocity_check
from ..scenes.plane import Plane
from ..scenes.state import Array

_FLOOR = Plane()
_UP = np.array([0.0, 0.0, 1.0])
# all but no friction between spheres, that of the pair with a floor of _FRICTION / _SMOOTH
_SMOOTH, _FRICTION = 1e-6, 0.3


def shared_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """What a blow gives where the sphere has other contacts, and rest in corners."""
    blows = [(e, v) for e in (0.0, 0.5, 0.9, 1.0) for v in (0.3, 1.0, 3.0)]
    blows = blows[4:9:2] if quick else blows
    yield from _walls(simulate, blows)
    yield from _pairs(simulate, blows)
    yield from _corners(simulate, blows)
    yield from _three_spheres(simulate, [e for e in (1.0, 0.5) if not quick or e == 1.0])
    yield from _rolling(simulate, [(e, v) for e, v in blows if e >= 0.5])
    yield from _passing(simulate)
    yield from _rest(simulate, 20.0 if not quick else 3.0)


def _walls(simulate: Simulate, blows: Sequence[tuple[float, float]]) -> Iterator[Check]:
    """A sphere that slides on a floor hits a wall: upright, aslant, or leaning."""
    for e, v in blows:
        for degrees in (0.0, 35.0, 70.0):
            across = np.radians(degrees)
            velocity = v * np.array([np.cos(across), np.sin(across), 0.0])
            start = -AHEAD * velocity - [1.0, 0.0, -1.0]
            run = simulated(
                simulate,
                (_FLOOR, Plane(normal=(-1.0, 0.0, 0.0))),
                [start],
                [velocity],
                [[0.3, -0.2, 0.5]],
                seconds=AHEAD,
                restitution=e,
            )
            expected = velocity * [-e, 1.0, 1.0]
            case = f'e {e:g}, {v:g} m/s, at {degrees:g} deg'
            yield velocity_check('on a floor, off a wall', case, run, [expected], v, EXACT)
    # n = (-cos, 0, -sin) presses the sphere on the floor, which answers: it comes back at e v
    for lean in (-20.0, 20.0):
        for e in sorted({e for e, _ in blows if e > 0}):
            sine, cosine = np.sin(np.radians(lean)), np.cos(np.radians(lean))
            normal = np.array([-cosine, 0.0, -sine])
            velocity = np.array([[3.0, 0.0, 0.0]])
            contacts = [(0, None, normal), *([(0, None, _UP)] if lean > 0 else [])]
            after = laws.simultaneous_impacts(velocity, np.ones(1), contacts, e)
            touch = np.array([-(1.0 + sine) / cosine, 0.0, 1.0])
            wall = plate(np.zeros(3), normal, (0.0, 1.0, 0.0), np.inf, np.inf)
            start = touch - AHEAD * velocity
            run = simulated(
                simulate, (_FLOOR, wall), start, velocity, seconds=AHEAD, restitution=e
            )
            if lean < 0:  # it is thrown up
                after = after - GRAVITY * (run.times[-1] - AHEAD) * _UP
            case = f'e {e:g}, leans by {lean:g} deg'
            yield velocity_check('on a floor, off a leaning wall', case, run, after, 3.0, EXACT)


def _pairs(simulate: Simulate, blows: Sequence[tuple[float, float]]) -> Iterator[Check]:
    """A sphere that slides on a floor hits another one, of another mass or radius."""
    for e, v in blows:
        for masses in ((1.0, 1.0), (3.0, 1.0), (1.0, 3.0), (10.0, 1.0)):
            run = simulated(
                simulate,
                (_FLOOR,),
                [(-2.0 - AHEAD * v, 0.0, 1.0), (0.0, 0.0, 1.0)],
                [(v, 0.0, 0.0), (0.0, 0.0, 0.0)],
                seconds=AHEAD,
                restitution=e,
                mass=masses,
            )
            one, other = masses
            expected = np.zeros((2, 3))
            expected[:, 0] = (one - e * other) * v, (1.0 + e) * one * v
            case = f'e {e:g}, {v:g} m/s, masses {one:g}:{other:g}'
            name = 'on a floor, off a sphere'
            yield velocity_check(name, case, run, expected / sum(masses), v, EXACT)
    for radii in ((1.0, 0.5), (0.5, 1.0)):
        for e in sorted({e for e, _ in blows if e > 0}):
            # so fast that the large one is still in the air in the next frame
            velocity = np.array([[12.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
            height = np.array(radii)
            across = float(np.sqrt(height.sum() ** 2 - (height[1] - height[0]) ** 2))
            normal = np.array([-across, 0.0, height[0] - height[1]]) / height.sum()
            small = int(np.argmin(radii))  # pressed on the floor; the large one is lifted
            masses = height**3
            contacts = [(0, 1, normal), (small, None, _UP)]
            after = laws.simultaneous_impacts(velocity, masses, contacts, e)
            start = np.array([(-across, 0.0, radii[0]), (0.0, 0.0, radii[1])]) - AHEAD * velocity
            run = simulated(
                simulate,
                (_FLOOR,),
                start,
                velocity,
                seconds=AHEAD,
                restitution=e,
                radius=radii,
                mass=tuple(masses),
            )
            after[1 - small] -= GRAVITY * (run.times[-1] - AHEAD) * _UP
            case = f'e {e:g}, radii {radii[0]:g} and {radii[1]:g}'
            yield velocity_check(
                'on a floor, off a sphere of another radius', case, run, after, 12.0, EXACT
            )


def _corners(simulate: Simulate, blows: Sequence[tuple[float, float]]) -> Iterator[Check]:
    """A sphere slides into the corner of a floor and two walls, at both at once or one by one."""
    walls = (Plane(normal=(-1.0, 0.0, 0.0)), Plane(normal=(0.0, -1.0, 0.0)))
    for e, v in blows:
        for later in (0.0, 0.011, 0.2):
            velocity = v * np.array([1.0, 0.6, 0.0])
            start = np.array([-1.0 - AHEAD * v, -1.0 - (AHEAD + later) * 0.6 * v, 1.0])
            run = simulated(
                simulate,
                (_FLOOR, *walls),
                [start],
                [velocity],
                seconds=AHEAD + later,
                restitution=e,
            )
            case = f'e {e:g}, {v:g} m/s, second wall {later:g} s later'
            yield velocity_check('in a corner', case, run, [-e * velocity], v, EXACT)


def _three_spheres(simulate: Simulate, restitutions: Sequence[float]) -> Iterator[Check]:
    """A sphere hits two that touch, at both at once."""
    touch = np.array([(-np.sqrt(3.0), 0.0, 1.0), (0.0, 1.0, 1.0), (0.0, -1.0, 1.0)])
    normals = 0.5 * (touch[0] - touch[1:])
    for e in restitutions:
        for mass in (1.0, 2.0, 0.3):
            for where, surfaces in (('in the air', ()), ('on a floor', (_FLOOR,))):
                velocity = np.array([[2.0, 0.0, 0.0], [0.0] * 3, [0.0] * 3])
                masses = np.array([mass, 1.0, 1.0])
                contacts = [(0, 1, normals[0]), (0, 2, normals[1])]
                after = laws.simultaneous_impacts(velocity, masses, contacts, e)
                run = simulated(
                    simulate,
                    surfaces,
                    touch - AHEAD * velocity,
                    velocity,
                    seconds=AHEAD,
                    restitution=e,
                    mass=tuple(masses),
                    gravity=(0.0, 0.0, -GRAVITY if surfaces else 0.0),
                )
                case = f'{where}, e {e:g}, mass {mass:g} hits 1 and 1'
                yield velocity_check('off two spheres at once', case, run, after, 2.0, EXACT)


def _rolling(simulate: Simulate, blows: Sequence[tuple[float, float]]) -> Iterator[Check]:
    """Rolling spheres collide on a rough floor: they keep their spin, slip, and roll again."""
    floor = Plane(friction=_FRICTION / _SMOOTH)
    for kind in ('head on', 'one at rest'):
        for e, v in blows:
            before = np.array([v, -v if kind == 'head on' else 0.0])
            relative, middle = 0.5 * e * (before[0] - before[1]), before.mean()
            after = middle + relative * np.array([-1.0, 1.0])
            motion, spin = np.zeros((2, 2, 3))
            motion[:, 0], spin[:, 1] = before, before
            touch = np.array([(-1.0, 0.0, 1.0), (1.0, 0.0, 1.0)])
            for moment, later in (('just after', 0.0), ('rolls again', 0.8)):
                run = simulated(
                    simulate,
                    (floor,),
                    touch - AHEAD * motion,
                    motion,
                    spin,
                    seconds=AHEAD + later,
                    restitution=e,
                    friction=_SMOOTH**2,
                )
                time = run.times[-1] - AHEAD
                expected = np.zeros((2, 3))
                expected[:, 0] = [
                    laws.slide_to_roll(speed, surface, _FRICTION, GRAVITY, time)
                    for speed, surface in zip(after, before, strict=True)
                ]
                case = f'{kind}, e {e:g}, {v:g} m/s, {moment}'
                yield velocity_check('rolling spheres collide', case, run, expected, v, NEAR)


def _passing(simulate: Simulate) -> Iterator[Check]:
    """Rolling on a floor past a sphere or along a wall, with next to no gap: nothing happens."""
    wall = Plane(normal=(0.0, -1.0, 0.0))
    for gap in (1e-9, 1e-6, 1e-3):
        for kind, surfaces, count in (('sphere', (_FLOOR,), 2), ('wall', (_FLOOR, wall), 1)):
            start = np.array([(-1.4, -1.0 - gap, 1.0), (0.0, 1.0, 1.0)])[:count]
            motion = np.array([(4.0, 0.0, 0.0), (1.0, 0.0, 0.0)])[:count]
            run = simulated(
                simulate,
                surfaces,
                start,
                motion,
                np.cross(_UP, motion),
                seconds=1.0,
                restitution=0.5,
                friction=0.4,
            )
            case = f'{kind}, gap {gap:g} r'
            yield velocity_check('passes by without touching', case, run, motion, 4.0, EXACT)


def _rest(simulate: Simulate, seconds: float) -> Iterator[Check]:
    """A sphere pressed by its weight into a groove or a corner does not move."""
    grooves = [np.radians(pair) for pair in ((45.0, 45.0), (30.0, 30.0), (20.0, 50.0))]
    places = {
        f'groove of {np.degrees(a):.0f} and {np.degrees(b):.0f} deg': np.array(
            [(np.sin(a), 0.0, np.cos(a)), (-np.sin(b), 0.0, np.cos(b))]
        )
        for a, b in grooves
    }
    places |= {f'corner {k}': normals for k, normals in enumerate(_tilted_corners())}
    for place, normals in places.items():
        centre = np.linalg.lstsq(normals, np.ones(len(normals)), rcond=None)[0]
        surfaces = tuple(Plane(normal=tuple(normal)) for normal in normals)
        for friction in (0.0, 0.5):
            run = simulated(
                simulate, surfaces, [centre], seconds=seconds, restitution=0.5, friction=friction
            )
            moved = np.linalg.norm(run.positions - centre, axis=-1).max()
            case = f'{place}, friction {friction:g}'
            yield check('rest in a groove or corner, drift [r]', case, moved, 0.0, EXACT)


def _tilted_corners() -> list[Array]:
    """Normals of a floor and two walls, turned so that all three carry; shapes (3, 3)."""
    equal = np.array([(2.0, -1.0, -1.0), (0.0, np.sqrt(3.0), -np.sqrt(3.0)), [np.sqrt(2.0)] * 3])
    sine, cosine = np.sin(0.3), np.cos(0.3)
    turn = np.array([(cosine, 0.0, sine), (0.0, 1.0, 0.0), (-sine, 0.0, cosine)])
    return [equal.T / np.sqrt(6.0), equal.T / np.sqrt(6.0) @ turn]
