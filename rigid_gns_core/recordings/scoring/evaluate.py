# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scores of a bag: of its predictions, or of rollouts of a model from its tracked poses."""

from __future__ import annotations

from pathlib import Path

from .bag_score import BagScore
from .predictions import score_predictions
from ..recorded_simulators import RecordedSimulators
from ...bags.reader import Bag
from ...bags.topics import find_poses, find_topics, holds_predictions
from ...forecasts.node_parameters import with_defaults
from ...scenes.scene import Scene
from ...scenes.scene_file import load_scene


def score_bag(
    bag: Bag,
    *,
    scene: str | Path | None = None,
    tracked: str | None = None,
    predicted: str | None = None,
    model: str | None = None,
    starts: int = 20,
    match: bool = False,
    frame: str | None = None,
) -> BagScore:
    """Score a bag: the predictions in it, or rollouts of a model from its tracked poses.

    Args:
        bag: The bag.
        scene: Shipped name or YAML file of the scene. None: the one that the simulator recorded.
        tracked: Topic of the tracked poses. None: that of the simulator, see `find_topics`.
        predicted: Topic of the predicted poses. None: that of the simulator.
        model: Name or path of a model to roll out instead of scoring predictions. None: the
            shipped default, where the bag holds no predictions.
        starts: Number of these rollouts, evenly over the recording.
        match: Whether the rollouts associate poses with tracks, as they come in any order or are
            missing; always where the simulator that recorded them did so.
        frame: Coordinate frame of the scene for rollouts, see `in_scene_frame`.

    Raises:
        UserError: The bag lacks a topic or a scene, or nothing overlaps.
    """
    given = None if scene is None else load_scene(scene)
    with bag.naming_damage():
        return _score(bag, given, tracked, predicted, model, starts, frame, match=match)


def _score(
    bag: Bag,
    given: Scene | None,
    tracked: str | None,
    predicted: str | None,
    model: str | None,
    starts: int,
    frame: str | None,
    *,
    match: bool,
) -> BagScore:
    simulators = RecordedSimulators.of(bag)
    if model is None and (predicted is not None or _predicts(bag, tracked, given)):
        topics = find_topics(bag, tracked, predicted)
        return score_predictions(bag, topics, given or simulators.scene_by(topics))
    # imported late: scoring predictions needs no model
    from .rollouts import RolloutOptions, score_rollouts

    topic = find_poses(bag, 'tracked_poses', '--topic', tracked, simulators.tracked)
    parameters = with_defaults(simulators.parameters(topic.name))
    options = RolloutOptions(
        model or '',
        starts,
        parameters['velocity_window'],
        match or parameters['match_spheres'],
        frame,
    )
    return score_rollouts(bag, topic, given or simulators.scene(topic.name), options)


def _predicts(bag: Bag, tracked: str | None, scene: Scene | None) -> bool:
    """Whether to score predictions: there are some, or no option names tracked poses."""
    return holds_predictions(bag) or (tracked is None and scene is None)
