# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Runs of a faulty tracker (shuffled, lost, false, late poses), for tracking_filter.py."""

from __future__ import annotations

from dataclasses import dataclass
import time
from typing import Any

import numpy as np
from rigid_gns_core.messages.poses import PoseArrayFrame
from rigid_gns_core.scenes.state import Array
from rigid_gns_core.tracking.usable_frames import RejectedFrame
from rigid_gns_core.tracking.window import TrackingWindow
from truth import Truth

LENGTH = 6


@dataclass(frozen=True)
class Faults:
    """Faults of a tracker, which always shuffles the poses.

    Args:
        name: Name in the table.
        lost: Share of poses that are missing.
        false: False detections per sphere and frame.
        late: Share of frames that arrive after the next one or two.
        dropped: Share of frames that never arrive.
        repeated: Share of frames that arrive twice.
    """

    name: str
    lost: float = 0.0
    false: float = 0.0
    late: float = 0.0
    dropped: float = 0.0
    repeated: float = 0.0


FAULTS = (
    Faults('shuffled'),
    Faults('10 % of poses lost', lost=0.1),
    Faults('2 % false poses', false=0.02),
    Faults('10 % of frames lost', dropped=0.1),
    Faults('10 % of frames late, 10 % twice', late=0.1, repeated=0.1),
    Faults('all of these', 0.1, 0.02, 0.1, 0.1, 0.1),
)


def tracking_window(truth: Truth, length: int) -> TrackingWindow:
    """Window with data association, as in the simulator."""
    return TrackingWindow(
        frame_id='world',
        length=length,
        max_spheres=100_000,
        gravity=truth.scene.gravity,
        max_gap=1.0,
        radius=truth.radius,
        check=lambda _: None,
        on_gap=lambda _: None,
        scene=truth.scene,
        matched=True,
    )


def follow(truth: Truth, noise: float) -> list[dict[str, Any]]:
    """Identity switches, lost and false tracks, a row for each kind of tracker."""
    rows = []
    for faults in FAULTS:
        rng = np.random.default_rng(7)
        window = tracking_window(truth, LENGTH)
        known: dict[int, int] = {}
        switches = untracked = false = total = 0
        for index, frame in _sent(truth, noise, faults, rng):
            try:
                window.add(frame, frame.stamp_ns)
            except RejectedFrame:
                continue
            if not window.full or window.stamp_ns != frame.stamp_ns:
                continue
            total += truth.trajectory.count
            state = window.start()[1]
            places = truth.trajectory.positions[index]
            apart = np.linalg.norm(state.positions[:, None] - places, axis=-1)
            who = apart.argmin(axis=1)
            near = apart[np.arange(len(who)), who] < truth.radius
            false += int((~near).sum())
            untracked += len(places) - len(set(who[near].tolist()))
            for name, sphere in zip(np.array(window.ids)[near], who[near], strict=True):
                switches += int(known.get(int(name), int(sphere)) != sphere)
                known[int(name)] = int(sphere)
        rows.append(
            {
                'scene': truth.name,
                'noise': noise,
                'tracker': faults.name,
                'sphere_frames': total,
                'switches': switches,
                'untracked': untracked,
                'false': false,
                'noise_told': window.noise,
                'generation': window.generation,
                'counts': dict(window.counts),
            }
        )
    return rows


def _sent(
    truth: Truth, noise: float, faults: Faults, rng: np.random.Generator
) -> list[tuple[int, PoseArrayFrame]]:
    """Frames in the order of arrival, each with its index in the truth."""
    states = truth.trajectory
    low, high = states.positions.min(axis=(0, 1)), states.positions.max(axis=(0, 1))
    arrivals = []
    for index in range(len(states)):
        if rng.random() < faults.dropped:
            continue
        places = states.positions[index] + rng.normal(0.0, noise, (states.count, 3))
        poses = np.c_[places, states.quaternions[index]][rng.random(states.count) >= faults.lost]
        count = rng.poisson(faults.false * states.count)
        others = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
        poses = np.concatenate([poses, np.c_[rng.uniform(low, high, (count, 3)), others]])
        stamp = round(states.times[index] * 1e9)
        frame = PoseArrayFrame(stamp, 'world', poses[rng.permutation(len(poses))])
        delay = rng.uniform(1.0, 2.0) if rng.random() < faults.late else 0.0
        arrivals.append((index + delay, index, frame))
        if rng.random() < faults.repeated:
            arrivals.append((index + delay + 0.5, index, frame))
    return [(index, frame) for _, index, frame in sorted(arrivals, key=lambda one: one[:2])]


def cost_of_a_frame(truth: Truth, spheres: int = 300) -> dict[str, float]:
    """Median CPU time of a frame by window length [ms]; 300 spheres are of two boxes."""
    states = truth.trajectory
    places = np.concatenate([states.positions, states.positions + [0.0, 0.0, 300.0]], axis=1)
    turns = np.concatenate([states.quaternions, states.quaternions], axis=1)
    costs = {}
    for length in (3, 6, 10):
        window, rng = tracking_window(truth, length), np.random.default_rng(0)
        times = []
        for index in range(40, 140):
            noisy: Array = places[index] + rng.normal(0.0, 1e-2, places[index].shape)
            poses = np.c_[noisy, turns[index]][:spheres]
            frame = PoseArrayFrame(
                round(states.times[index] * 1e9), 'world', poses[rng.permutation(len(poses))]
            )
            begin = time.process_time()
            window.add(frame, frame.stamp_ns)
            times.append(1e3 * (time.process_time() - begin))
        costs[str(length)] = float(np.median(times[20:]))
    return costs
