"""What rosbag2 of ROS 2 Jazzy says about a bag: metadata.yaml, version 9."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import yaml

from .definitions import type_hash

Qos = Literal['reliable', 'sensor_data', 'latched']
# kind: (depth, reliability, durability)
_QOS: dict[str, tuple[int, str, str]] = {
    'reliable': (10, 'reliable', 'volatile'),
    'sensor_data': (5, 'best_effort', 'volatile'),
    'latched': (1, 'reliable', 'transient_local'),
}


@dataclass
class RecordedTopic:
    """A topic of a bag and the number of its messages."""

    name: str
    type_name: str
    qos: Qos
    count: int = 0


def qos_profiles(qos: Qos) -> list[dict[str, Any]]:
    """The `offered_qos_profiles` of one publisher."""
    if qos not in _QOS:
        raise ValueError(f'qos is {qos!r}, allowed: {", ".join(_QOS)}')
    depth, reliability, durability = _QOS[qos]
    return [
        {
            'history': 'keep_last',
            'depth': depth,
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
    file: str, topics: Sequence[RecordedTopic], first_ns: int, last_ns: int
) -> dict[str, Any]:
    """The content of `rosbag2_bagfile_information` for a bag of one MCAP file.

    Args:
        file: Name of the file within the folder.
        topics: Topics with their numbers of messages.
        first_ns: First log time [ns]; 0 in an empty bag.
        last_ns: Last log time [ns].
    """
    count = sum(topic.count for topic in topics)

    return {
        'version': 9,
        'storage_identifier': 'mcap',
        'duration': {'nanoseconds': last_ns - first_ns},
        'starting_time': {'nanoseconds_since_epoch': first_ns},
        'message_count': count,
        'topics_with_message_count': [
            {
                'topic_metadata': {
                    'name': topic.name,
                    'type': topic.type_name,
                    'serialization_format': 'cdr',
                    'offered_qos_profiles': qos_profiles(topic.qos),
                    'type_description_hash': type_hash(topic.type_name),
                },
                'message_count': topic.count,
            }
            for topic in topics
        ],
        'compression_format': '',
        'compression_mode': '',
        'relative_file_paths': [file],
        'files': [
            {
                'path': file,
                'starting_time': {'nanoseconds_since_epoch': first_ns},
                'duration': {'nanoseconds': last_ns - first_ns},
                'message_count': count,
            }
        ],
        'custom_data': None,
        'ros_distro': 'jazzy',
    }


def to_yaml(value: Any) -> str:
    """Block-style YAML, keys in their order."""
    return yaml.safe_dump(value, sort_keys=False, default_flow_style=False)


def _infinite() -> dict[str, int]:
    return {'sec': 9223372036, 'nsec': 854775807}  # a new one each: YAML writes aliases of one
