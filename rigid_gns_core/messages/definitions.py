# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Message definitions of the types that a bag of ours holds.

A rosbag2 bag carries the full text of each type, so that it can be read where ROS is not
installed. They are kept in `schemas/` so that a bag can be written there too. Texts and type
hashes are those of ROS 2 Jazzy (common_interfaces, rcl_interfaces; Apache-2.0); a test compares
them with the installed share/<package>/msg/*.msg and *.json.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from ..errors import UserError

SCHEMAS = Path(__file__).with_name('schemas')

# full type name: type hash of REP-2016
HASHES = {
    'geometry_msgs/msg/PoseArray': (
        'RIHS01_af0cc36d190e104d546d168d6b39df04fa4b4ccecf59cb4c9ed328d3d5004aa0'
    ),
    'geometry_msgs/msg/PoseStamped': (
        'RIHS01_10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8'
    ),
    'geometry_msgs/msg/TwistStamped': (
        'RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64'
    ),
    'trajectory_msgs/msg/MultiDOFJointTrajectory': (
        'RIHS01_3a18fd095292a65cfde8833c72985a30af981f3ec44494655c6267262b443a4a'
    ),
    'diagnostic_msgs/msg/DiagnosticArray': (
        'RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e'
    ),
    'std_msgs/msg/String': (
        'RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18'
    ),
    'std_msgs/msg/Float64': (
        'RIHS01_705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a'
    ),
}


def type_hash(type_name: str) -> str:
    """RIHS01 hash of a type, such as `std_msgs/msg/String`."""
    try:
        return HASHES[type_name]
    except KeyError:
        raise UserError(
            f'message type {type_name!r} cannot be recorded; known: {", ".join(HASHES)}'
        ) from None


@cache
def full_text(type_name: str) -> str:
    """Text of a type followed by the texts of all that it consists of, as rosbag2 stores it."""
    return (SCHEMAS / f'{type_name.replace("/msg/", ".")}.msg').read_bytes().decode()
