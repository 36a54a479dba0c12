# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rows of the comparison: what is left out of the model or a scene, or always done."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from rigid_gns_core.scenes.scene import Scene

PER_SPHERE = ('radius', 'mass', 'restitution', 'friction', 'rolling_friction')


@dataclass(frozen=True, eq=False)  # by identity, so that what was measured is kept by change
class Change:
    """A change to the model or the scene.

    Args:
        usual, other: Descriptions of the model without and with the change.
        options: Options of the model, see `LawsOptions`.
        scene: Changes a scene, given the number of spheres.
        goes_on: Whether turns continue each other instead of restarting, for effects that build
            up.
    """

    usual: str = ''
    other: str = ''
    options: dict[str, Any] = field(default_factory=dict)
    scene: Callable[[Scene, int], Scene] = lambda scene, _: scene
    goes_on: bool = False


def _ground_only(scene: Scene, _: int) -> Scene:
    return replace(scene, surfaces=(scene.surfaces[scene.ground or 0],))


def _no_rolling(scene: Scene, _: int) -> Scene:
    return replace(scene, rolling_friction=0.0)


def _no_lift(scene: Scene, _: int) -> Scene:
    assert scene.air is not None
    return replace(scene, air=replace(scene.air, lift_coefficient=0.0))


def _vacuum(scene: Scene, _: int) -> Scene:
    return replace(scene, air=None)


def _materials_alone(scene: Scene, _: int) -> Scene:
    return replace(scene, surfaces=tuple(replace(p, contact=None) for p in scene.surfaces))


def _rising_ground(scene: Scene, _: int) -> Scene:
    ground, *others = scene.surfaces
    return replace(scene, surfaces=(replace(ground, velocity=(0.0, 0.0, 0.1)), *others))


def _tuples(scene: Scene, count: int) -> Scene:
    return replace(scene, **{n: tuple(scene.per_sphere(n, count).tolist()) for n in PER_SPHERE})


USUAL = Change()
AIR = Change('with air', 'in a vacuum', scene=_vacuum)
LIFT = Change('with lift', 'drag alone', scene=_no_lift)
CONTACT = Change('a contact law of the table', 'materials alone', scene=_materials_alone)
MOVING = Change('a table at rest', 'one that rises by 0.1 m/s', scene=_rising_ground)
SLEEP = Change('islands at rest sleep', 'all stay awake', options={'sleep': False}, goes_on=True)
GUARD = Change('guard on', 'guard off', options={'guard': False})
WALLS = Change('ground and four walls', 'ground alone', scene=_ground_only)
ROLLING = Change('with rolling friction', 'without', scene=_no_rolling)
TUPLES = Change('one number for all', 'the same, one per sphere', scene=_tuples)

# name: start, see `make_starts`, and what is changed; its text is in ablation_page.py
ROWS = {
    'sleep, box that came to rest': ('settled', SLEEP),
    'sleep, pile': ('settled pile', SLEEP),
    'guard, box': ('box', GUARD),
    'guard, pile': ('pile', GUARD),
    'air': ('thrown', AIR),
    'lift': ('thrown', LIFT),
    'contact law': ('thrown', CONTACT),
    'surface that moves': ('thrown', MOVING),
    'walls': ('bounce', WALLS),
    'rolling friction': ('roll', ROLLING),
    'properties per sphere': ('box', TUPLES),
}
