# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""tf2_msgs/TFMessage: transforms between coordinate frames, as on /tf and /tf_static."""

from __future__ import annotations

from dataclasses import dataclass

from .cdr import Reader
from ..scenes.state import Array


@dataclass(frozen=True)
class Transform:
    """One geometry_msgs/TransformStamped: the pose of the frame `child` in the frame `parent`.

    Args:
        stamp_ns: Time at which it holds [ns].
        parent: Coordinate frame of the pose.
        child: Coordinate frame that has it.
        pose: Position [m] and quaternion (x, y, z, w), shape (7,).
    """

    stamp_ns: int
    parent: str
    child: str
    pose: Array


def decode_transforms(cdr: bytes) -> list[Transform]:
    """Decode a tf2_msgs/TFMessage.

    Raises:
        MessageError: The bytes are cut short, too long, or no such message.
    """
    reader = Reader(cdr, 'TFMessage')
    found = []
    for _ in range(reader.number('I', 'number of transforms')):
        stamp, parent = reader.stamp(), reader.text('frame_id')
        child = reader.text('child_frame_id')
        found.append(Transform(stamp, parent, child, reader.floats(1, 7, 'transform')[0]))
    reader.end()
    return found
