# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Message types of trackers, and the PoseArray (CDR bytes) that each amounts to."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from .object_arrays import OBJECT_ARRAYS, pose_array_of_objects
from .other_trackers import pose_array_of_cloud, pose_array_of_point, pose_array_of_pose

POSE_ARRAY = 'geometry_msgs/msg/PoseArray'

AS_POSE_ARRAY: dict[str, Callable[[bytes], bytes]] = {
    POSE_ARRAY: lambda cdr: cdr,
    'sensor_msgs/msg/PointCloud2': pose_array_of_cloud,
    'geometry_msgs/msg/PoseStamped': pose_array_of_pose,
    'geometry_msgs/msg/PointStamped': pose_array_of_point,
    **{
        kind.replace('/', '/msg/'): partial(pose_array_of_objects, kind=kind)
        for kind in OBJECT_ARRAYS
    },
}
