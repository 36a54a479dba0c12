# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""metadata.yaml of a bag, version 9, as rosbag2 of ROS 2 Jazzy writes it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import yaml

from ..errors import UserError
from ..messages.definitions import type_hash

Qos = Literal['reliable', 'sensor_data', 'latched']
# profile: (depth, reliability, durability)
_QOS: dict[str, tuple[int, str, str]] = {
    'reliable': (10, 'reliable', 'volatile'),
    'sensor_data': (5, 'best_effort', 'volatile'),
    'latched': (1, 'reliable', 'transient_local'),
}


@dataclass
class RecordedTopic:
    """A topic of a bag.

    Args:
        name: Resolved name.
        type_name: Type, such as `std_msgs/msg/String`.
        qos: QoS profile of its publisher.
        depth: Depth of its history; None: that of the profile.
        count: Number of messages in the files, with latched messages counted once per split.
        sequence: Sequence number of the next message, without these repetitions.
    """

    name: str
    type_name: str
    qos: Qos
    depth: int | None = None
    count: int = 0
    sequence: int = 0


@dataclass
class RecordedFile:
    """One file of a bag: name in the folder, number of messages, first and last log time [ns]."""

    name: str
    count: int = 0
    first_ns: int = 0  # 0 in an empty file
    last_ns: int = 0

    def take(self, log_time_ns: int) -> None:
        """Count a message with this log time."""
        if not self.count:
            self.first_ns = self.last_ns = log_time_ns
        self.first_ns = min(self.first_ns, log_time_ns)
        self.last_ns = max(self.last_ns, log_time_ns)
        self.count += 1


def qos_profiles(qos: Qos, depth: int | None = None) -> list[dict[str, Any]]:
    """`offered_qos_profiles` of one publisher, of the profile's depth where none is given.

    Raises:
        UserError: The profile is unknown.
    """
    if qos not in _QOS:
        raise UserError(f'qos is {qos!r}, allowed: {", ".join(_QOS)}')
    usual, reliability, durability = _QOS[qos]
    return [
        {
            'history': 'keep_last',
            'depth': usual if depth is None else depth,
            'reliability': reliability,
            'durability': durability,
            'deadline': _infinite(),
            'lifespan': _infinite(),
            'liveliness': 'automatic',
            'liveliness_lease_duration': _infinite(),
            'avoid_ros_namespace_conventions': False,
        }
    ]


def bag_information(
    files: Sequence[RecordedFile], topics: Sequence[RecordedTopic]
) -> dict[str, Any]:
    """Content of `rosbag2_bagfile_information` for a bag of MCAP files."""
    used = [file for file in files if file.count]
    first_ns = min((file.first_ns for file in used), default=0)
    last_ns = max((file.last_ns for file in used), default=0)
    return {
        'version': 9,
        'storage_identifier': 'mcap',
        'duration': {'nanoseconds': last_ns - first_ns},
        'starting_time': {'nanoseconds_since_epoch': first_ns},
        'message_count': sum(file.count for file in files),
        'topics_with_message_count': [
            {
                'topic_metadata': {
                    'name': topic.name,
                    'type': topic.type_name,
                    'serialization_format': 'cdr',
                    'offered_qos_profiles': qos_profiles(topic.qos, topic.depth),
                    'type_description_hash': type_hash(topic.type_name),
                },
                'message_count': topic.count,
            }
            for topic in topics
        ],
        'compression_format': '',
        'compression_mode': '',
        'relative_file_paths': [file.name for file in files],
        'files': [
            {
                'path': file.name,
                'starting_time': {'nanoseconds_since_epoch': file.first_ns},
                'duration': {'nanoseconds': file.last_ns - file.first_ns},
                'message_count': file.count,
            }
            for file in files
        ],
        'custom_data': None,
        'ros_distro': 'jazzy',
    }


def to_yaml(value: Any) -> str:
    """YAML in block style, with the keys in their order."""
    return yaml.safe_dump(value, sort_keys=False, default_flow_style=False)


def _infinite() -> dict[str, int]:
    return {'sec': 9223372036, 'nsec': 854775807}  # a new dict: YAML would write aliases of one
