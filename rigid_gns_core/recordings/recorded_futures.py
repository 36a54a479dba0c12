# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Whole futures that a simulator recorded on predicted_trajectory, each a forecast of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from .forecast_starts import Forecasted
from ..bags.reader import Topic
from ..forecasts.starts import Start
from ..messages.poses import MessageError, PoseArrayFrame
from ..messages.trajectories import decode_trajectory


def recorded_futures(topic: Topic | None, starts: Sequence[Start]) -> Iterator[Forecasted]:
    """Futures of a recording; messages that are damaged are left out.

    Args:
        topic: Topic of futures; None: there are none.
        starts: Recorded starts; a future gets the last one before it with its spheres.
    """
    if topic is None:
        return
    places = [start.place for start in starts]
    for message, place in zip(topic.messages, topic.places, strict=True):
        try:
            future = decode_trajectory(message)
        except MessageError:
            continue
        if not len(future.times_ns):
            continue
        index = int(np.searchsorted(places, place)) - 1
        if index >= 0 and starts[index].ids is not None:
            names = tuple(f'sphere_{sphere}' for sphere in starts[index].ids or ())
            if names != future.names:
                continue
        stamps = future.stamp_ns + np.array(future.times_ns, dtype=np.int64)
        frames = [
            PoseArrayFrame(int(stamp), future.frame_id, poses)
            for stamp, poses in zip(stamps, future.poses, strict=True)
        ]
        yield Forecasted(
            future.stamp_ns, index, stamps, frames, np.full(len(stamps), place, dtype=np.int64)
        )
