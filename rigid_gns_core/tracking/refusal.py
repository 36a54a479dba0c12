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

"""Tracked frames that cannot be used, and lines about them that could repeat."""

from __future__ import annotations

import numpy as np

from ..scenes.state import Array


class RejectedFrame(ValueError):
    """A tracked frame cannot be used. `kind` names the check that failed."""

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(message)
        self.kind = kind


def check_poses(poses: Array, far: float) -> None:
    """Refuse poses that are no measurement, such as positions beyond `far` [m].

    Raises:
        RejectedFrame: Says which pose, and why.
    """
    finite = np.isfinite(poses).all(axis=1)
    if not finite.all():
        sphere = int(np.argmin(finite))
        values = ', '.join(f'{value:g}' for value in poses[sphere])
        raise RejectedFrame(
            'finite', f'the pose of sphere {sphere} is ({values}), expected finite numbers'
        )
    out = np.abs(poses[:, :3]).max(axis=1, initial=0.0)
    if (out > far).any():
        raise RejectedFrame(
            'far',
            f'sphere {int(np.argmax(out))} is {out.max():.3g} m out, expected at most '
            f'{far:.3g} m (a million radii); are positions in metres?',
        )
    norms = np.hypot.reduce(poses[:, 3:], axis=1)  # squares could overflow
    off = (norms < 1e-6) | (norms > 1e6)
    if off.any():
        sphere = int(np.argmax(off))
        raise RejectedFrame(
            'quaternion',
            f'the quaternion of sphere {sphere} has norm {norms[sphere]:.2g}, expected 1; send '
            '(0, 0, 0, 1) where a rotation is unknown',
        )


class Throttle:
    """Admits one message of a kind per period, and counts those held back.

    Args:
        period: Least time between two messages of one kind [s].
    """

    def __init__(self, period: float) -> None:
        self.period = period
        self._next: dict[str, float] = {}
        self._held: dict[str, int] = {}

    def admit(self, kind: str, now: float) -> int | None:
        """Return how many of that kind were held back since the last one; None: hold back this.

        Args:
            kind: What is counted.
            now: Time of any steady clock [s].
        """
        if now < self._next.get(kind, -np.inf):
            self._held[kind] = self._held.get(kind, 0) + 1
            return None
        self._next[kind] = now + self.period
        return self._held.pop(kind, 0)


def seconds(stamp_ns: int) -> str:
    """Return a stamp in seconds with all its digits, which a float would not keep."""
    sign = '-' if stamp_ns < 0 else ''
    whole, rest = divmod(abs(stamp_ns), 10**9)
    return f'{sign}{whole}.{rest:09d}'
