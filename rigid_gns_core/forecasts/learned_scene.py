# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A scene that took the place of another in a running node, as published on ~/learned.

What comes after it in a recording is predicted in it, so that recorded predictions are reproduced.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
import json
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ..errors import shown, UserError
from ..files.atomic_file import whole_file
from ..files.strict_json import parse_json
from ..scenes.scene import Scene

_HEAD = '# Learned by the node `simulator` from its own tracks; docs/node.md\n'


@dataclass(frozen=True)
class LearnedScene:
    """A scene that was fitted to tracks, and how it predicts the newest that were left out.

    Args:
        scene: The scene.
        tracks: Number of tracks that it was fitted to.
        left_out: Number of tracks that were left out.
        change: Mean change of the logarithm of the error of a left-out track, from the scene
            before.
        deviation: Its standard error.
        before: Median error of left-out tracks in the scene before [m], by time ahead [s].
        after: Likewise in this one.
        parameters: `value`, `error` (None: not told) and `unit` of what was fitted, by name.
        index: Index in the order of recording, over all topics; -1: not recorded.
    """

    scene: Scene
    tracks: int
    left_out: int
    change: float
    deviation: float
    before: Mapping[str, float]
    after: Mapping[str, float]
    parameters: Mapping[str, Mapping[str, Any]]
    index: int = -1

    @property
    def better(self) -> bool:
        """Whether it predicts left-out tracks better by more than the standard error."""
        return self.change + self.deviation < 0.0

    @property
    def text(self) -> str:
        """What changed, in a sentence."""
        errors = ', '.join(
            f'{100 * self.before[time]:.3g} to {100 * error:.3g} cm after {time} s'
            for time, error in self.after.items()
            if time in self.before
        )
        fitted = ', '.join(
            f'{name} {one["value"]:.4g} +- {one["error"] or np.inf:.2g}'
            for name, one in self.parameters.items()
        )
        return (
            f'median error of the newest {self.left_out} tracks from {errors}; fitted to '
            f'{self.tracks} before them: {fitted or "nothing"}'
        )

    @property
    def json(self) -> str:
        """Text of the message on ~/learned."""
        content = {one.name: getattr(self, one.name) for one in fields(self)}
        del content['index']
        return json.dumps(content | {'scene': self.scene.to_mapping()}, allow_nan=False)

    @classmethod
    def from_json(cls, text: str, index: int = -1) -> LearnedScene:
        """Parse the text of a message on ~/learned.

        Raises:
            UserError: The text is no such scene.
        """
        try:
            content = parse_json(text)
            content['scene'] = Scene.from_mapping(content['scene'], 'scene')
            return cls(**content, index=index)
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise UserError(f'{shown(error)}; expected JSON with scene, tracks, ...') from error


def write_learned(path: Path, learned: LearnedScene) -> None:
    """Write a scene file, whole or not at all; `load_scene` reads the scene.

    Raises:
        FileExistsError: There is a file that is no such one.
        OSError: It cannot be written.
    """
    if path.exists() and not path.read_text(encoding='utf-8', errors='replace').startswith(_HEAD):
        raise FileExistsError(
            f'{path} exists, and was not learned by a node; remove it or give another name'
        )
    card = parse_json(learned.json)
    content = {'scene': card.pop('scene'), 'card': card}
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as partial:
        text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=110)
        partial.write_text(_HEAD + text, encoding='utf-8')
