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

"""From which tracked frames a forecast started, and why: what ~/start says. No ROS needed.

A forecast depends on these frames, their noise, the scene and the model alone, and a prediction on
its forecast and its stamp, so that recorded frames and starts give every recorded prediction
again. Where poses are matched to spheres, who is who depends on all frames accepted since the last
start whose reason is first, reset or restart.
"""

from __future__ import annotations

from dataclasses import dataclass
import json
from typing import Literal

Reason = Literal['first', 'every', 'diverged', 'reset', 'restart', 'spheres']


@dataclass(frozen=True)
class Start:
    """The start of a forecast.

    Args:
        stamp_ns: Stamp of the frame it starts from [ns].
        window_ns: Stamps of the frames that its velocities come from, that frame last [ns].
        reason: first: the node's first; every: a newer frame, with `start: every`; diverged: the
            error passed its bound; reset: after ~/reset; restart: tracker or clock began anew, the
            node was paused, or a forecast failed; spheres: the set of spheres changed.
        ids: Id of each sphere, in the order of predicted poses.
        noise: Of each coordinate of a tracked position, as given or estimated so far [m].
    """

    stamp_ns: int
    window_ns: tuple[int, ...]
    reason: Reason
    ids: tuple[int, ...]
    noise: float

    @property
    def json(self) -> str:
        """As ~/start publishes it."""
        return json.dumps(
            {
                'stamp_ns': self.stamp_ns,
                'window_ns': list(self.window_ns),
                'reason': self.reason,
                'ids': list(self.ids),
                'noise': self.noise,
            }
        )
