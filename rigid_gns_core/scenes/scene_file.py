# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scene files: a scene, and how its spheres start."""

from __future__ import annotations

from pathlib import Path

import yaml

from .scene import Scene
from .start import StartRecipe
from .state import State
from ..errors import shown, UserError
from ..files.atomic_file import whole_file
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
    the second may be absent: then one sphere starts at a random place. A `card:` says where the
    values come from, and is not read.

    Raises:
        ConfigError: No such scene, an unknown key, or a value out of range.
    """
    if not isinstance(name, (str, Path)):
        raise ConfigError(f'scene is {shown(name)}, expected a name or the path of a YAML file')
    path = find_config('scenes', name)
    mapping = load_yaml(path)
    if unknown := sorted(set(mapping) - {'scene', 'start', 'card'}, key=str):
        raise ConfigError(f'{path}: unknown key {shown(unknown[0])}, allowed: scene, start, card')
    for key in ('scene', 'start'):
        if not isinstance(mapping.get(key, {}), dict):
            raise ConfigError(f'{path}: {key} is {shown(mapping[key])}, expected a mapping')
    if 'scene' not in mapping:
        raise ConfigError(f"{path}: missing key 'scene'")
    try:
        scene = Scene.from_mapping(mapping['scene'], 'scene')
        start = from_mapping(StartRecipe, mapping.get('start', {}), 'start')
    except UserError as error:
        raise ConfigError(f'{path}: {error}') from error
    return scene, start


def write_start(path: Path, scene: Scene, start: State, remark: str = '') -> None:
    """Write a scene and the state of its spheres; `load_start` reads back the same bits.

    The lines of `remark` are the comment at the top.
    """
    names = {
        'at': 'positions',
        'velocities': 'velocities',
        'angular_velocities': 'angular_velocities',
        'quaternions': 'quaternions',
    }
    content = {
        'scene': scene.to_mapping(),
        'start': {key: getattr(start, name).tolist() for key, name in names.items()},
    }
    head = ''.join(f'# {line}\n' for line in remark.splitlines())
    with whole_file(path) as partial:
        partial.write_text(head + yaml.safe_dump(content, sort_keys=False), encoding='utf-8')
