# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Finds the topics of a simulator in a bag, remapped or in a namespace."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from .reader import Bag, BagError, Topic
from ..errors import UserError
from ..files.strict_json import parse_json
from ..messages.poses import decode_string
from ..messages.tracker_types import AS_POSE_ARRAY, POSE_ARRAY

_STRING = 'std_msgs/msg/String'
_FLOAT64 = 'std_msgs/msg/Float64'
# topics in an error message, poses first, and characters of a name
_LISTED, _LONGEST = 20, 200
# what a simulator says on ~/scene, where it is not damaged
_SAID: dict[str, Any] = {'parameters': dict, 'model_card': dict, 'topics': dict, 'dt': float}
_TRAJECTORY = 'trajectory_msgs/msg/MultiDOFJointTrajectory'


@dataclass(frozen=True)
class Topics:
    """Recorded topics of one simulator.

    Args:
        tracked: Tracked poses.
        predicted: Predicted poses.
        step_time: Wall-clock times of model steps; None: not recorded.
        recorded: Content of ~/scene: scene, model, parameters, topics; empty: not recorded.
        start: Starts of forecasts; None: not recorded.
        trajectory: Predicted trajectories; None: not recorded.
        deviations: Deviations of these; None: not recorded.
        learned: Scenes that took the place of the first; None: there are none.
    """

    tracked: Topic
    predicted: Topic
    step_time: Topic | None
    recorded: dict[str, Any]
    start: Topic | None = None
    trajectory: Topic | None = None
    deviations: Topic | None = None
    learned: Topic | None = None


def find_topics(bag: Bag, tracked: str | None = None, predicted: str | None = None) -> Topics:
    """Find the topics of a simulator.

    By the given names, else by those that the simulator recorded on ~/scene, else by the last part
    of their names, `tracked_poses` and `predicted_poses`.

    Args:
        bag: The bag.
        tracked: Topic of the tracked poses; None: find it.
        predicted: Topic of the predicted poses; None: find it.

    Raises:
        BagError: A topic is missing, empty or ambiguous.
    """
    recorded_names = [names for names in map(topic_names, recorded_scenes(bag).values()) if names]
    if predicted is not None:
        recorded_names = [names for names in recorded_names if names.get('predicted') == predicted]
    names = recorded_names[0] if len(recorded_names) == 1 else {}
    predicted_topic = find_poses(
        bag, 'predicted_poses', '--predicted', predicted, [names.get('predicted', '')]
    )
    if names.get('predicted') != predicted_topic.name:
        names = {}
    tracked_topic = find_poses(
        bag, 'tracked_poses', '--tracked', tracked, [names.get('tracked', '')]
    )
    own_topics = {
        suffix: _of_type(bag.topics.get(names.get(suffix, '')), type_name)
        or _beside(bag, predicted_topic, suffix, type_name)
        for suffix, type_name in (
            ('step_time', _FLOAT64),
            ('start', _STRING),
            ('learned', _STRING),
        )
    }
    return Topics(
        tracked_topic,
        predicted_topic,
        own_topics['step_time'],
        _recorded(bag, predicted_topic),
        own_topics['start'],
        _of_type(bag.topics.get(names.get('trajectory', '')), _TRAJECTORY),
        _of_type(bag.topics.get(names.get('deviations', '')), _TRAJECTORY),
        own_topics['learned'],
    )


def holds_predictions(bag: Bag, predicted: str | None = None) -> bool:
    """Whether a bag holds predicted poses, on the topic `predicted` or one that can be found."""
    arrays = [t for t in bag.topics.values() if t.type_name == POSE_ARRAY and t.messages]
    recorded_names = {
        names.get('predicted') for names in map(topic_names, recorded_scenes(bag).values())
    }
    return any(
        t.name == predicted
        or t.name in recorded_names
        or t.name.split('/')[-1] == 'predicted_poses'
        for t in arrays
    )


def _of_type(topic: Topic | None, type_name: str) -> Topic | None:
    return topic if topic and topic.messages and topic.type_name == type_name else None


