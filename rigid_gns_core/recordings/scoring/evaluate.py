# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scores of a recorded bag: of the predictions in it, or of rollouts of a model."""

from __future__ import annotations

from pathlib import Path

from .predictions import score_predictions
from .scored import Scored
from ..recorded_scenes import SaidScenes
from ...bags.reader import Bag
from ...bags.topics import find_poses, find_topics, holds_predictions
from ...forecasts.parameters import SIMULATOR
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
) -> Scored:
    """Score a bag: the predictions in it, or rollouts of a model from its tracked poses.

    Args:
        bag: The bag.
        scene: Shipped name or YAML file of the scene. None: the one that the simulator recorded.
        tracked: Topic of the tracked poses. None: that of the simulator, see `find_topics`.
        predicted: Topic of the predicted poses. None: the same.
        model: Name or path of a model to roll out instead of reading predictions. None: only where
            there are none, and then the shipped default.
        starts: Number of these rollouts, evenly over the recording.
        match: Whether these match poses to spheres, which come in any order or are missing; also
            where the simulator that recorded them did.

    Raises:
        UserError: The bag lacks a topic or a scene, or nothing overlaps.
    """
    said = SaidScenes.of(bag)
    given = None if scene is None else load_scene(scene)
    if model is None and (predicted is not None or _predicts(bag, tracked, scene)):
        topics = find_topics(bag, tracked, predicted)
        return score_predictions(bag, topics, given or said.scene_by(topics))
    # late: a model need not be there to score predictions
    from .rollouts import RolloutOptions, score_rollouts

    topic = find_poses(bag, 'tracked_poses', '--topic', tracked, said.tracked)
    parameters = said.parameters(topic.name)
    default = next(spec.default for spec in SIMULATOR if spec.name == 'velocity_window')
    options = RolloutOptions(
        model or '',
        starts,
        int(parameters.get('velocity_window', default)),
        match or bool(parameters.get('match_spheres', False)),
    )
    return score_rollouts(bag, topic, given or said.scene(topic.name), options)


def _predicts(bag: Bag, tracked: str | None, scene: str | Path | None) -> bool:
    """Whether predictions are to be scored; also where only they are missing from our own bag."""
    return holds_predictions(bag) or (tracked is None and scene is None)
