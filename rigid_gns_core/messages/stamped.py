# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""geometry_msgs/PoseStamped and TwistStamped from CDR bytes."""

from __future__ import annotations

from dataclasses import dataclass

from .cdr import Reader
from ..scenes.state import Array


@dataclass(frozen=True)
class Stamped:
    """Pose or twist of one body.

    Args:
        stamp_ns: Time stamp [ns].
        frame_id: Coordinate frame.
        values: Position [m] and quaternion (x, y, z, w), shape (7,); or linear [m/s] and angular
            [rad/s] velocity, shape (6,).
    """

    stamp_ns: int
    frame_id: str
    values: Array


def decode_pose_stamped(cdr: bytes) -> Stamped:
    """Pose of a geometry_msgs/PoseStamped of either byte order.

    Raises:
        MessageError: The bytes are no such message.
    """
    return _decoded(cdr, 'PoseStamped', 7)


def decode_twist_stamped(cdr: bytes) -> Stamped:
    """Twist of a geometry_msgs/TwistStamped; see `decode_pose_stamped`."""
    return _decoded(cdr, 'TwistStamped', 6)


def _decoded(cdr: bytes, kind: str, width: int) -> Stamped:
    reader = Reader(cdr, kind)
    stamp, frame_id = reader.stamp(), reader.text('frame_id')
    values = reader.floats(1, width, 'values')[0]
    reader.end()
    return Stamped(stamp, frame_id, values)
