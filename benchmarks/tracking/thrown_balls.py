# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Balls thrown on a table: where and when they cross a plane, against an integration.

    python benchmarks/tracking/thrown_balls.py --json docs/model/thrown_balls.json    # 2 minutes

A table tennis ball with spin is thrown over the table of `table_tennis`, and seen at 240 Hz with
1 mm of noise from the throw on. From what was seen in the first 0.3 s its crossing of the upright
plane is forecast in which it is 0.4 s later, mostly after a bounce. Truth is an integration of the
flight in air, as `Air` states it, and Walton's law of impact on the table, in code of its own: the
engine has no part in it. Rolling friction, which the engine lets act in an impact too, is 0.
Throws that meet the table's ends or the floor are drawn again.

inside  Share of the throws whose time and place of crossing are within the stated regions of 50
        and 90 %: ellipsoids of time and place in the plane together.
error   Distance between the stated and the true place in the plane [m]; of the time [s].
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
import sys
from typing import Any

import numpy as np
from rigid_gns_core import load_scene, load_simulator, Plane, Scene
from rigid_gns_core.files.strict_json import write_json
from rigid_gns_core.files.tables import format_rows, number
from rigid_gns_core.running.machine import describe_machine
from rigid_gns_core.tracking import estimate_state
from scipy.integrate import solve_ivp
from scipy.stats import chi2

RATE, NOISE = 240.0, 1e-3  # [Hz], [m]
SEEN, LEAD = 0.3, 0.4  # [s]
SPIN = 60.0  # standard deviation of a component [rad/s]: 1.2 m/s at the equator
HORIZON = 0.6  # that of the forecast [s]
SAMPLES = 64
FLOOR = 0.1  # a ball this far below the table has missed it [m]
SPREAD = 1.1  # throws whose place is so near an end [radii] are drawn again


@dataclass(frozen=True)
class Throw:
    """A throw: state at the start, shape (9,), and the true path as a function of time."""

    start: np.ndarray
    ends: list[float]
    flights: list[Any]

    def at(self, time: float) -> np.ndarray:
        """Position and velocity, shape (6,)."""
        index = int(np.searchsorted(self.ends, time))
        found: np.ndarray = self.flights[min(index, len(self.flights) - 1)](time)
        return found


@dataclass(frozen=True)
class Judged:
    """One throw judged.

    Args:
        probability: Of the smallest stated region that holds the true time and place.
        place_error: In the plane [m].
        time_error: Stated less true [s].
        crossed: Stated probability that it crosses within the horizon.
        bounces: Between the last frame seen and the true crossing.
    """

    probability: float
    place_error: float
    time_error: float
    crossed: float
    bounces: int


