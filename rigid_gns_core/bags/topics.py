# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which topics of a bag are the simulator's, be they remapped or in a namespace. No ROS needed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
import json
from typing import Any

from .reader import Bag, BagError, Topic
from ..messages.poses import decode_string, MessageError

POSE_ARRAY = 'geometry_msgs/msg/PoseArray'
_STRING = 'std_msgs/msg/String'
_FLOAT64 = 'std_msgs/msg/Float64'
_TRAJECTORY = 'trajectory_msgs/msg/MultiDOFJointTrajectory'


@dataclass(frozen=True)
class Topics:
    """Topics of one simulator.

    Args:
        tracked: Tracked poses.
        predicted: Predicted poses.
        step_time: Times of model steps; None where there are none.
        recorded: What the simulator said about itself on ~/scene; empty where there is nothing.
        start: Starts of forecasts; None where there are none.
        trajectory: Whole futures; None where there are none.
    """

    tracked: Topic
    predicted: Topic
    step_time: Topic | None
    recorded: dict[str, Any]
    start: Topic | None = None
    trajectory: Topic | None = None


def find_topics(bag: Bag, tracked: str | None = None, predicted: str | None = None) -> Topics:
    """Find the topics of a simulator.

    By the names given, else by those that the simulator recorded on ~/scene, else by the ends of
    their names, `tracked_poses` and `predicted_poses`.

    Args:
        bag: Bag.
        tracked: Topic of the tracked poses.
        predicted: Topic of the predicted poses.

    Raises:
        BagError: A topic is not there, is empty, or is one of several.
    """
    said = [names for names in map(said_names, recorded_scenes(bag).values()) if names]
    if predicted is not None:
        said = [names for names in said if names.get('predicted') == predicted]
    names = said[0] if len(said) == 1 else {}
    ours = find_poses(
        bag, 'predicted_poses', '--predicted', predicted, [names.get('predicted', '')]
    )
    if names.get('predicted') != ours.name:
        names = {}
    theirs = find_poses(bag, 'tracked_poses', '--tracked', tracked, [names.get('tracked', '')])
    said_or_beside = {
        suffix: _of_type(bag.topics.get(names.get(suffix, '')), type_name)
        or _beside(bag, ours, suffix, type_name)
        for suffix, type_name in (('step_time', _FLOAT64), ('start', _STRING))
    }
    return Topics(
        theirs,
        ours,
        said_or_beside['step_time'],
        _recorded(bag, ours),
        said_or_beside['start'],
        _of_type(bag.topics.get(names.get('trajectory', '')), _TRAJECTORY),
    )


def holds_predictions(bag: Bag, predicted: str | None = None) -> bool:
    """Whether there is a topic of predicted poses with messages, called `predicted` or found."""
    arrays = [t for t in bag.topics.values() if t.type_name == POSE_ARRAY and t.messages]
    said = {names.get('predicted') for names in map(said_names, recorded_scenes(bag).values())}
    return any(
        t.name == predicted or t.name in said or t.name.split('/')[-1] == 'predicted_poses'
        for t in arrays
    )


def _of_type(topic: Topic | None, type_name: str) -> Topic | None:
    return topic if topic and topic.messages and topic.type_name == type_name else None


def listing(bag: Bag) -> str:
    """Return the topics of a bag, for a message."""
    listed = [f'{t.name} ({t.type_name}, {len(t)} messages)' for t in bag.topics.values()]
    return ', '.join(sorted(listed)) or 'no topics'


def recorded_scenes(bag: Bag) -> dict[str, dict[str, Any]]:
    """Return what simulators said on their ~/scene, by topic; texts of others are left out."""
    scenes = {}
    for topic in scene_topics(bag):
        try:
            content = json.loads(decode_string(topic.messages[-1]))
        except (MessageError, json.JSONDecodeError):
            continue
        if isinstance(content, dict):
            scenes[topic.name] = content
    return scenes


def scene_topics(bag: Bag) -> list[Topic]:
    """Topics with messages that may be the ~/scene of a simulator, by type and name."""
    return [
        topic
        for topic in bag.topics.values()
        if topic.type_name == _STRING and topic.name.endswith('/scene') and topic.messages
    ]


def said_names(scene: dict[str, Any]) -> dict[str, str]:
    """Return resolved names of topics, by what they are for, that a simulator said on ~/scene."""
    names = scene.get('topics')
    if not isinstance(names, dict):
        return {}
    return {str(key): str(name) for key, name in names.items()}


def _recorded(bag: Bag, predicted: Topic) -> dict[str, Any]:
    scenes = recorded_scenes(bag)
    for content in scenes.values():
        if said_names(content).get('predicted') == predicted.name:
            return content
    topic = _beside(bag, predicted, 'scene', _STRING)
    return scenes.get(topic.name, {}) if topic else {}


def find_poses(
    bag: Bag, suffix: str, option: str, name: str | None = None, said: Iterable[str] = ()
) -> Topic:
    """Return the topic of poses `name`, else one of `said`, else that whose last part is `suffix`.

    Args:
        bag: Bag.
        suffix: As `tracked_poses`.
        option: With which a person chooses it.
        name: The one chosen.
        said: Names that nodes said.

    Raises:
        BagError: It is not there, is empty, or is one of several.
    """
    arrays = [topic for topic in bag.topics.values() if topic.type_name == POSE_ARRAY]
    if name is not None:
        found = [topic for topic in arrays if topic.name == name]
    else:
        found = [topic for topic in arrays if topic.name in set(said)] or [
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
        f'{bag.path}: {problem} of type {POSE_ARRAY}; choose one with {option}. '
        f'The bag holds {listing(bag)}' + (rollouts if option == '--predicted' else '')
    )


def _beside(bag: Bag, predicted: Topic, suffix: str, type_name: str) -> Topic | None:
    """Return a topic of the node that predicted; of several, that in the same namespace."""
    found = [
        topic
        for topic in bag.topics.values()
        if topic.name.endswith(f'/{suffix}') and topic.type_name == type_name and topic.messages
    ]
    namespace = predicted.name.rsplit('/', 1)[0]
    near = [topic for topic in found if topic.name.rsplit('/', 2)[0] == namespace]
    chosen = near if len(near) == 1 else found
    return chosen[0] if len(chosen) == 1 else None
