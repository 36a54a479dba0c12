# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parts of the node's benchmark: their cases, and the measures of a run."""

from __future__ import annotations

from typing import Any

import numpy as np
from outcome import Outcome, quantiles
from run import Case

SETTLING = 60.0  # memory is compared with that after so long, in shorter runs after half of it [s]

# model steps per second go with sqrt(1 / radius): 10 Hz at 1 m, 70.7 Hz at 20 mm, 100 Hz at 10 mm
CASES = {
    'rate': [
        Case(
            f'{spheres} spheres, {hertz} Hz, {start}, {"busy core" if busy else "idle"}',
            spheres,
            radius,
            1,
            {'start': start},
            busy=busy,
        )
        for busy in (False, True)
        for spheres, hertz, radius in ((300, 10, 1.0), (50, 71, 0.02))
        for start in ('first', 'every')
    ],
    'horizon': [
        Case(
            f'50 spheres of {size}, tracker at {hertz} Hz, {start}',
            50,
            radius,
            stride,
            {'start': start, 'horizon': '1.0'},
        )
        # seven model steps of 20 mm are 0.099 s
        for size, hertz, radius, stride in (
            ('20 mm', 71, 0.02, 1),
            ('20 mm', 10, 0.02, 7),
            ('1 m', 10, 1.0, 1),
        )
        for start in ('first', 'every')
    ],
    'crossing': [
        Case(
            f'one ball, throws at 240 Hz, {samples} samples',
            1,
            0.02,
            1,
            {
                'start': 'every',
                'horizon': '0.5',
                'samples': str(samples),
                'crossing_planes': "'{height: {point: [0, 0, 0.1], normal: [0, 0, 1]}}'",
            },
            throws_hz=240.0,
            air=True,
        )
        for samples in (32, 64)
    ],
    'learn': [
        Case(
            f'one ball, throws at 240 Hz, {"learning" if learn else "not learning"}',
            1,
            0.02,
            1,
            {'start': 'every', 'horizon': '0.5', 'learn': str(learn).lower()},
            throws_hz=240.0,
        )
        for learn in (False, True)
    ],
    'soak': [
        Case(
            '50 spheres of 10 mm, 100 Hz',
            50,
            0.01,
            1,
            {'start': 'every', 'record_max_size': '50.0'},
        ),
        Case(
            '8 balls at 240 Hz, futures of 0.5 s',
            8,
            0.02,
            1,
            {'start': 'every', 'horizon': '0.5', 'record_max_size': '50.0'},
            bouncing_hz=240.0,
        ),
    ],
}


def measure_rate(outcome: Outcome) -> dict[str, Any]:
    """Lateness of predictions, and losses in the bag."""
    recorded = outcome.recorded
    stamps, system = outcome.heard['predicted_poses'][:, :2].T
    return {
        'missed': missed(recorded.stamps, outcome.period),
        **of_the_host(outcome),
        'lost_in_bag': outcome.counts['published'] - len(recorded.stamps),
        'heard_but_not_in_bag': len(np.setdiff1d(stamps, recorded.stamps)),
        'in_bag': len(recorded.stamps),
        'heard': len(stamps),
        'files': recorded.files,
        'bag_warnings': list(recorded.warnings),
        'lateness_heard_ms': quantiles((system - stamps) * 1e-9),
        'lateness_bag_ms': quantiles(recorded.lateness),
        'step_time_ms': quantiles(recorded.step_times),
    }


def measure_horizon(outcome: Outcome) -> dict[str, Any]:
    """Time from a tracked frame to its future."""
    futures = outcome.heard['predicted_trajectory']
    arrivals = {int(row[0]): int(row[2]) for row in futures}
    first, last = (min(arrivals), max(arrivals)) if arrivals else (0, -1)
    # before the first the window fills, after the last the node is stopped
    frames = [(int(stamp), int(sent)) for stamp, sent in outcome.sent if first <= stamp <= last]
    waits = [arrivals[stamp] - sent for stamp, sent in frames if stamp in arrivals]
    return {
        'frames': len(frames),
        'without_future': len(frames) - len(waits),
        'horizon_heard_ms': quantiles(1e-9 * np.array(waits, dtype=np.float64)),
        'horizon_bag_ms': quantiles(outcome.recorded.waits),
        'message_bytes': int(futures[:, 3].max(initial=0)),
    }


