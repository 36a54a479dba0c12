# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the simulators in a bag said of scene, model and parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..bags.reader import Bag, BagError
from ..bags.topics import listing, recorded_scenes, said_names, scene_topics, Topics
from ..files.checkpoint import CheckpointError
from ..prediction.load import load_simulator
from ..scenes.scene import Scene


@dataclass(frozen=True)
class SaidScenes:
    """Simulators that recorded themselves.

    Args:
        bag: The bag.
        simulators: What each said on its ~/scene.
        unusable: Names of topics .../scene whose text holds no scene: they are of others.
    """

    bag: Bag
    simulators: list[dict[str, Any]]
    unusable: list[str]

    @classmethod
    def of(cls, bag: Bag) -> SaidScenes:
        """Read the topics .../scene of a bag."""
        texts = {topic.name for topic in scene_topics(bag)}
        usable = {
            name: said
            for name, said in recorded_scenes(bag).items()
            if isinstance(said.get('scene'), dict)
        }
        return cls(bag, list(usable.values()), sorted(texts - set(usable)))

    @property
    def tracked(self) -> list[str]:
        """Topics of tracked poses that they named."""
        return [said_names(one).get('tracked', '') for one in self.simulators]

    def scene(self, topic: str) -> Scene:
        """Return the scene of a topic of tracked poses.

        Raises:
            BagError: None is said, or several that differ.
        """
        own = self._of(topic)
        if not own or any(one['scene'] != own[0]['scene'] for one in own):
            problem = f'{len(own)} simulators differ in'
            if not own:
                problem = 'no .../scene topic says'
                if self.unusable:
                    problem = f'{", ".join(self.unusable)} holds no scene of a simulator that says'
            raise BagError(
                f'{self.bag.path}: {problem} what the scene is; name it with --scene. '
                f'The bag holds {listing(self.bag)}'
            )
        return Scene.from_mapping(own[0]['scene'], 'scene of the bag')

    def scene_by(self, topics: Topics) -> Scene:
        """Return the scene of the simulator that predicted, else that of its tracked poses."""
        if 'scene' in topics.recorded:
            return Scene.from_mapping(topics.recorded['scene'], 'scene of the bag')
        return self.scene(topics.tracked.name)

    def parameters(self, topic: str) -> Mapping[str, Any]:
        """Return the parameters of a simulator that tracked a topic, rather of one that matched.

        None is recorded where they are empty.
        """
        said = [one.get('parameters') for one in self._of(topic)]
        known = [one for one in said if isinstance(one, dict)]
        matched = [one for one in known if one.get('match_spheres')]
        return next(iter(matched + known), {})

    def _of(self, topic: str) -> list[dict[str, Any]]:
        """Those that tracked the topic; where none says so, all."""
        named = zip(self.tracked, self.simulators, strict=True)
        return [one for name, one in named if name == topic] or self.simulators


def find_recorded_model(recorded: dict[str, Any], given: str | None, where: str) -> str:
    """Name or path of the model that a bag was recorded with, told by its card.

    Args:
        recorded: What the simulator said on ~/scene.
        given: Name or path instead of the recorded one.
        where: For messages.

    Raises:
        CheckpointError: It is not here, or is another one of the same name.
    """
    parameters = recorded.get('parameters', {})
    names = [given] if given is not None else [parameters.get('model', ''), recorded.get('model')]
    expected = _mark(recorded.get('model_card', {}))
    seen = []
    for name in [str(name) for name in names if name is not None]:
        try:
            simulator = load_simulator(name)
        except CheckpointError:
            continue
        found = _mark(simulator.card)
        if expected in ('', found):
            return name
        seen.append(f'{simulator.name} with {found}')
    wanted = expected or 'an empty card'
    raise CheckpointError(
        f'{where}: was recorded with model {recorded.get("model", "unknown")}, {wanted}; '
        f'here: {", ".join(seen) or "no such model"}; name its file with --model'
    )


def _mark(card: Mapping[str, Any]) -> str:
    """Return what tells a model from others: weights, or options of the laws; '' if unknown."""
    if 'weights_sha256' in card:
        return f'weights {card["weights_sha256"][:12]}...'
    if 'options' in card:
        return 'options ' + ', '.join(
            f'{name} {card["options"][name]}' for name in sorted(card['options'])
        )
    return ''
