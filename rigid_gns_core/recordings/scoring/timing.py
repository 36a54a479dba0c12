# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Lateness of recorded messages."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from ..decoded_topic import DecodedTopic
from ...bags.reader import Topic
from ...messages.poses import decode_float64, MessageError
from ...scenes.state import Array
from ...tracking.usable_frames import Stamps


def lateness(name: str, frames: DecodedTopic) -> dict[str, float]:
    """Quantiles of log time minus stamp [ms], with `name` as prefix of the keys."""
    return quantiles(name, (frames.times - frames.stamps) * 1e-6) if frames.frames else {}


def step_times(topic: Topic) -> tuple[Stamps, Array]:
    """Log times [ns] and times of model steps [s], both (k,), without damaged messages."""
    kept, seconds = [], []
    for index, message in enumerate(topic.messages):
        with suppress(MessageError):
            seconds.append(decode_float64(message))
            kept.append(index)
    return topic.times[kept], np.array(seconds, dtype=np.float64)


def quantiles(name: str, milliseconds: NDArray[np.floating]) -> dict[str, float]:
    """Median, 99 % quantile and maximum of times [ms], with `name` as prefix of the keys."""
    return {
        f'{name}_p50_ms': float(np.median(milliseconds)),
        f'{name}_p99_ms': float(np.quantile(milliseconds, 0.99)),
        f'{name}_max_ms': float(milliseconds.max()),
    }
