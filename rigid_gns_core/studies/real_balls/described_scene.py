# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The scene that the description of a recording tells (NAME.json beside NAME.csv).

Read are `radius_m`, and where they are there `mass_kg`, `inertia_factor`, `table_plane` (`normal`,
`centre_at_contact`: the ball's centre there), `table_extent` (ends along x or y), and `cushions`
(`x`, `y`: the noses, `nose_height_m` above the table). Contact laws are those of no ball in
particular: a fit starts from them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...errors import UserError
from ...scenes.contact_law import ContactLaw
from ...scenes.plane import Plane, SOLID
from ...scenes.scene import Scene

TABLE = ContactLaw(restitution=0.8, friction=0.3, rolling_friction=0.01)
CUSHION = ContactLaw(restitution=0.75, friction=0.2)
BALLS = ContactLaw(restitution=0.9, friction=0.05)
# of a ball whose mass is not told: between a beanbag and a solid rubber ball [kg/m^3]
_DENSITY = 700.0


def described_scene(about: Mapping[str, Any], where: str) -> Scene:
    """Scene of a description.

    Args:
        about: The description.
        where: Its file, for messages.

    Raises:
        UserError: The radius is not told, or a value is out of range.
    """
    radius = about.get('radius_m')
    if not isinstance(radius, (int, float)):
        raise UserError(f'{where}: radius_m is {radius!r}, expected the radius of the ball in m')
    mass, inertia = about.get('mass_kg'), about.get('inertia_factor')
    try:
        return Scene(
            surfaces=(*_table(about, radius), *_cushions(about, radius)),
            radius=radius,
            mass=_DENSITY * 4.0 / 3.0 * np.pi * radius**3 if mass is None else mass,
            inertia_factor=SOLID if inertia is None else inertia,
            sphere_contact=BALLS,
        )
    except UserError as error:
        raise UserError(f'{where}: {error}') from error
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise UserError(
            f'{where}: surfaces cannot be read ({error!r}); give a scene file beside the CSV '
            'instead'
        ) from error


def _table(about: Mapping[str, Any], radius: float) -> tuple[Plane, ...]:
    table = about.get('table_plane')
    if table is None:
        return ()
    normal = np.asarray(table['normal'], dtype=np.float64)
    normal = normal / np.linalg.norm(normal)
    # of a floor of which only the direction is told the height is 0
    centre = np.asarray(table.get('centre_at_contact', radius * normal), dtype=np.float64)
    point = centre - radius * normal
    lengths = [np.inf, np.inf]
    extent = about.get('table_extent') or {}
    for axis in (0, 1):
        if (ends := extent.get('xy'[axis])) is not None:
            point[axis] = 0.5 * (ends[0] + ends[1])
            lengths[axis] = abs(ends[1] - ends[0])
    point = point - normal * ((point - centre) @ normal + radius)
    return (
        Plane(
            point=(float(point[0]), float(point[1]), float(point[2])),
            normal=(float(normal[0]), float(normal[1]), float(normal[2])),
            direction=(1.0, 0.0, 0.0),
            contact=TABLE,
            length_x=lengths[0],
            length_y=lengths[1],
        ),
    )


def _cushions(about: Mapping[str, Any], radius: float) -> tuple[Plane, ...]:
    """Planes that a ball meets at the noses, tilted by as much as these are above its middle."""
    cushions = about.get('cushions')
    if cushions is None:
        return ()
    nose = float(cushions.get('nose_height_m', radius))
    lean = float(np.arcsin(np.clip(nose / radius - 1.0, -0.9, 0.9)))
    planes = []
    for axis in (0, 1):
        other = 0.5 * sum(cushions['yx'[axis]])
        for end, sign in zip(cushions['xy'[axis]], (1.0, -1.0), strict=True):
            point, normal = [other, other, nose], [0.0, 0.0, -float(np.sin(lean))]
            point[axis], normal[axis] = float(end), sign * float(np.cos(lean))
            place, way = np.array(point), np.array(normal)
            planes.append(
                Plane((place[0], place[1], place[2]), (way[0], way[1], way[2]), contact=CUSHION)
            )
    return tuple(planes)
