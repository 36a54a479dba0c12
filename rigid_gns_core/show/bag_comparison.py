# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Comparison of predicted and tracked poses of a bag."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from .comparison import Comparison
from ..bags.reader import read_bag
from ..bags.topics import find_topics, holds_predictions, list_topics
from ..errors import UserError
from ..recordings.decoded_topic import decode_topic
from ..recordings.scoring.evaluate import score_bag
from ..recordings.scoring.timing import step_times
from ..scenes.state import Array


def read_bag_comparison(
    path: Path, *, scene: str | None, tracked: str | None, predicted: str | None
) -> Comparison:
    """Read predicted and tracked poses of a bag, its scores and its timing.

    Args:
        path: Bag folder, or an .mcap file.
        scene: Shipped name or YAML file of the scene. None: the recorded one.
        tracked: Topic of the tracked poses. None: that of the simulator.
        predicted: Topic of the predicted poses. None: that of the simulator.

    Raises:
        UserError: The bag cannot be read, lacks a topic or a scene, or nothing overlaps.
    """
    bag = read_bag(path)
    if not holds_predictions(bag, predicted):
        raise UserError(
            f'{path}: there are no predicted poses in this bag to report on; play it to a '
            'simulator that records (playback_launch.py), or make records of it with `rigid-gns '
            'import`, predict from one (docs/tutorial.md), and report on that with --reference. '
            f'The bag holds {list_topics(bag)}'
        )
    scored = score_bag(bag, scene=scene, tracked=tracked, predicted=predicted)
    topics = find_topics(bag, tracked, predicted)
    return Comparison(
        title=scored.title,
        scene=scored.scene,
        predicted=scored.predicted,
        reference=scored.tracked,
        names=('predicted', 'tracked'),
        evaluation=scored.report,
        recording=_times(decode_topic(topics.predicted), topics.step_time),
    )


def _times(ours: Any, step_time: Any) -> dict[str, tuple[Array, Array]]:
    """Lateness, periods and step times [ms], over log times since the first prediction [s]."""
    log = np.asarray(ours.times, dtype=np.int64)
    since: Array = 1e-9 * (log - log[0]).astype(np.float64)
    late: Array = 1e-6 * (log - ours.stamps).astype(np.float64)
    periods: Array = 1e-6 * np.diff(log).astype(np.float64)
    times = {'lateness': (since, late), 'period': (since[1:], periods)}
    if step_time is not None and len(step_time):
        logged, seconds = step_times(step_time)
        times['model step'] = ((logged - log[0]) * 1e-9, 1e3 * seconds)
    return times
