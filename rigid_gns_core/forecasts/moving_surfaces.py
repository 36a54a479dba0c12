# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Surfaces of a scene that bodies carry, whose poses come on topics: rackets, trays, lifts.

The scene gives such a surface in the frame of its body.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .body_motion import BodyMotion, BodyTrack
from ..errors import shown, UserError
from ..files.config import ConfigError, from_mapping, parse_yaml
from ..prediction.laws import LawsSimulator
from ..scenes.plane import Plane, Vector
from ..scenes.scene import Scene
from ..scenes.state import Array

AHEAD = 2.0
"""Plans are followed for so long from a start, or for a longer horizon [s]; then bodies rest."""
_EXAMPLE = '{racket: {surfaces: [1], pose: racket/pose}}'


@dataclass(frozen=True)
class Body:
    """A body that carries surfaces.

    Args:
        surfaces: Their indices in the scene.
        pose: Topic of its poses, geometry_msgs/PoseStamped; empty: `frame` or `plan` says where
            it is.
        frame: Its frame of tf; empty: none.
        twist: Topic of its twists, geometry_msgs/TwistStamped; empty: estimated from the poses.
        plan: Topic of plans, trajectory_msgs/MultiDOFJointTrajectory; empty: none.
        span: Time of the newest poses from which a twist is estimated [s].
        timeout: A body whose newest pose is older is taken as at rest [s].

    Raises:
        UserError: It has no surface, neither poses nor plan, both topic and frame, or a time is
            not above 0.
    """

    surfaces: tuple[int, ...]
    pose: str = ''
    frame: str = ''
    twist: str = ''
    plan: str = ''
    span: float = 0.05
    timeout: float = 0.25

    def __post_init__(self) -> None:
        if not self.surfaces:
            raise UserError('surfaces is empty, expected indices of surfaces in the scene')
        if not self.pose and not self.frame and not self.plan:
            raise UserError('none of pose, frame and plan is given; one must say where it is')
        if self.pose and self.frame:
            raise UserError('pose and frame both say where it is; give one of them')
        if self.twist and not self.pose and not self.frame:
            raise UserError('twist is given, but neither pose nor frame; a twist moves a pose')
        for name in ('span', 'timeout'):
            value = getattr(self, name)
            if not 0.0 < value < 3600.0:
                raise UserError(f'{name} is {value:g} s, expected more than 0 and below 3600')

    @property
    def where(self) -> str:
        """What says where it is, for messages."""
        return self.pose or (f'/tf as {self.frame!r}' if self.frame else self.plan)


def bodies_of(text: str) -> dict[str, Body]:
    """Bodies by name from YAML, as `{racket: {surfaces: [1], pose: racket/pose}}`; empty: none.

    Raises:
        UserError: It is no such mapping, or a surface or topic is given twice.
    """
    try:
        content = parse_yaml(text) if text.strip() else {}
    except ConfigError as error:
        raise UserError(f'moving_surfaces: {error}; expected {_EXAMPLE}') from error
    if not isinstance(content, dict):
        raise UserError(
            f'moving_surfaces is {shown(content)}, expected names and bodies: {_EXAMPLE}'
        )
    bodies = {
        str(name): from_mapping(Body, given, f'moving_surfaces.{name}')
        for name, given in content.items()
    }
    for what, values in (
        ('surface', [index for body in bodies.values() for index in body.surfaces]),
        ('topic', [t for b in bodies.values() for t in (b.pose, b.twist, b.plan) if t]),
        ('frame', [body.frame for body in bodies.values() if body.frame]),
    ):
        twice = [value for k, value in enumerate(values) if value in values[:k]]
        if twice:
            raise UserError(f'moving_surfaces gives {what} {twice[0]} twice, expected it once')
    return bodies


