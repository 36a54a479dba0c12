# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What all peers can express: equal solid spheres in a vacuum, and planes without end at rest."""

from __future__ import annotations

import numpy as np

from ...errors import UserError
from ...scenes.plane import seen_from_behind, SOLID
from ...scenes.scene import Scene
from ...scenes.state import State


def check_plain(peer: str, scene: Scene, start: State) -> None:
    """Refuse a scene that has more.

    Args:
        peer: Its name, for messages.
        scene: The scene.
        start: State at time 0; a plane counts as one without end if no sphere is behind it.

    Raises:
        UserError: The scene has more.
    """
    laws = [scene.sphere_contact, *(surface.contact for surface in scene.surfaces)]
    solid = not np.any(scene.per_sphere('inertia_factor', len(start)) - SOLID)
    moving = any(surface.moves for surface in scene.surfaces)
    if scene.air is not None or any(laws) or not solid or moving or scene.obstacles:
        raise UserError(
            'the scene has air, a contact law, obstacles, spheres that are not solid or surfaces '
            f'that move; the {peer} peer takes solid spheres in a vacuum, with materials'
        )
    if seen_from_behind(scene.surfaces, start.positions).any():
        raise UserError(f'planes of {peer} have no end; the scene has one that spheres see')


def common_values(peer: str, scene: Scene, count: int, *names: str) -> dict[str, float]:
    """Values that all spheres of a scene share, by name.

    Raises:
        UserError: One differs between spheres.
    """
    values = {}
    for name in names:
        own = scene.per_sphere(name, count)
        if np.ptp(own) > 0:
            raise UserError(f'{name} differs between spheres; the {peer} peer takes one for all')
        values[name] = float(own[0])
    return values
