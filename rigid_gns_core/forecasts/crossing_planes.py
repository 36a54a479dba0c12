# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Planes whose crossing is forecast, as the text of a parameter."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import shown, UserError
from ..files.config import ConfigError, from_mapping, parse_yaml
from ..scenes.plane import Plane

_EXAMPLE = '{racket: {point: [0.5, 0, 0.3], normal: [-1, 0, 0]}}'


@dataclass(frozen=True)
class _Given:
    """Keys of a plane in the text: those of `Plane` but for materials."""

    point: tuple[float, float, float]
    normal: tuple[float, float, float]
    direction: tuple[float, float, float] | None = None
    length_x: float = float('inf')
    length_y: float = float('inf')


def planes_of(text: str) -> dict[str, Plane]:
    """Planes by name from YAML, as `{racket: {point: [0.5, 0, 0.3], normal: [-1, 0, 0]}}`.

    Keys of a plane are `point`, `normal`, and optionally `direction`, `length_x` and `length_y`;
    see `Plane`. Empty: none.

    Raises:
        UserError: It is no such mapping.
    """
    try:
        content = parse_yaml(text) if text.strip() else {}
    except ConfigError as error:
        raise UserError(f'crossing_planes: {error}; expected {_EXAMPLE}') from error
    if not isinstance(content, dict):
        raise UserError(
            f'crossing_planes is {shown(content)}, expected names and planes: {_EXAMPLE}'
        )
    planes = {}
    for name, given in content.items():
        if not isinstance(given, dict):
            raise UserError(f'crossing_planes.{name} is {shown(given)}, expected {_EXAMPLE}')
        plane = from_mapping(_Given, given, f'crossing_planes.{name}')
        try:
            planes[str(name)] = Plane(**vars(plane))
        except UserError as error:
            raise UserError(f'crossing_planes.{name}: {error}') from error
    return planes
