# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What does not change, as arrays: properties of spheres and planes, and gravity.

Body n, one past the last sphere, stands for everything that is fixed: its inverse mass is zero, so
that a contact with a surface is a contact of two bodies like any other. Contacts with planes that
move have fixed bodies of their own after it.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.jit import compiled, in_place
from ..kernels.vector import length, Vector
from ..scenes.plane import Plane
from ..scenes.scene import Scene
from ..scenes.state import Array

# gravity of the model's units, in which a frame takes 0.1 and the largest radius is 1
UNIT_GRAVITY = 9.81
# approach speeds below N times this time do not bounce, N the acceleration into the contact: the
# teacher's threshold, 3 g dt / 240
THRESHOLD_TIME = 3.0 * 0.1 / 240.0


# columns of `World.laws`: 1, e_slow, e_fast, u_0, mu, beta, rho, rho', sigma of a contact law; 0,
# e, 0, 0, mu and zeros of a material
GIVEN, SLOW, FAST, MIDDLE, SLIDE, GRIP, ROLL, SLOPE, SPIN = range(9)
# columns of `World.solids`: 1 and a `Profile`, or zeros
IS_SOLID, INNER, OUTER, HALF, ROUNDING, COSINE, SINE = range(7)
# columns of `Twists.path`: point, twist and its rate of change, axes (3 x 3), belt, the highest
# speed and rate of turning within a frame, and 1 where a plan moves the plane
POINT, VELOCITY, TURNING, PUSH, TWIST, AXES, BELT, SPEED, RATE, PLANNED = (
    0, 3, 6, 9, 12, 15, 24, 27, 28, 29,
)  # fmt: skip
COLUMNS = range(30)


class Twists(NamedTuple):
    """How planes move, s of them.

    moves: whether it does, shape (s,); velocity, spin: of its point, and about it, shape (s, 3);
    acceleration, spin_rate: how these change within a substep, shape (s, 3); fastest: the highest
    speed and rate of turning within a frame, of planes with a plan, else 0, shape (s, 2);
    point, axes, belt: at the start of a rollout, as in `World`, and the velocity of the surface on
    it, shape (s, 3); since: the time of `belt`, shape (s,); clock: time since the start, where the
    planes of `World` are, shape (1,); step: length of a substep; first: the substep of the first
    row of the path; path: where plans move planes at the start of each substep, and how, shape
    (substeps, s, 30), see `PLANNED`; of no substeps where there are no plans.
    """

    moves: NDArray[np.bool_]
    velocity: Array
    spin: Array
    acceleration: Array
    spin_rate: Array
    fastest: Array
    point: Array
    axes: Array
    belt: Array
    since: Array
    clock: Array
    step: float
    first: int
    path: Array


class World(NamedTuple):
    """Properties in the model's units; n spheres, s planes.

    radius, inverse_mass, inverse_inertia: of spheres, and of the fixed body (0), shape (n + 1,);
    the mass is that with the added mass of air; flight: acceleration by gravity and buoyancy, and
    in air the other parameters of `kernels.flight`, shape (n, 3) or (n, 15); in_air: whether there
    is air; restitution, friction, rolling_friction: of spheres, shape (n,); gravity: a
    vector; point: of the planes, shape (s, 3); axes: rows direction, normal x direction, normal of
    each plane, shape (s, 3, 3); half: half lengths along the first two axes, may be infinite,
    shape (s, 2); two_sided: planes with an end, which have two faces, shape (s,); faces: the same
    of all planes in rows of eight, normal, half length, point, half length, and then those of
    both axes, each with a number that is 1 where there are two faces, shape (16 s,);
    has_laws: whether there are contact laws; laws: those, or the materials, of the planes and,
    last, of two spheres, shape (s + 1, 9); has_solids: whether planes stand for solids, see
    `engine.solids`; solids: those, shape (s, 7); moving: whether any plane moves; twists: how.
    """

    radius: Array
    inverse_mass: Array
    inverse_inertia: Array
    flight: Array
    in_air: bool
    restitution: Array
    friction: Array
    rolling_friction: Array
    gravity: Vector
    point: Array
    axes: Array
    half: Array
    two_sided: NDArray[np.bool_]
    faces: Array
    has_laws: bool
    laws: Array
    has_solids: bool
    solids: Array
    moving: bool
    twists: Twists


@lru_cache(maxsize=64)
def still_world(scene: Scene, count: int) -> World | None:
    """World in which no plane moves, which all rollouts may share; None: one moves."""
    world = world_of(scene, count)
    return None if world.moving else world


