# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""geometry_msgs/PoseWithCovarianceStamped and TwistWithCovarianceStamped as CDR bytes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .cdr import Writer
from ..scenes.state import Array

# variance of an angle of which nothing is known, uniform over a turn [rad^2]
UNKNOWN_ANGLE = float(np.pi**2 / 3)


def encode_pose_with_covariance(
    stamp_ns: int, frame_id: str, position: ArrayLike, covariance: ArrayLike
) -> bytes:
    """CDR bytes of the pose of a sphere whose rotation is not known.

    Args:
        stamp_ns: Stamp [ns].
        frame_id: Coordinate frame.
        position: Centre [m], shape (3,).
        covariance: Of the position [m^2], shape (3, 3).
    """
    writer = Writer()
    writer.header(stamp_ns, frame_id)
    writer.align(8)
    writer.floats(np.concatenate([np.asarray(position, np.float64), [0.0, 0.0, 0.0, 1.0]]))
    writer.floats(_six_by_six(covariance, UNKNOWN_ANGLE))
    return writer.cdr


def encode_twist_with_covariance(
    stamp_ns: int, frame_id: str, velocity: ArrayLike, covariance: ArrayLike
) -> bytes:
    """CDR bytes of the velocity of a sphere whose spin is left out, with a variance of -1.

    Args:
        stamp_ns: Stamp [ns].
        frame_id: Coordinate frame.
        velocity: [m/s], shape (3,).
        covariance: Of the velocity [m^2/s^2], shape (3, 3).
    """
    writer = Writer()
    writer.header(stamp_ns, frame_id)
    writer.align(8)
    writer.floats(np.concatenate([np.asarray(velocity, np.float64), np.zeros(3)]))
    writer.floats(_six_by_six(covariance, -1.0))
    return writer.cdr


def _six_by_six(covariance: ArrayLike, of_rotation: float) -> Array:
    found = np.zeros((6, 6))
    found[:3, :3] = covariance
    found[3:, 3:] = of_rotation * np.eye(3)
    return found.ravel()
