# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""metadata.yaml of a bag, version 9, as rosbag2 of ROS 2 Jazzy writes it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from textwrap import indent
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


@cache
def qos_yaml(qos: Qos, depth: int | None) -> str:
    """`qos_profiles` as YAML, as the files of a bag have it."""
    return to_yaml(qos_profiles(qos, depth))


def information_yaml(files: Sequence[RecordedFile], topics: Sequence[RecordedTopic]) -> str:
    """Content of `rosbag2_bagfile_information` for a bag of MCAP files.

    It is made at each split of a recording, by a thread that shares an interpreter with others: in
    PyYAML alone 300 files took 0.06 s. So what stays is made once.
    """
    used = [file for file in files if file.count]
    first_ns = min((file.first_ns for file in used), default=0)
    last_ns = max((file.last_ns for file in used), default=0)
    counted = [
        f'{_topic_yaml(topic.name, topic.type_name, topic.qos, topic.depth)}'
        f'  message_count: {topic.count}\n'
        for topic in topics
    ]
    told = [_file_yaml(file.name, file.count, file.first_ns, file.last_ns) for file in files]
    return ''.join(
        (
            'version: 9\nstorage_identifier: mcap\n',
            f'duration:\n  nanoseconds: {last_ns - first_ns}\n',
            f'starting_time:\n  nanoseconds_since_epoch: {first_ns}\n',
            f'message_count: {sum(file.count for file in files)}\n',
            _list_yaml('topics_with_message_count', counted),
            "compression_format: ''\ncompression_mode: ''\n",
            _list_yaml('relative_file_paths', [_name_yaml(file.name) for file in files]),
            _list_yaml('files', told),
            'custom_data: null\nros_distro: jazzy\n',
        )
    )


def metadata_yaml(information: str) -> str:
    """Text of metadata.yaml with the YAML of `information_yaml`."""
    return 'rosbag2_bagfile_information:\n' + indent(information, '  ')


def _list_yaml(key: str, items: Sequence[str]) -> str:
    return f'{key}:\n{"".join(items)}' if items else f'{key}: []\n'


@cache
def _topic_yaml(name: str, type_name: str, qos: Qos, depth: int | None) -> str:
    return to_yaml(
        [
            {
                'topic_metadata': {
                    'name': name,
                    'type': type_name,
                    'serialization_format': 'cdr',
                    'offered_qos_profiles': qos_profiles(qos, depth),
                    'type_description_hash': type_hash(type_name),
                }
            }
        ]
    )


@cache
def _name_yaml(name: str) -> str:
    return to_yaml([name])


@lru_cache(maxsize=4096)
def _file_yaml(name: str, count: int, first_ns: int, last_ns: int) -> str:
    return to_yaml(
        [
            {
                'path': name,
                'starting_time': {'nanoseconds_since_epoch': first_ns},
                'duration': {'nanoseconds': last_ns - first_ns},
                'message_count': count,
            }
        ]
    )


def to_yaml(value: Any) -> str:
    """YAML in block style, with the keys in their order."""
    return yaml.safe_dump(value, sort_keys=False, default_flow_style=False)


def _infinite() -> dict[str, int]:
    return {'sec': 9223372036, 'nsec': 854775807}  # a new dict: YAML would write aliases of one