def list_topics(bag: Bag) -> str:
    """The topics of a bag with types and numbers of messages, for an error message."""
    topics = sorted(bag.topics.values(), key=lambda t: (t.type_name != POSE_ARRAY, t.name))
    listed = [
        f'{t.name[:_LONGEST]} ({t.type_name[:_LONGEST]}, {len(t)} messages)'
        for t in topics[:_LISTED]
    ]
    more = f' and {len(topics) - _LISTED} more' if len(topics) > _LISTED else ''
    return ', '.join(listed) + more or 'no topics'


def recorded_scenes(bag: Bag) -> dict[str, dict[str, Any]]:
    """Content of the ~/scene of each simulator, by topic; what is damaged is left out."""
    scenes = {}
    for topic in scene_topics(bag):
        try:
            content = parse_json(decode_string(topic.messages[-1]))
        except UserError:
            continue
        if isinstance(content, dict):
            scenes[topic.name] = {
                key: value
                for key, value in content.items()
                if isinstance(value, _SAID.get(key, object))
            }
    return scenes


def scene_topics(bag: Bag) -> list[Topic]:
    """Topics that may be the ~/scene of a simulator, by type and name, with messages."""
    return [
        topic
        for topic in bag.topics.values()
        if topic.type_name == _STRING and topic.name.endswith('/scene') and topic.messages
    ]


def topic_names(scene: dict[str, Any]) -> dict[str, str]:
    """Resolved topic names that a simulator published on ~/scene, by role (`tracked`, ...)."""
    names = scene.get('topics')
    if not isinstance(names, dict):
        return {}
    return {str(key): str(name) for key, name in names.items()}


def _recorded(bag: Bag, predicted: Topic) -> dict[str, Any]:
    scenes = recorded_scenes(bag)
    for content in scenes.values():
        if topic_names(content).get('predicted') == predicted.name:
            return content
    topic = _beside(bag, predicted, 'scene', _STRING)
    return scenes.get(topic.name, {}) if topic else {}


def find_poses(
    bag: Bag, suffix: str, option: str, name: str | None = None, recorded_names: Iterable[str] = ()
) -> Topic:
    """Topic of poses by `name`, else one of `recorded_names`, else by the last part of its name.

    Args:
        bag: The bag.
        suffix: Last part of its name, such as `tracked_poses`.
        option: Command line option that chooses it, for errors.
        name: Name that the user chose; tracked poses may then have any type of `AS_POSE_ARRAY`.
        recorded_names: Names that simulators recorded.

    Raises:
        BagError: It is missing, empty or ambiguous.
    """
    kinds = AS_POSE_ARRAY if name and suffix == 'tracked_poses' else (POSE_ARRAY,)
    arrays = [topic for topic in bag.topics.values() if topic.type_name in kinds]
    if name is not None:
        found = [topic for topic in arrays if topic.name == name]
    else:
        found = [topic for topic in arrays if topic.name in set(recorded_names)] or [
            topic for topic in arrays if topic.name.split('/')[-1] == suffix
        ]
    found = [topic for topic in found if topic.messages] or found
    if len(found) == 1 and found[0].messages:
        return found[0]
    wanted = name or f'.../{suffix}'
    problem = f'{len(found)} topics {wanted}' if len(found) > 1 else f'no topic {wanted}'
    problem = f'{found[0].name} holds no messages' if len(found) == 1 else problem
    rollouts = '; a bag without predictions is scored with --topic and --scene, or with --model'
    raise BagError(
        f'{bag.path}: {problem} of type {", ".join(kinds)}; choose one with {option}. '
        f'The bag holds {list_topics(bag)}' + (rollouts if option == '--predicted' else '')
    )


def _beside(bag: Bag, predicted: Topic, suffix: str, type_name: str) -> Topic | None:
    """Topic of the node that predicted; of several, the one in its namespace."""
    found = [
        topic
        for topic in bag.topics.values()
        if topic.name.endswith(f'/{suffix}') and topic.type_name == type_name and topic.messages
    ]
    namespace = predicted.name.rsplit('/', 1)[0]
    near = [topic for topic in found if topic.name.rsplit('/', 2)[0] == namespace]
    chosen = near if len(near) == 1 else found
    return chosen[0] if len(chosen) == 1 else None
