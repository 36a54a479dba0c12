# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ball of the demo: what a tracker of positions sees of a table tennis ball that spins."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rigid_gns_core import load_scene, load_simulator, State
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.bags.topics import find_topics
from rigid_gns_core.data.records import Record, write_record
from rigid_gns_core.recordings.decoded_topic import decode_topic
from rigid_gns_core.recordings.recorded_forecasts import recorded_futures
from rigid_gns_core.scenes.state import Array, Trajectory

SCENE = 'table_tennis'
RATE = 180.0  # of the tracker [Hz]
NOISE = 0.001  # of each coordinate [m]
SECONDS = 1.1  # until the ball has left the table
LEADS = (0.2, 0.4)  # [s] ahead, at which errors are told
# a shot along the table, with topspin and side spin that the simulator is not told
_START = {
    'positions': [[-1.3, 0.1, 0.35]],
    'velocities': [[3.1, -0.15, 0.9]],
    'angular_velocities': [[8.0, 130.0, -45.0]],
}
_SECONDS_TO_NS = 1e9
# a prediction is compared with a lead no farther off than this [s]
_APART = 0.015


def write_ball(path: Path) -> Record:
    """Write the record that the tracker plays: true positions by the laws, no rotations."""
    simulator, scene = load_simulator('laws'), load_scene(SCENE)
    start = State(**{name: np.array(value) for name, value in _START.items()})
    times = np.arange(round(SECONDS * RATE) + 1) / RATE
    positions = simulator.forecast(scene, start, times).positions
    still = np.zeros_like(positions)
    turns = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (*positions.shape[:2], 4))
    seen = Trajectory(
        positions=positions,
        quaternions=turns,
        velocities=still,
        angular_velocities=still,
        dt=1.0 / RATE,
    )
    record = Record(trajectory=seen, scene=scene, seed=0, teacher={'engine': 'laws'}, name='ball')
    write_record(path, record, 'poses')
    return record


def ball_errors(bag: Path, record: Record) -> dict[float, Array]:
    """Distances of the recorded forecasts from the true ball [m], by lead time [s].

    Args:
        bag: Bag that the simulator recorded.
        record: What the tracker played.
    """
    topics = find_topics(read_bag(bag))
    truth, dt = record.trajectory.positions[:, 0], record.trajectory.dt
    first = decode_topic(topics.tracked).frames[0]
    # the tracker drops frames for which it is late: which one came first is told by its place
    index = int(np.linalg.norm(truth - first.poses[0, :3], axis=1).argmin())
    begin = first.stamp_ns - index * dt * _SECONDS_TO_NS
    times = np.arange(len(truth)) * dt
    found: dict[float, list[float]] = {lead: [] for lead in LEADS}
    for forecast in recorded_futures(topics.trajectory, []):
        since = (forecast.stamps - forecast.start_ns) / _SECONDS_TO_NS
        for lead, errors in found.items():
            near = int(np.abs(since - lead).argmin())
            time = (forecast.stamps[near] - begin) / _SECONDS_TO_NS
            if abs(since[near] - lead) <= _APART and 0.0 <= time <= times[-1]:
                place = [np.interp(time, times, truth[:, axis]) for axis in range(3)]
                predicted = forecast.frames[near].poses[0, :3]
                errors.append(float(np.linalg.norm(predicted - place)))
    return {lead: np.array(errors) for lead, errors in found.items()}


def told(errors: dict[float, Array]) -> str:
    """Lines on the errors."""
    lines = []
    for lead, own in errors.items():
        if not len(own):
            lines.append(f'  {lead:g} s ahead: no forecast')
            continue
        mean, median = 100 * own.mean(), 100 * float(np.median(own))
        lines.append(
            f'  {lead:g} s ahead: mean {mean:.1f} cm, median {median:.1f} cm, of {len(own)} '
            'forecasts'
        )
    return '\n'.join(lines)