class MovingSurfaces:
    """Surfaces of a scene that bodies carry, and where they are.

    `fixed` is the scene without them, and `tracks` holds what is known of each body.

    Args:
        scene: Gives each surface of a body in the frame of that.
        bodies: By name.

    Raises:
        UserError: There is no such surface, or the scene moves it itself.
    """

    def __init__(self, scene: Scene, bodies: Mapping[str, Body]) -> None:
        surfaces = scene.surfaces
        for name, body in bodies.items():
            for index in body.surfaces:
                if not 0 <= index < len(surfaces):
                    raise UserError(
                        f'moving_surfaces.{name} has surface {index}, but the scene has '
                        f'{len(surfaces)}, from 0 on'
                    )
                if surfaces[index].changes_place:
                    raise UserError(
                        f'moving_surfaces.{name} has surface {index}, which the scene moves '
                        'already; leave velocity and angular_velocity there out'
                    )
        self.bodies = dict(bodies)
        self._own = {
            name: {index: surfaces[index] for index in body.surfaces}
            for name, body in bodies.items()
        }
        bound = {index for own in self._own.values() for index in own}
        kept = tuple(one for index, one in enumerate(surfaces) if index not in bound)
        self.fixed = replace(scene, surfaces=kept) if bound else scene
        self.tracks = {
            name: BodyTrack(body.span, body.timeout) for name, body in self.bodies.items()
        }

    def check_model(self, kind: str) -> None:
        """Raise UserError where there are bodies and a kind of model knows no moving surface."""
        if self.bodies and kind != LawsSimulator.kind:
            raise UserError(
                f'moving_surfaces is given, but the model is of kind {kind}, and only the laws '
                'know surfaces that move; leave the parameter model empty'
            )

    @property
    def unknown(self) -> list[str]:
        """Names of the bodies of which nothing is known yet."""
        return [name for name, track in self.tracks.items() if not track.known]

    def at(self, stamp_ns: int, horizon: float = AHEAD) -> dict[int, Plane]:
        """The surfaces at a time, with their motion from then on, by their indices in the scene.

        Args:
            stamp_ns: The time [ns].
            horizon: What is planned counts for so long, and at least for `AHEAD` [s].

        Raises:
            UserError: Nothing is known of a body yet.
        """
        found: dict[int, Plane] = {}
        for name, track in self.tracks.items():
            motion = track.at(stamp_ns, max(horizon, AHEAD))
            if motion is None:
                where = self.bodies[name].where
                raise UserError(f'nothing has come for {name} on {where} yet')
            found |= {index: carried(plane, motion) for index, plane in self._own[name].items()}
        return dict(sorted(found.items()))


def carried(plane: Plane, motion: BodyMotion) -> Plane:
    """A plane of a body, given in the frame of that, in the frame of the scene."""

    def vector(values: Array) -> Vector:
        x, y, z = values.tolist()
        return (x, y, z)

    turn, spin = motion.rotation, motion.angular_velocity
    arm = turn.apply(plane.point)
    return replace(
        plane,
        point=vector(motion.position + arm),
        normal=vector(turn.apply(plane.normal)),
        direction=vector(turn.apply(np.asarray(plane.direction))),
        velocity=vector(motion.velocity + np.cross(spin, arm)),
        angular_velocity=vector(spin),
        surface_velocity=vector(turn.apply(plane.surface_velocity)),
        plan=motion.plan,
    )


def with_surfaces(fixed: Scene, surfaces: Mapping[int, Plane]) -> Scene:
    """A scene with surfaces put in at their indices, which rise."""
    if not surfaces:
        return fixed
    planes = list(fixed.surfaces)
    for index, plane in surfaces.items():
        planes.insert(index, plane)
    return replace(fixed, surfaces=tuple(planes))


def surfaces_to_mapping(surfaces: Mapping[int, Plane]) -> dict[str, Any]:
    """Plain numbers and lists by index, ready for JSON; to the bit."""
    if not surfaces:
        return {}
    planes = Scene(surfaces=tuple(surfaces.values())).to_mapping()['surfaces']
    return {str(index): plane for index, plane in zip(surfaces, planes, strict=True)}


def surfaces_from_mapping(mapping: Mapping[str, Any]) -> dict[int, Plane]:
    """Inverse of `surfaces_to_mapping`; UserError: it is no such mapping."""
    read = {
        int(index): from_mapping(Plane, plane, f'surfaces.{index}')
        for index, plane in mapping.items()
    }
    return dict(sorted(read.items()))
