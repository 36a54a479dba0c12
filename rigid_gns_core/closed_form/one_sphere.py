# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of single spheres on a surface: bounce, slope, level floor, oblique impact."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from . import laws
from .bounces import bounces, GRAVITY, Simulate
from .check import Check, check, worst
from ..scenes.plane import Plane
from ..scenes.scene import Scene
from ..scenes.state import State


def bounce_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Restitution of spheres dropped on a floor, at the impact and by their rise."""
    restitutions = np.array([0.3, 0.6, 0.9] if quick else [0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9])
    drops = np.array([0.5, 2.0] if quick else [0.5, 1.0, 5.0, 20.0, 80.0, 230.0])
    for radius in (1.0,) if quick else (1.0, 0.02):
        at_impact, rise = bounces(simulate, radius, restitutions, drops)
        for k, drop in enumerate(drops):
            where = f'drop {drop:g} r, r {radius:g} m, e '
            cases = [f'{where}{e:g}' for e in restitutions for _ in range(at_impact.shape[2])]
            expected = np.repeat(restitutions, at_impact.shape[2])
            yield worst('restitution at impact', cases, at_impact[:, k].ravel(), expected, 0.01)
            yield worst(
                'restitution by rise, mean',
                [f'{where}{e:g}' for e in restitutions],
                rise[:, k].mean(-1),
                restitutions,
                0.01,
            )
            yield worst('restitution by rise, each', cases, rise[:, k].ravel(), expected, 0.01)


def incline_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Acceleration down a slope: rolling, against rolling friction, slipping; and rest."""
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
            expected = laws.incline_acceleration(angle, friction, rolling, GRAVITY)
            yield check(f'incline, {kind} [m/s^2]', f'{degrees:g} deg', speed, expected, 0.01)
    plane = Plane(normal=(np.sin(np.radians(1.0)), 0.0, np.cos(np.radians(1.0))), friction=1.0)
    start = State(positions=np.array([plane.normal]))
    rest = simulate(Scene(surfaces=(plane,), rolling_friction=0.02), start, 50, 0.1)
    drift = float(np.linalg.norm(rest.positions[-1] - rest.positions[0]))
    yield check('drift where rolling friction holds [m in 5 s]', '1 deg, rho 0.02', drift, 0, 1e-3)


def level_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """From sliding to rolling, and from rolling to rest, in several directions."""
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
    yield worst('sliding to rolling, speed [m/s]', cases, speed, expected, 0.01)
    surface = np.linalg.norm(slid.angular_velocities[-1], axis=-1)
    yield worst('sliding to rolling, r times spin [m/s]', cases, surface, expected, 0.01)

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
    yield worst('rolling to rest, deceleration [m/s^2]', cases, slower, expected, 0.01)
    path = rolled.positions[-1] - rolled.positions[0]
    bend = np.linalg.norm(np.cross(path, heading), axis=-1) / np.linalg.norm(path, axis=-1)
    yield worst('rolling to rest, path bends by [rad]', cases, bend, 0.0 * bend, 1e-3)
    yield worst(
        'rolling to rest, distance [m]',
        cases,
        np.linalg.norm(path, axis=-1),
        np.full(len(angles), 0.5 * v0**2 * 1.4 / (rho * GRAVITY)),
        0.01,
    )
    last = np.linalg.norm(rolled.velocities[-1], axis=-1)
    yield worst('rolling to rest, last speed [m/s]', cases, last, 0.0 * last, 1e-3)


def oblique_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Velocity and spin after an oblique impact on a floor."""
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
        velocity, turned = laws.impact_on_surface(before, np.array(spin), up, 1.0, e, friction)
        case = f'mu {friction:g}, across {across}, spin {spin}'
        error = np.linalg.norm((after.velocities[-1, k] - velocity)[:2])
        yield check('oblique impact, velocity across', case, error / GRAVITY / fall, 0, 0.01)
        error = np.linalg.norm(after.angular_velocities[-1, k] - turned)
        yield check('oblique impact, spin', case, error / GRAVITY / fall, 0, 0.01)
