# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Scores of a recorded bag: of the predictions in it, or of rollouts of a model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .predictions import score_predictions
from .scored import Scored
from ..tracked_frames import find_tracked
from ...bags.reader import Bag, BagError, read_bag
from ...bags.topics import find_topics, holds_predictions, listing, recorded_scenes, said_names
from ...forecasts.parameters import SIMULATOR
from ...scenes.sampling import load_scene
from ...scenes.scene import Scene


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
        ValueError: The bag lacks a topic or a scene, or nothing overlaps.
    """
    if model is None and (predicted is not None or _predicts(bag, tracked, scene)):
        topics = find_topics(bag, tracked, predicted)
        return score_predictions(bag, topics, _scene(bag, topics.recorded, scene))
    # late: a model need not be there to score predictions
    from .rollouts import RolloutOptions, score_rollouts

    scenes = [one for one in recorded_scenes(bag).values() if 'scene' in one]
    topic = find_tracked(bag, tracked, [said_names(one).get('tracked', '') for one in scenes])
    own = [one for one in scenes if said_names(one).get('tracked') == topic.name] or scenes
    recorded = own[0] if own else {}
    match = match or bool(recorded.get('parameters', {}).get('match_spheres', False))
    options = RolloutOptions(model or '', starts, _window(recorded), match)
    return score_rollouts(bag, topic, _scene(bag, recorded, scene), options)


def evaluate_bag(
    folder: str | Path, *, figure: str | Path | None = None, **options: Any
) -> dict[str, Any]:
    """Return the report of a bag, see `Scored`.

    Args:
        folder: Bag folder, or an .mcap file.
        figure: PNG to draw. None: none.
        options: As of `score_bag`.

    Raises:
        ValueError: The bag cannot be read, lacks a topic or a scene, or nothing overlaps.
    """
    scored = score_bag(read_bag(folder), **options)
    if figure is not None:
        from ...scoring.figure import write_figure

        write_figure(
            figure,
            scored.predicted,
            scored.tracked,
            scored.scene,
            title=scored.title,
            names=('predicted', 'tracked'),
        )
    return scored.report


def _predicts(bag: Bag, tracked: str | None, scene: str | Path | None) -> bool:
    """Whether predictions are to be scored; also where only they are missing from our own bag."""
    return holds_predictions(bag) or (tracked is None and scene is None)


def _window(recorded: dict[str, Any]) -> int:
    """Tracked frames of a start, as the simulator had it, or has it by default."""
    default = next(spec.default for spec in SIMULATOR if spec.name == 'velocity_window')
    return int(recorded.get('parameters', {}).get('velocity_window', default))


def _scene(bag: Bag, recorded: dict[str, Any], scene: str | Path | None) -> Scene:
    if scene is not None:
        return load_scene(scene)[0]
    if 'scene' not in recorded:
        raise BagError(
            f'{bag.path}: no .../scene topic says what the scene is; name it with --scene. '
            f'The bag holds {listing(bag)}'
        )
    return Scene.from_mapping(recorded['scene'], 'scene of the bag')
