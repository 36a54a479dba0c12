"""Checks of an engine against closed forms, each with its error and its bound.

`run_checks` takes any callable with the signature of `teacher.simulate`, so that a learned
simulator can be put to the same checks. `rigid-gns teacher-card` runs them on Bullet.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from . import closed_form
from .bounce import GRAVITY, Simulate, bounces
from .scene import Plane, Scene
from .state import Array, State


@dataclass(frozen=True)
class Check:
    """One measured quantity; `error` is relative to `expected` where that is not 0."""

    name: str
    case: str
    measured: float
    expected: float
    error: float
    bound: float

    @property
    def passed(self) -> bool:
        """Whether the error is within the bound; a value that is not finite is not."""
        return bool(abs(self.error) <= self.bound)


def _check(
    name: str, case: str, measured: float | np.floating, expected: float, bound: float
) -> Check:
    error = (measured - expected) / abs(expected) if expected else measured
    return Check(name, case, float(measured), float(expected), float(error), bound)


def _worst(name: str, cases: list[str], measured: Array, expected: Array, bound: float) -> Check:
    """The worst of several cases stands for all."""
    checks = [
        _check(name, *values, bound) for values in zip(cases, measured, expected, strict=True)
    ]
    return max(checks, key=lambda check: abs(check.error) if np.isfinite(check.error) else np.inf)


def _bounce_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    restitutions = np.array([0.3, 0.6, 0.9] if quick else [0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9])
    drops = np.array([0.5, 2.0] if quick else [0.5, 1.0, 5.0, 20.0, 80.0, 230.0])
    for radius in (1.0,) if quick else (1.0, 0.02):
        at_impact, rise = bounces(simulate, radius, restitutions, drops)
        for k, drop in enumerate(drops):
            where = f'drop {drop:g} r, r {radius:g} m, e '
            cases = [f'{where}{e:g}' for e in restitutions for _ in range(at_impact.shape[2])]
            expected = np.repeat(restitutions, at_impact.shape[2])
            yield _worst('restitution at impact', cases, at_impact[:, k].ravel(), expected, 0.01)
            yield _worst(
                'restitution by rise, mean',
                [f'{where}{e:g}' for e in restitutions],
                rise[:, k].mean(-1),
                restitutions,
                0.01,
            )
            yield _worst('restitution by rise, each', cases, rise[:, k].ravel(), expected, 0.01)


def _incline_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    frictions, rollings = (1.0, 1.0, 0.02), (0.0, 0.02, 0.0)
    for degrees in (2.0, 20.0) if quick else (2.0, 5.0, 10.0, 20.0, 30.0, 40.0):
        angle = np.radians(degrees)
        plane = Plane(normal=(np.sin(angle), 0.0, np.cos(angle)), friction=1.0)
        start = np.asarray(plane.normal) + 4.0 * np.outer(np.arange(3.0), (0.0, 1.0, 0.0))
        trajectory = simulate(
            Scene(surfaces=(plane,), friction=frictions, rolling_friction=rollings),
            State(positions=start),
            20,
            0.1,
        )
        down = np.array([np.cos(angle), 0.0, -np.sin(angle)])
        speeds = trajectory.velocities[-1] @ down / trajectory.times[-1]
        for kind, friction, rolling, speed in zip(
            ('rolling', 'with rolling friction', 'slipping'),
            frictions,
            rollings,
            speeds,
            strict=True,
        ):
            expected = closed_form.incline_acceleration(angle, friction, rolling, GRAVITY)
            yield _check(f'incline, {kind} [m/s^2]', f'{degrees:g} deg', speed, expected, 0.01)
    plane = Plane(normal=(np.sin(np.radians(1.0)), 0.0, np.cos(np.radians(1.0))), friction=1.0)
    start = State(positions=np.array([plane.normal]))
    rest = simulate(Scene(surfaces=(plane,), rolling_friction=0.02), start, 50, 0.1)
    drift = float(np.linalg.norm(rest.positions[-1] - rest.positions[0]))
    yield _check('drift where rolling friction holds [m in 5 s]', '1 deg, rho 0.02', drift, 0, 1e-3)


def _level_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    angles = np.radians([0.0, 20.0, 45.0] if quick else [0.0, 10.0, 20.0, 30.0, 45.0, 60.0, 90.0])
    heading = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=-1)
    start = np.c_[np.zeros_like(angles), 60.0 * np.arange(len(angles)), np.ones_like(angles)]
    cases = [f'heading {angle:.0f} deg' for angle in np.degrees(angles)]
    slid = simulate(
        Scene(friction=0.55, rolling_friction=0.0),
        State(positions=start, velocities=5.0 * heading),
        20,
        0.1,
    )
    expected = np.full(len(angles), 5.0 / 1.4)
    speed = np.linalg.norm(slid.velocities[-1], axis=-1)
    yield _worst('sliding to rolling, speed [m/s]', cases, speed, expected, 0.01)
    surface = np.linalg.norm(slid.angular_velocities[-1], axis=-1)
    yield _worst('sliding to rolling, r times spin [m/s]', cases, surface, expected, 0.01)

    rho, v0 = 0.1, 2.0
    rolled = simulate(
        Scene(rolling_friction=rho),
        State(
            positions=start,
            velocities=v0 * heading,
            angular_velocities=v0 * np.cross([0.0, 0.0, 1.0], heading),
        ),
        50,
        0.1,
    )
    slower = (v0 - np.linalg.norm(rolled.velocities[10], axis=-1)) / rolled.times[10]
    expected = np.full(len(angles), rho * GRAVITY / 1.4)
    yield _worst('rolling to rest, deceleration [m/s^2]', cases, slower, expected, 0.01)
    path = rolled.positions[-1] - rolled.positions[0]
    bend = np.linalg.norm(np.cross(path, heading), axis=-1) / np.linalg.norm(path, axis=-1)
    yield _worst('rolling to rest, path bends by [rad]', cases, bend, 0.0 * bend, 1e-3)
    yield _worst(
        'rolling to rest, distance [m]',
        cases,
        np.linalg.norm(path, axis=-1),
        np.full(len(angles), 0.5 * v0**2 * 1.4 / (rho * GRAVITY)),
        0.01,
    )
    last = np.linalg.norm(rolled.velocities[-1], axis=-1)
    yield _worst('rolling to rest, last speed [m/s]', cases, last, 0.0 * last, 1e-3)


def _oblique_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    e, height = 0.6, 2.0
    cases = [  # pair friction, velocity across, spin
        (0.9, (2.0, 1.0), (3.0, -2.0, 4.0)),
        (0.1, (2.0, 1.0), (10.0, -20.0, 5.0)),
    ]
    if not quick:
        cases += [
            (0.9, (3.0, 0.0), (0.0, 0.0, 0.0)),
            (0.05, (8.0, 3.0), (0.0, 0.0, 0.0)),
            (0.0, (2.0, 1.0), (10.0, -20.0, 5.0)),
        ]
    start = State(
        positions=np.array([(0.0, 20.0 * k, 1.0 + height) for k in range(len(cases))]),
        velocities=np.array([(*across, 0.0) for _, across, _ in cases]),
        angular_velocities=np.array([spin for _, _, spin in cases]),
    )
    fall = np.sqrt(2.0 * height / GRAVITY)
    after = simulate(
        Scene(
            surfaces=(Plane(restitution=1.0, friction=1.0),),
            restitution=e,
            rolling_friction=0.0,
            friction=tuple(case[0] for case in cases),
        ),
        start,
        int(fall / 0.1) + 2,
        0.1,
    )
    up = np.array([0.0, 0.0, 1.0])
    for k, (friction, across, spin) in enumerate(cases):
        before = np.array([*across, -GRAVITY * fall])
        velocity, turned = closed_form.impact_on_surface(
            before, np.array(spin), up, 1.0, e, friction
        )
        case = f'mu {friction:g}, across {across}, spin {spin}'
        error = np.linalg.norm((after.velocities[-1, k] - velocity)[:2])
        yield _check('oblique impact, velocity across', case, error / GRAVITY / fall, 0, 0.01)
        error = np.linalg.norm(after.angular_velocities[-1, k] - turned)
        yield _check('oblique impact, spin', case, error / GRAVITY / fall, 0, 0.01)


def _collision_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    cases = [
        (ratio, e, 0.0) for ratio in (1.0, 3.0, 100.0) for e in ((0.6,) if quick else (0, 0.6, 1))
    ] + [(ratio, 0.6, offset) for ratio in (1.0, 5.0) for offset in (0.4, 1.0, 1.6)]
    friction, speed = 0.3, 4.0
    for spins in ((0.0, 0.0, 0.0), (1.0, 2.0, 3.0)):
        masses = np.array([(1.0, ratio) for ratio, _, _ in cases])
        positions = np.array(
            [
                ((-3.1, 40.0 * k + offset, 0.0), (0.0, 40.0 * k, 0.0))
                for k, (_, _, offset) in enumerate(cases)
            ]
        )
        velocities = np.zeros_like(positions)
        velocities[:, 0, 0] = speed
        turning = np.zeros_like(positions)
        turning[:, 0] = spins
        restitution = np.sqrt([e for _, e, _ in cases]).repeat(2)
        run = simulate(
            Scene(
                surfaces=(),
                gravity=(0.0, 0.0, 0.0),
                mass=tuple(masses.ravel()),
                restitution=tuple(restitution),
                friction=float(np.sqrt(friction)),
                rolling_friction=0.0,
            ),
            State(
                positions=positions.reshape(-1, 3),
                velocities=velocities.reshape(-1, 3),
                angular_velocities=turning.reshape(-1, 3),
            ),
            10,
            0.1,
        )
        for k, (ratio, e, offset) in enumerate(cases):
            pair, radii = slice(2 * k, 2 * k + 2), np.ones(2)
            normal = np.array([-np.sqrt(4.0 - offset**2), offset, 0.0]) / 2.0
            expected = closed_form.impact_of_spheres(
                velocities[k], turning[k], normal, radii, masses[k], float(e), friction
            )
            kind = 'oblique' if offset else 'central'
            case = f'masses 1:{ratio:g}, e {e:g}, offset {offset:g} r, spin {spins[2]:g}'
            error = np.abs(run.velocities[-1, pair] - expected[0]).max() / speed
            yield _check(f'two spheres, {kind}, velocities', case, error, 0, 0.01)
            error = np.abs(run.angular_velocities[-1, pair] - expected[1]).max() / speed
            yield _check(f'two spheres, {kind}, spins', case, error, 0, 0.01)
            linear, angular = closed_form.momenta(
                # about a point of the pair, or the distance to the origin drowns the rest
                run.positions[:, pair] - positions[k, 1],
                run.velocities[:, pair],
                run.angular_velocities[:, pair],
                masses[k],
                radii,
            )
            drift = np.linalg.norm(linear[-1] - linear[0]) / np.linalg.norm(linear[0])
            yield _check('two spheres, momentum', case, drift, 0, 1e-4)
            drift = np.linalg.norm(angular[-1] - angular[0]) / speed
            yield _check('two spheres, angular momentum / (m v r)', case, drift, 0, 0.01)


def deepest(positions: Array) -> tuple[float, float]:
    """Deepest penetration among unit spheres, and into z < 0, in diameters; positions (n, 3)."""
    gaps = np.linalg.norm(positions[:, None] - positions[None], axis=-1)
    np.fill_diagonal(gaps, np.inf)
    return max(0.0, 2.0 - gaps.min()) / 2.0, max(0.0, 1.0 - positions[:, 2].min()) / 2.0


def _pile_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    side, layers, steps = (2, 2, 40) if quick else (3, 3, 150)
    draw = np.random.default_rng(0)
    grid = np.stack(np.meshgrid(*[2.1 * (np.arange(side) - (side - 1) / 2)] * 2), -1).reshape(-1, 2)
    start = np.concatenate(
        [
            np.c_[
                grid + draw.uniform(-0.03, 0.03, grid.shape), np.full(len(grid), 1.2 + 2.3 * layer)
            ]
            for layer in range(layers)
        ]
    )
    # so narrow that the spheres lean on the walls
    width = 2.17 * side
    scene = Scene(surfaces=Plane.box(width, width))
    run = simulate(scene, State(positions=start), steps, 0.1)
    case = f'{len(start)} spheres, {steps * 0.1:g} s'
    between, floor = np.max([deepest(frame) for frame in run.positions[steps // 2 :]], axis=0)
    yield _check('pile, penetration of spheres [diameters]', case, between, 0, 1e-3)
    yield _check('pile, penetration of the floor [diameters]', case, floor, 0, 1e-3)
    beyond = max(0.0, np.abs(run.positions[steps // 2 :, :, :2]).max() + 1.0 - width / 2)
    yield _check('pile, penetration of the walls [diameters]', case, beyond / 2, 0, 1e-3)
    total = closed_form.energy(
        run.positions,
        run.velocities,
        run.angular_velocities,
        np.ones(len(start)),
        np.ones(len(start)),
        np.asarray(scene.gravity),
    )
    gain = np.maximum(np.diff(total), 0.0).sum() / (total[0] - GRAVITY * len(start))
    yield _check('pile, energy gained / energy at the start', case, gain, 0, 1e-4)

    grid = np.stack(np.meshgrid(*[2.0 * np.arange(4.0)] * 2), -1).reshape(-1, 2)
    rest = simulate(
        Scene(), State(positions=np.c_[grid, np.ones(len(grid))]), 20 if quick else 100, 0.1
    )
    moved = np.linalg.norm(rest.positions[-1] - rest.positions[0], axis=-1).max()
    yield _check('spheres at rest that touch, drift [r]', f'{len(grid)} spheres', moved, 0, 1e-3)


GROUPS: dict[str, Callable[[Simulate, bool], Iterator[Check]]] = {
    'bounce': _bounce_checks,
    'incline': _incline_checks,
    'level': _level_checks,
    'oblique': _oblique_checks,
    'collision': _collision_checks,
    'pile': _pile_checks,
}


def run_checks(
    simulate: Simulate, quick: bool = False, groups: tuple[str, ...] = tuple(GROUPS)
) -> list[Check]:
    """Run all checks on an engine: a callable (scene, start, steps, dt) -> Trajectory.

    Args:
        simulate: The engine.
        quick: Fewer cases and shorter piles.
        groups: Names in `GROUPS`.

    Raises:
        ValueError: A group is unknown.
    """
    if unknown := sorted(set(groups) - set(GROUPS)):
        raise ValueError(f'unknown group of checks {unknown[0]!r}, allowed: {", ".join(GROUPS)}')
    return [check for name in groups for check in GROUPS[name](simulate, quick)]
