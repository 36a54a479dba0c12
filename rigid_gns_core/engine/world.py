# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What does not change, as arrays: properties of spheres and planes, and gravity.

Body n, one past the last sphere, stands for everything that is fixed: its inverse mass is zero, so
that a contact with a surface is a contact of two bodies like any other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.jit import compiled, in_place
from ..kernels.vector import length, Vector
from ..scenes.contact_law import ContactLaw
from ..scenes.scene import Scene
from ..scenes.state import Array

# gravity of the model's units, in which a frame takes 0.1 and the largest radius is 1
UNIT_GRAVITY = 9.81
# approach speeds below N times this time do not bounce, N the acceleration into the contact: the
# teacher's threshold, 3 g dt / 240
THRESHOLD_TIME = 3.0 * 0.1 / 240.0


class World(NamedTuple):
    """Properties in the model's units; n spheres, s planes.

    radius, inverse_mass, inverse_inertia: of spheres, and of the fixed body (0), shape (n + 1,);
    the mass is that with the added mass of air; pull: acceleration by gravity and buoyancy, shape
    (n, 3); in_air: whether there is air; flight: parameters of the flights in it, shape (n, 13),
    or (0, 13); restitution, friction, rolling_friction: of spheres, shape (n,); gravity: shape
    (3,); point: of the planes, shape (s, 3); axes: rows direction, normal x direction, normal of
    each plane, shape (s, 3, 3); half: half lengths along the first two axes, may be infinite,
    shape (s, 2); two_sided: planes with an end, which have two faces, shape (s,);
    surface_restitution, surface_friction: of the planes, shape (s,); surface_law: contact law of
    each plane, shape (s, 9), and sphere_law: of two spheres, shape (9,), as of `_law_row`, all 0
    where materials hold.
    """

    radius: Array
    inverse_mass: Array
    inverse_inertia: Array
    pull: Array
    in_air: bool
    flight: Array
    restitution: Array
    friction: Array
    rolling_friction: Array
    gravity: Array
    point: Array
    axes: Array
    half: Array
    two_sided: NDArray[np.bool_]
    surface_restitution: Array
    surface_friction: Array
    surface_law: Array
    sphere_law: Array


def world_of(scene: Scene, count: int) -> World:
    """World of `count` spheres in `scene`."""
    radius = scene.per_sphere('radius', count)
    mass = scene.per_sphere('mass', count)
    inertia = scene.per_sphere('inertia_factor', count)
    pull, flight, heavy = np.tile(scene.gravity, (count, 1)), np.empty((0, 13)), mass
    if scene.air is not None:
        flight = np.ascontiguousarray(scene.air.flight(radius, mass, scene.gravity))
        pull, heavy = flight[:, :3].copy(), scene.air.effective_mass(radius, mass)
    planes = scene.surfaces
    half = [[plane.length_x / 2, plane.length_y / 2] for plane in planes]
    half_lengths = np.array(half, dtype=np.float64).reshape(-1, 2)

    def array(values: object, *shape: int) -> Array:
        return np.array(values, dtype=np.float64).reshape(shape or (-1,))

    return World(
        radius=np.append(radius, 0.0),
        inverse_mass=np.append(1.0 / heavy, 0.0),
        inverse_inertia=np.append(1.0 / inertia / (mass * radius**2), 0.0),
        pull=pull,
        in_air=scene.air is not None,
        flight=flight,
        restitution=array(scene.per_sphere('restitution', count)),
        friction=array(scene.per_sphere('friction', count)),
        rolling_friction=array(scene.per_sphere('rolling_friction', count)),
        gravity=array(scene.gravity),
        point=array([plane.point for plane in planes], -1, 3),
        axes=array([plane.axes for plane in planes], -1, 3, 3),
        half=half_lengths,
        two_sided=np.asarray(np.isfinite(half_lengths).any(axis=1)),
        surface_restitution=array(scene.surface_values('restitution')),
        surface_friction=array(scene.surface_values('friction')),
        surface_law=array([_law_row(plane.contact) for plane in planes], -1, 9),
        sphere_law=array(_law_row(scene.sphere_contact)),
    )


def _law_row(law: ContactLaw | None) -> list[float]:
    """1, e_slow, e_fast, u_0, mu, beta, rho, rho', sigma of a contact law; zeros without."""
    if law is None:
        return [0.0] * 9
    curve = law.curve
    return [
        1.0,
        curve.slow,
        curve.fast,
        curve.speed,
        law.friction,
        law.tangential_restitution,
        law.rolling_friction,
        law.rolling_friction_slope,
        law.spinning_friction,
    ]


@in_place
def gravity_of(world: World) -> Vector:
    """Gravity as a vector in registers."""
    return world.gravity[0], world.gravity[1], world.gravity[2]


@in_place
def weight_of(world: World) -> float:
    """Size of gravity."""
    return length(gravity_of(world))


@compiled
def world_among(world: World, members: NDArray[np.int64]) -> World:
    """World of these spheres alone."""
    bodies = np.append(members, len(world.restitution))
    flight = world.flight[members] if world.in_air else world.flight
    return World(
        radius=world.radius[bodies],
        inverse_mass=world.inverse_mass[bodies],
        inverse_inertia=world.inverse_inertia[bodies],
        pull=world.pull[members],
        in_air=world.in_air,
        flight=flight,
        restitution=world.restitution[members],
        friction=world.friction[members],
        rolling_friction=world.rolling_friction[members],
        gravity=world.gravity,
        point=world.point,
        axes=world.axes,
        half=world.half,
        two_sided=world.two_sided,
        surface_restitution=world.surface_restitution,
        surface_friction=world.surface_friction,
        surface_law=world.surface_law,
        sphere_law=world.sphere_law,
    )
