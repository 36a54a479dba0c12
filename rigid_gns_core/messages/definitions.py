# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Message definitions of the types that a bag of ours holds.

A rosbag2 bag carries the full text of each type, so that it can be read where ROS is not
installed. They are kept here so that a bag can be written there too. Texts and type hashes are
those of ROS 2 Jazzy (common_interfaces, rcl_interfaces; Apache-2.0); a test compares them with the
installed share/<package>/msg/*.msg and *.json.
"""

from __future__ import annotations

from ..errors import UserError

_DEPRECATED = """\
# This was originally provided as an example message.
# It is deprecated as of Foxy
# It is recommended to create your own semantically meaningful message.
# However if you would like to continue using this please use the equivalent in example_msgs.

"""

# package/Type: text of the .msg file
TEXTS: dict[str, str] = {
    'geometry_msgs/PoseArray': """\
# An array of poses with a header for global reference.

std_msgs/Header header

Pose[] poses
""",
    'geometry_msgs/Pose': """\
# A representation of pose in free space, composed of position and orientation.

Point position
Quaternion orientation
""",
    'geometry_msgs/Point': """\
# This contains the position of a point in free space
float64 x
float64 y
float64 z
""",
    'geometry_msgs/Quaternion': """\
# This represents an orientation in free space in quaternion form.

float64 x 0
float64 y 0
float64 z 0
float64 w 1
""",
    'std_msgs/Header': """\
# Standard metadata for higher-level stamped data types.
# This is generally used to communicate timestamped data
# in a particular coordinate frame.

# Two-integer timestamp that is expressed as seconds and nanoseconds.
builtin_interfaces/Time stamp

# Transform frame with which this data is associated.
string frame_id
""",
    'builtin_interfaces/Time': """\
# This message communicates ROS Time defined here:
# https://design.ros2.org/articles/clock_and_time.html

# The seconds component, valid over all int32 values.
int32 sec

# The nanoseconds component, valid in the range [0, 1e9), to be added to \
the seconds component.\x20
# e.g.
# The time -1.7 seconds is represented as {sec: -2, nanosec: 3e8}
# The time 1.7 seconds is represented as {sec: 1, nanosec: 7e8}
uint32 nanosec
""",
    'geometry_msgs/Transform': """\
# This represents the transform between two coordinate frames in free space.

Vector3 translation
Quaternion rotation
""",
    'geometry_msgs/Twist': """\
# This expresses velocity in free space broken into its linear and angular parts.

Vector3  linear
Vector3  angular
""",
    'geometry_msgs/Vector3': """\
# This represents a vector in free space.

# This is semantically different than a point.
# A vector is always anchored at the origin.
# When a transform is applied to a vector, only the rotational component is applied.

float64 x
float64 y
float64 z
""",
    'builtin_interfaces/Duration': """\
# Duration defines a period between two time points.
# Messages of this datatype are of ROS Time following this design:
# https://design.ros2.org/articles/clock_and_time.html

# The seconds component, valid over all int32 values.
int32 sec

# The nanoseconds component, valid in the range [0, 1e9), to be added to the seconds component.\x20
# e.g.
# The duration -1.7 seconds is represented as {sec: -2, nanosec: 3e8}
# The duration 1.7 seconds is represented as {sec: 1, nanosec: 7e8}
uint32 nanosec
""",
    'trajectory_msgs/MultiDOFJointTrajectory': """\
# The header is used to specify the coordinate frame and the reference time for the trajectory \
durations
std_msgs/Header header

# A representation of a multi-dof joint trajectory (each point is a transformation)
# Each point along the trajectory will include an array of positions/velocities/accelerations
# that has the same length as the array of joint names, and has the same order of joints as\x20
# the joint names array.

string[] joint_names
MultiDOFJointTrajectoryPoint[] points
""",
    'trajectory_msgs/MultiDOFJointTrajectoryPoint': """\
# Each multi-dof joint can specify a transform (up to 6 DOF).
geometry_msgs/Transform[] transforms

# There can be a velocity specified for the origin of the joint.
geometry_msgs/Twist[] velocities

# There can be an acceleration specified for the origin of the joint.
geometry_msgs/Twist[] accelerations

# Desired time from the trajectory start to arrive at this trajectory point.
builtin_interfaces/Duration time_from_start
""",
    'diagnostic_msgs/DiagnosticArray': """\
# This message is used to send diagnostic information about the state of the robot.
std_msgs/Header header # for timestamp
DiagnosticStatus[] status # an array of components being reported on
""",
    'diagnostic_msgs/DiagnosticStatus': """\
# This message holds the status of an individual component of the robot.

# Possible levels of operations.
byte OK=0
byte WARN=1
byte ERROR=2
byte STALE=3

# Level of operation enumerated above.
byte level
# A description of the test/component reporting.
string name
# A description of the status.
string message
# A hardware unique string.
string hardware_id
# An array of values associated with the status.
KeyValue[] values

""",
    'diagnostic_msgs/KeyValue': """\
# What to label this value when viewing.
string key
# A value to track over time.
string value
""",
    'std_msgs/String': _DEPRECATED + 'string data\n',
    'std_msgs/Float64': _DEPRECATED + 'float64 data\n',
}

# full type name: (type hash of REP-2016, types it consists of, in rosbag2's order)
TYPES: dict[str, tuple[str, tuple[str, ...]]] = {
    'geometry_msgs/msg/PoseArray': (
        'RIHS01_af0cc36d190e104d546d168d6b39df04fa4b4ccecf59cb4c9ed328d3d5004aa0',
        (
            'geometry_msgs/Pose',
            'geometry_msgs/Point',
            'geometry_msgs/Quaternion',
            'std_msgs/Header',
            'builtin_interfaces/Time',
        ),
    ),
    'trajectory_msgs/msg/MultiDOFJointTrajectory': (
        'RIHS01_3a18fd095292a65cfde8833c72985a30af981f3ec44494655c6267262b443a4a',
        (
            'std_msgs/Header',
            'builtin_interfaces/Time',
            'trajectory_msgs/MultiDOFJointTrajectoryPoint',
            'builtin_interfaces/Duration',
            'geometry_msgs/Transform',
            'geometry_msgs/Quaternion',
            'geometry_msgs/Vector3',
            'geometry_msgs/Twist',
        ),
    ),
    'diagnostic_msgs/msg/DiagnosticArray': (
        'RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e',
        (
            'diagnostic_msgs/DiagnosticStatus',
            'diagnostic_msgs/KeyValue',
            'std_msgs/Header',
            'builtin_interfaces/Time',
        ),
    ),
    'std_msgs/msg/String': (
        'RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18',
        (),
    ),
    'std_msgs/msg/Float64': (
        'RIHS01_705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a',
        (),
    ),
}


def type_hash(type_name: str) -> str:
    """RIHS01 hash of a type, such as `std_msgs/msg/String`."""
    return _known(type_name)[0]


def full_text(type_name: str) -> str:
    """Text of a type followed by the texts of all that it consists of, as rosbag2 stores it."""
    parts = [TEXTS[type_name.replace('/msg/', '/')]]
    parts += [f'{"=" * 80}\nMSG: {name}\n{TEXTS[name]}' for name in _known(type_name)[1]]
    return '\n'.join(parts)


def _known(type_name: str) -> tuple[str, tuple[str, ...]]:
    try:
        return TYPES[type_name]
    except KeyError:
        raise UserError(
            f'message type {type_name!r} cannot be recorded; known: {", ".join(TYPES)}'
        ) from None