def measure_crossing(outcome: Outcome) -> dict[str, Any]:
    """Time from a tracked frame to the crossing that is forecast from it."""
    told = outcome.heard['simulator/crossings']
    arrivals = {int(row[0]): int(row[2]) for row in told}
    first, last = (min(arrivals), max(arrivals)) if arrivals else (0, -1)
    frames = [(int(stamp), int(sent)) for stamp, sent in outcome.sent if first <= stamp <= last]
    waits = [arrivals[stamp] - sent for stamp, sent in frames if stamp in arrivals]
    return {
        'frames': len(frames),
        'without_crossing': len(frames) - len(waits),
        'crossing_heard_ms': quantiles(1e-9 * np.array(waits, dtype=np.float64)),
        'crossing_bag_ms': quantiles(outcome.recorded.crossing_waits),
    }


def measure_learn(outcome: Outcome) -> dict[str, Any]:
    """As `rate`, with steps that were missed while the ball flew, and scenes that were taken."""
    sent, stamps = outcome.sent[:, 0], outcome.recorded.stamps
    begins = np.flatnonzero(np.diff(sent, prepend=-np.inf) > 10 * outcome.tracked_dt * 1e9)
    flights = zip(sent[begins], [*sent[begins[1:] - 1], sent[-1]], strict=True)
    own = [stamps[(stamps >= first) & (stamps <= last)] for first, last in flights]
    return {
        **measure_rate(outcome),
        **measure_horizon(outcome),
        'missed': sum(missed(flight, outcome.period) for flight in own),
        'throws': len(own),
        'learned_scenes': outcome.learned,
    }


def measure_soak(outcome: Outcome) -> dict[str, Any]:
    """Growth of memory, with the measures of `rate`."""
    times, resident = outcome.memory.T
    settled = min(SETTLING, times[-1] / 2)
    base = float(resident[times >= settled][0])
    after = resident[times >= settled]
    return {
        **measure_rate(outcome),
        'expected': outcome.counts['published'] + missed(outcome.recorded.stamps, outcome.period),
        'settled_after_s': float(settled),
        'memory_settled_bytes': int(base),
        'memory_most_bytes': int(after.max()),
        'memory_end_bytes': int(after[-1]),
        'growth_percent': round(100 * (float(after.max()) / base - 1), 4),
        'growth_at_end_percent': round(100 * (float(after[-1]) / base - 1), 4),
        'memory_each_minute_bytes': resident[::60].astype(int).tolist(),
    }


def missed(stamps: np.ndarray, period: float) -> int:
    """Stamps left out between the first and the last, which are a period [s] apart."""
    steps = np.round(np.diff(stamps) * 1e-9 / period).astype(np.int64)
    return int((steps - 1).sum())


def of_the_host(outcome: Outcome) -> dict[str, Any]:
    """Time that the host took from this machine, and how many steps were missed meanwhile.

    A gap between stamps counts where the host took at least half of it, from the gap's begin to
    one poll after its end.
    """
    times, taken = outcome.stolen.T
    stamps, period = outcome.recorded.stamps, outcome.period
    gaps = np.diff(stamps) * 1e-9
    while_taken = 0
    for k in np.flatnonzero(gaps > 1.5 * period):
        ends = np.searchsorted(times, (stamps[k], stamps[k + 1])) + (-1, 1)
        begin, end = np.clip(ends, 0, len(times) - 1)
        if taken[end] - taken[begin] >= 0.5 * gaps[k]:
            while_taken += round(gaps[k] / period) - 1
    return {
        'missed_while_host_took_time': while_taken,
        'taken_by_host_s': round(float(taken[-1] - taken[0]), 2),
    }
