# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scene files: a scene, and how its spheres start."""

from __future__ import annotations

from pathlib import Path

from .scene import Scene
from .start import StartRecipe
from ..errors import UserError
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
    except UserError as error:
        raise ConfigError(f'{path}: {error}') from error
    return scene, start
