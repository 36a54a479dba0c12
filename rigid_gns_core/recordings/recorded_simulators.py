# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scene, model and parameters that simulators recorded in a bag, on ~/scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..bags.reader import Bag, BagError
from ..bags.topics import list_topics, recorded_scenes, scene_topics, topic_names, Topics
from ..files.checkpoint import CheckpointError
from ..prediction.load import load_simulator
from ..scenes.scene import Scene


@dataclass(frozen=True)
class RecordedSimulators:
    """Simulators that recorded their ~/scene.

    Args:
        bag: The bag.
        simulators: Content of the ~/scene of each.
        unusable: Names of topics .../scene without a scene: they are of other nodes.
    """

    bag: Bag
    simulators: list[dict[str, Any]]
    unusable: list[str]

    @classmethod
    def of(cls, bag: Bag) -> RecordedSimulators:
        """Read the topics .../scene of a bag."""
        texts = {topic.name for topic in scene_topics(bag)}
        usable = {
            name: content
            for name, content in recorded_scenes(bag).items()
            if isinstance(content.get('scene'), dict)
        }
        return cls(bag, list(usable.values()), sorted(texts - set(usable)))

    @property
    def tracked(self) -> list[str]:
        """Topic of tracked poses of each simulator; empty: not recorded."""
        return [topic_names(simulator).get('tracked', '') for simulator in self.simulators]

    def scene(self, topic: str) -> Scene:
        """Scene of the simulator of a topic of tracked poses.

        Raises:
            BagError: No scene is recorded, or several that differ.
        """
        own = self._of(topic)
        if not own or any(content['scene'] != own[0]['scene'] for content in own):
            problem = f'{len(own)} simulators differ in'
            if not own:
                problem = 'no .../scene topic says'
                if self.unusable:
                    problem = f'{", ".join(self.unusable)} holds no scene of a simulator that says'
            raise BagError(
                f'{self.bag.path}: {problem} what the scene is; name it with --scene. '
                f'The bag holds {list_topics(self.bag)}'
            )
        return Scene.from_mapping(own[0]['scene'], 'scene of the bag')

    def scene_by(self, topics: Topics) -> Scene:
        """Scene of the simulator that predicted, else that of its tracked poses."""
        if 'scene' in topics.recorded:
            return Scene.from_mapping(topics.recorded['scene'], 'scene of the bag')
        return self.scene(topics.tracked.name)

    def parameters(self, topic: str) -> Mapping[str, Any]:
        """Parameters of a simulator that tracked a topic, preferably of one that matched poses.

        Empty where none are recorded.
        """
        recorded = [content.get('parameters') for content in self._of(topic)]
        known = [parameters for parameters in recorded if isinstance(parameters, dict)]
        matched = [parameters for parameters in known if parameters.get('match_spheres')]
        return next(iter(matched + known), {})

    def _of(self, topic: str) -> list[dict[str, Any]]:
        """Simulators that tracked the topic; all of them, where none recorded it."""
        named = zip(self.tracked, self.simulators, strict=True)
        return [content for name, content in named if name == topic] or self.simulators


def find_recorded_model(recorded: dict[str, Any], given: str | None, where: str) -> str:
    """Name or path of the model that a bag was recorded with, identified by its card.

    Args:
        recorded: Content of ~/scene.
        given: Name or path to use instead of the recorded one.
        where: The bag, for messages.

    Raises:
        CheckpointError: There is no such model, or only another one of the same name.
    """
    parameters = recorded.get('parameters', {})
    names = [given] if given is not None else [parameters.get('model', ''), recorded.get('model')]
    expected = _identity(recorded.get('model_card', {}))
    seen = []
    for name in [str(name) for name in names if name is not None]:
        try:
            simulator = load_simulator(name)
        except CheckpointError:
            continue
        found = _identity(simulator.card)
        if expected in ('', found):
            return name
        seen.append(f'{simulator.name} with {found}')
    wanted = expected or 'an empty card'
    raise CheckpointError(
        f'{where}: was recorded with model {recorded.get("model", "unknown")}, {wanted}; '
        f'here: {", ".join(seen) or "no such model"}; name its file with --model'
    )


def _identity(card: Mapping[str, Any]) -> str:
    """Identity of a model by its card: hash of weights, or options of the laws; '' if unknown."""
    if isinstance(card.get('weights_sha256'), str):
        return f'weights {card["weights_sha256"][:12]}...'
    if isinstance(card.get('options'), dict):
        return 'options ' + ', '.join(
            f'{name} {card["options"][name]}' for name in sorted(card['options'])
        )
    return ''
