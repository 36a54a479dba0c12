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

"""Scene files: a scene, and how its spheres start."""

from __future__ import annotations

from pathlib import Path

from .scene import Scene
from .start import StartRecipe
from ..files.config import ConfigError, find_config, from_mapping, load_yaml


def load_scene(name: str | Path) -> Scene:
    """Load a scene from a YAML file, or by a shipped name in config/scenes.

    Raises:
        ConfigError: No such scene, an unknown key, or a value out of range.
    """
    return load_start(name)[0]


def load_start(name: str | Path) -> tuple[Scene, StartRecipe]:
    """Load a scene and its start from a YAML file, or by a shipped name in config/scenes.

    The file holds `scene:` (see `Scene.from_mapping`) and `start:` (see `StartRecipe`), of which
    the second may be absent: then one sphere starts at a random place.

    Raises:
        ConfigError: No such scene, an unknown key, or a value out of range.
    """
    path = find_config('scenes', name)
    mapping = load_yaml(path)
    if unknown := sorted(set(mapping) - {'scene', 'start'}, key=str):
        raise ConfigError(f'{path}: unknown key {unknown[0]!r}, allowed: scene, start')
    for key in ('scene', 'start'):
        if not isinstance(mapping.get(key, {}), dict):
            raise ConfigError(f'{path}: {key} is {mapping[key]!r}, expected a mapping')
    if 'scene' not in mapping:
        raise ConfigError(f"{path}: missing key 'scene'")
    try:
        scene = Scene.from_mapping(mapping['scene'], 'scene')
        start = from_mapping(StartRecipe, mapping.get('start', {}), 'start')
    except ValueError as error:
        raise ConfigError(f'{path}: {error}') from error
    return scene, start