def world_of(scene: Scene, count: int, step: float = 1.0) -> World:
    """World of `count` spheres in `scene`; `step` is the length of a substep."""
    radius = scene.per_sphere('radius', count)
    mass = scene.per_sphere('mass', count)
    inertia = scene.per_sphere('inertia_factor', count)
    flight, heavy = np.tile(scene.gravity, (count, 1)), mass
    if scene.air is not None:
        flight = np.ascontiguousarray(scene.air.flight(radius, mass, scene.gravity))
        heavy = scene.air.effective_mass(radius, mass)
    planes, solids = _planes_and_solids(scene)
    laws = _laws_of(scene, planes)

    def array(values: object, *shape: int) -> Array:
        return np.array(values, dtype=np.float64).reshape(shape or (-1,))

    return World(
        radius=np.append(radius, 0.0),
        inverse_mass=np.append(1.0 / heavy, 0.0),
        inverse_inertia=np.append(1.0 / inertia / (mass * radius**2), 0.0),
        flight=flight,
        in_air=scene.air is not None,
        restitution=array(scene.per_sphere('restitution', count)),
        friction=array(scene.per_sphere('friction', count)),
        rolling_friction=array(scene.per_sphere('rolling_friction', count)),
        gravity=scene.gravity,
        point=array([plane.point for plane in planes], -1, 3),
        axes=array([plane.axes for plane in planes], -1, 3, 3),
        half=array([plane.half_lengths for plane in planes], -1, 2),
        two_sided=np.array([not plane.is_half_space for plane in planes], dtype=bool),
        faces=_faces_of(planes),
        has_laws=bool(laws[:, GIVEN].any()),
        laws=laws,
        has_solids=bool(solids.any()),
        solids=solids,
        moving=any(plane.moves for plane in planes),
        twists=Twists(
            moves=np.array([plane.moves for plane in planes], dtype=bool),
            velocity=array([plane.velocity for plane in planes], -1, 3),
            spin=array([plane.angular_velocity for plane in planes], -1, 3),
            acceleration=np.zeros((len(planes), 3)),
            spin_rate=np.zeros((len(planes), 3)),
            fastest=np.zeros((len(planes), 2)),
            point=array([plane.point for plane in planes], -1, 3),
            axes=array([plane.axes for plane in planes], -1, 3, 3),
            belt=array([plane.surface_velocity for plane in planes], -1, 3),
            since=np.zeros(len(planes)),
            clock=np.zeros(1),
            step=float(step),
            first=0,
            path=np.zeros((0, len(planes), len(COLUMNS))),
        ),
    )


def _faces_of(planes: tuple[Plane, ...]) -> Array:
    """Planes as rows of eight, see `World.faces`."""
    faces = np.empty((2, len(planes), 8))
    for k, plane in enumerate(planes):
        axes, half, two = plane.axes, plane.half_lengths, float(not plane.is_half_space)
        faces[0, k] = *axes[2], half[0], *plane.point, half[1]
        faces[1, k] = *axes[0], two, *axes[1], two
    return faces.reshape(-1)


def _planes_and_solids(scene: Scene) -> tuple[tuple[Plane, ...], Array]:
    """Surfaces and those of obstacles, s of them; which are solids, see `World.solids`."""
    parts = [part for obstacle in scene.obstacles for part in obstacle.parts]
    planes = (*scene.surfaces, *(plane for plane, _ in parts))
    solids = np.zeros((len(planes), 7))
    for row, (_, profile) in zip(solids[len(scene.surfaces) :], parts, strict=True):
        if profile is not None:
            row[:] = 1.0, *profile
    return planes, solids


def _laws_of(scene: Scene, planes: tuple[Plane, ...]) -> Array:
    """Contact laws, or materials, of planes and of two spheres, see `World.laws`."""
    laws = np.zeros((len(planes) + 1, 9))
    laws[:-1, SLOW] = scene.values_of('restitution', planes)
    laws[:-1, SLIDE] = scene.values_of('friction', planes)
    for row, law in zip(
        laws, [*(plane.contact for plane in planes), scene.sphere_contact], strict=True
    ):
        if law is not None:
            row[GIVEN] = 1.0
            row[SLOW], row[FAST], row[MIDDLE] = law.curve.slow, law.curve.fast, law.curve.speed
            row[SLIDE], row[GRIP] = law.friction, law.tangential_restitution
            row[ROLL], row[SLOPE] = law.rolling_friction, law.rolling_friction_slope
            row[SPIN] = law.spinning_friction
    return laws


@in_place
def given_law(world: World, plane: int) -> int:
    """Row of the contact law of a plane, or of spheres for -1; -1: materials hold."""
    if not world.has_laws:
        return -1
    given = plane if plane >= 0 else len(world.laws) - 1
    return given if world.laws[given, GIVEN] > 0 else -1


@in_place
def gravity_of(world: World) -> Vector:
    """Gravity as a vector in registers."""
    return world.gravity


@in_place
def weight_of(world: World) -> float:
    """Size of gravity."""
    return length(gravity_of(world))


@compiled
def world_among(world: World, members: NDArray[np.int64], fixed: int) -> World:
    """World of these spheres alone, and so many fixed bodies."""
    bodies = np.full(len(members) + fixed, len(world.restitution))
    for m in range(len(members)):
        bodies[m] = members[m]
    return World(
        radius=world.radius[bodies],
        inverse_mass=world.inverse_mass[bodies],
        inverse_inertia=world.inverse_inertia[bodies],
        flight=world.flight[members],
        in_air=world.in_air,
        restitution=world.restitution[members],
        friction=world.friction[members],
        rolling_friction=world.rolling_friction[members],
        gravity=world.gravity,
        point=world.point,
        axes=world.axes,
        half=world.half,
        two_sided=world.two_sided,
        faces=world.faces,
        has_laws=world.has_laws,
        laws=world.laws,
        has_solids=world.has_solids,
        solids=world.solids,
        moving=world.moving,
        twists=world.twists,
    )