def flight(scene: Scene, velocity: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """Acceleration in air, as `Air` states it."""
    air, r, m = scene.air, float(scene.radius), float(scene.mass)
    volume, area, u = 4 / 3 * np.pi * r**3, np.pi * r**2, velocity - air.wind
    size, turning = np.linalg.norm(u), np.cross(spin, u)
    twist = np.linalg.norm(turning)
    ratio = r * twist / size**2
    force = (m - air.density * volume) * np.array(scene.gravity)
    force -= air.density * area / 2 * (air.drag_coefficient + air.drag_slope * ratio) * size * u
    lift = air.lift_coefficient * ratio / (ratio + air.lift_half_ratio)
    force += air.density * area / 2 * lift * size**2 * turning / max(twist, 1e-300)
    return force / (m + air.density * volume / 2)


def impact(scene: Scene, velocity: np.ndarray, spin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and spin after an impact on the table, of normal z: Walton's three parameters."""
    law, r, i = scene.surfaces[0].contact, float(scene.radius), float(scene.inertia_factor)
    arm = np.array([0.0, 0.0, -r])
    push = -(1 + law.curve.fast) * velocity[2]
    slip = velocity + np.cross(spin, arm)
    slip[2] = 0.0
    size = np.linalg.norm(slip)
    stop = (1 + law.tangential_restitution) * size * i / (1 + i)
    kick = -min(law.friction * push, stop) * slip / max(size, 1e-300)
    after = velocity + kick + [0.0, 0.0, push]
    return after, spin + np.cross(arm, kick) / (i * r**2)


def thrown(scene: Scene, generator: np.random.Generator, until: float) -> Throw | None:
    """Draw a throw; None where it meets more than the face of the table."""
    table, radius = scene.surfaces[0], float(scene.radius)
    start = np.concatenate(
        [
            generator.uniform([-1.3, -0.5, 0.1], [-0.9, 0.5, 0.4]),
            generator.uniform([3.0, -0.6, -1.0], [6.0, 0.6, 1.5]),
            generator.normal(0.0, SPIN, 3),
        ]
    )
    state, spin, begin = start[:6].copy(), start[6:].copy(), 0.0
    ends: list[float] = []
    flights: list[Any] = []

    def touches(_: float, now: np.ndarray) -> float:
        return float(now[2] - radius)

    touches.terminal, touches.direction = True, -1.0  # type: ignore[attr-defined]
    while begin < until:
        turning = spin.copy()

        def rate(_: float, now: np.ndarray, turning: np.ndarray = turning) -> np.ndarray:
            return np.append(now[3:], flight(scene, now[3:], turning))

        run = solve_ivp(
            rate, (begin, until), state, 'DOP853', dense_output=True, events=touches,
            rtol=1e-10, atol=1e-11,
        )  # fmt: skip
        begin, state = float(run.t[-1]), run.y[:, -1].copy()
        ends.append(begin)
        flights.append(run.sol)
        if begin < until:
            ends_of_table = table.half_lengths - SPREAD * radius
            if (np.abs(state[:2]) > ends_of_table).any() or state[5] > -0.05:
                return None
            velocity, spin = impact(scene, state[3:], spin)
            state = np.concatenate([state[:3], velocity])
    return Throw(start, ends, flights)


def thrown_scene() -> Scene:
    """Scene of a table tennis table whose law is Walton's alone, and the same at all speeds."""
    scene = load_scene('table_tennis')
    table, *others = scene.surfaces
    law = replace(table.contact, rolling_friction=0.0)
    if law.curve.slow != law.curve.fast:
        raise ValueError('the restitution of the table depends on speed: not written here')
    return replace(scene, surfaces=(replace(table, contact=law), *others))


def crossings(
    throws: int, seed: int = 0, samples: int = SAMPLES, seen_for: float = SEEN
) -> list[Judged]:
    """Judge forecasts of so many throws."""
    scene, simulator = thrown_scene(), load_simulator()
    generator = np.random.default_rng(seed)
    times = np.arange(round(seen_for * RATE) + 1) / RATE
    judged: list[Judged] = []
    while len(judged) < throws:
        throw = thrown(scene, generator, seen_for + LEAD + 1e-6)
        if throw is None:
            continue
        truth = throw.at(seen_for + LEAD)
        seen = np.array([throw.at(time)[:3] for time in times])
        seen += generator.normal(0.0, NOISE, seen.shape)
        # upright, and across the way of the ball
        ahead = np.array([truth[3], truth[4], 0.0])
        plane = Plane(tuple(truth[:3]), tuple(-ahead))
        estimate = estimate_state(scene, times, seen[:, None])
        forecast = simulator.forecast(scene, estimate, [HORIZON], samples, seed)
        found = forecast.crossing(plane)
        bounces = sum(seen_for < end < seen_for + LEAD for end in throw.ends[:-1])
        judged.append(_judged(found, plane, truth, bounces))
    return judged


def _judged(found: Any, plane: Plane, truth: np.ndarray, bounces: int) -> Judged:
    """Judge a crossing; where none was stated the errors are infinite."""
    crossed = float(found.probability[0])
    if not crossed:
        return Judged(1.0, np.inf, np.inf, crossed, bounces)
    turn = np.zeros((3, 7))  # time, and place along the two axes of the plane
    turn[0, 0] = 1.0
    turn[1:, 1:4] = plane.axes[:2]
    off = np.concatenate([[found.time[0] - LEAD], found.position[0] - truth[:3], np.zeros(3)])
    own = turn @ off
    spread = turn @ found.covariance[0] @ turn.T
    probability = float(chi2.cdf(own @ np.linalg.solve(spread, own), 3))
    return Judged(probability, float(np.linalg.norm(own[1:])), float(own[0]), crossed, bounces)


def summary_of(judged: list[Judged]) -> dict[str, Any]:
    """Numbers of some throws."""
    places = np.array([one.place_error for one in judged])
    times = np.abs([one.time_error for one in judged])
    inside = np.array([one.probability for one in judged])
    return {
        'throws': len(judged),
        'inside_50': float((inside <= 0.5).mean()),
        'inside_90': float((inside <= 0.9).mean()),
        'place_median_m': float(np.median(places)),
        'place_p90_m': float(np.quantile(places, 0.9)),
        'time_median_s': float(np.median(times)),
        'time_p90_s': float(np.quantile(times, 0.9)),
        'stated_to_cross': float(np.mean([one.crossed for one in judged])),
    }


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--throws', type=int, default=300)
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--samples', type=int, default=SAMPLES)
    parser.add_argument('--seen', type=float, default=SEEN, help='[s]')
    parser.add_argument('--json', type=Path)
    arguments = parser.parse_args()
    judged = crossings(arguments.throws, arguments.seed, arguments.samples, arguments.seen)
    groups = {'all': judged}
    for bounces in sorted({one.bounces for one in judged}):
        groups[str(bounces)] = [one for one in judged if one.bounces == bounces]
    found = {name: summary_of(own) for name, own in groups.items()}
    rows = [
        [
            name,
            str(one['throws']),
            *(f'{100 * one[key]:.0f} %' for key in ('inside_50', 'inside_90')),
            *(number(100 * one[key]) for key in ('place_median_m', 'place_p90_m')),
            *(number(1e3 * one[key]) for key in ('time_median_s', 'time_p90_s')),
        ]
        for name, one in found.items()
    ]
    head = ['bounces ahead', 'throws', 'in 50 %', 'in 90 %', 'place [cm]', '90 %', 'time [ms]']
    print(format_rows([*head, '90 %'], rows))
    if arguments.json:
        setup = {'rate_hz': RATE, 'noise_m': NOISE, 'seen_s': arguments.seen, 'lead_s': LEAD}
        setup |= {'spin_rad_s': SPIN, 'samples': arguments.samples, 'seed': arguments.seed}
        write_json(
            arguments.json,
            {
                'command': 'python benchmarks/tracking/thrown_balls.py',
                'machine': describe_machine(),
                'setup': setup,
                'by_bounces_ahead': found,
            },
        )
    return 0


if __name__ == '__main__':
    sys.exit(main())
