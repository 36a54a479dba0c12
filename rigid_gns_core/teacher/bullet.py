# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The teacher: Bullet with settings under which spheres obey closed-form mechanics.

The only importer of pybullet. `docs/teacher.md` gives the reason and the measured effect of every
setting; `rigid-gns closed-forms` measures them again.

Bullet works here in units of its own: lengths in median radii and masses in millions of mean
masses, because some of its thresholds are absolute numbers. Time stays in seconds.
"""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np

from .rolling import RollingFriction
from .settings import TeacherError, TeacherSettings
from ..installation.extras import missing
from ..scenes.obstacle import Obstacle
from ..scenes.plane import Plane, seen_from_behind, SOLID
from ..scenes.scene import Scene
from ..scenes.state import Array, State, Trajectory

# Rolling friction acts with at most one unit of impulse in Bullet: light bodies never reach it
_MASS = 1e-6
# A slab stands for a strip or a plate; a side that is infinite is this long, in radii
_ENDLESS = 1e4
# Spheres must not get past the middle of the slab in one substep: behind a wall whose back is out
# of reach it is this thick, in largest radii
_THICK = 4.0
# The back of one that is seen from behind is this far behind its front, in smallest radii: with
# less, Bullet's normals lean in digits that matter
_THIN = 1e-3


def load_pybullet() -> ModuleType:
    """Import pybullet.

    Raises:
        ModuleNotFoundError: It is not installed; the message tells how to get it.
    """
    try:
        import pybullet
    except ModuleNotFoundError as error:
        raise missing(error, 'the Bullet teacher') from error
    module: ModuleType = pybullet
    return module


class Teacher:
    """A live Bullet scene; also a context manager.

    Args:
        scene: Surfaces, sphere properties and materials.
        start: State at time 0.
        dt: Time of one `step` [s].
        settings: How Bullet is run.

    Raises:
        UserError: There is no sphere, a value does not fit the scene, or the scene has air, a
            contact law, a ring or a tube, which Bullet has not.
        ModuleNotFoundError: pybullet is not installed.
    """

    def __init__(
        self,
        scene: Scene,
        start: State,
        dt: float = 0.1,
        settings: TeacherSettings = TeacherSettings(),
    ) -> None:
        if len(start) == 0:
            raise TeacherError('the start has no sphere; the teacher needs at least one')
        if not (np.isfinite(dt) and dt > 0):
            raise TeacherError(f'dt is {dt}, expected a positive number of seconds')
        laws = [scene.sphere_contact, *(fixed.contact for fixed in scene.fixed_materials)]
        moving = any(surface.moves for surface in scene.surfaces)
        hollow = [o.shape for o in scene.obstacles if o.shape in ('ring', 'tube')]
        if scene.air is not None or any(laws) or moving or hollow:
            what = 'air' if scene.air is not None else 'a contact law'
            what = 'a surface that moves' if moving else what
            what = f'a {hollow[0]}' if hollow else what
            raise TeacherError(
                f'the scene has {what}, which this teacher has not; simulate it by the laws: '
                "load_simulator('laws')"
            )
        self.scene, self.dt, self.settings = scene, float(dt), settings
        self._substep = self.dt / settings.substeps
        radius = scene.per_sphere('radius', len(start))
        self._length = float(np.median(radius))
        self._radius = radius / self._length
        mass = scene.per_sphere('mass', len(start))
        self._mass = _MASS * mass / mass.mean()
        self._gravity = np.asarray(scene.gravity) / self._length
        self._bullet = load_pybullet()
        self._client = self._bullet.connect(self._bullet.DIRECT)
        if self._client < 0:
            raise TeacherError('Bullet has no free client left; close teachers that are not used')
        try:
            self._configure()
            self._add_surfaces(start)
            self._bodies, self._rolling = self._add_spheres(start)
        except BaseException:
            self.close()
            raise
        self._state = start

    def __enter__(self) -> Teacher:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """Free Bullet's memory; the state stays readable."""
        if self._client >= 0:
            self._bullet.disconnect(physicsClientId=self._client)
            self._client = -1

    @property
    def state(self) -> State:
        """Spheres now."""
        return self._state

    def step(self) -> State:
        """Advance by `dt` and return the state; TeacherError where the teacher is closed."""
        if self._client < 0:
            raise TeacherError('this teacher is closed; make a new one')
        substeps, client = self.settings.substeps, self._client
        advance, rolling = self._bullet.stepSimulation, self._rolling
        every = max(1, substeps // max(1, self.settings.rolling_updates))
        before = change = np.zeros((len(self._bodies), 2, 3))
        for substep in range(1, substeps + 1):
            if substep == substeps:
                before = self._velocities()
            if rolling and substep % every == 1 % every:
                rolling.let_go(every * self._substep)
            advance(physicsClientId=client)
            if substep == substeps:
                change = self._velocities() - before
            if rolling:
                rolling.collect()
                if substep % every == 0 or substep == substeps:
                    rolling.resist()
        self._state = self._read(change)
        return self._state

    def _configure(self) -> None:
        settings, bullet = self.settings, self._bullet
        bullet.setGravity(*self._gravity, physicsClientId=self._client)
        fall = float(np.linalg.norm(self._gravity)) * self._substep
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=self._substep,
            numSubSteps=0,
            numSolverIterations=settings.solver_iterations,
            restitutionVelocityThreshold=settings.bounce_threshold * fall,
            erp=0.0,
            frictionERP=0.0,
            contactERP=settings.contact_erp,
            useSplitImpulse=1,
            splitImpulsePenetrationThreshold=0.0,
            contactSlop=0.0,
            solverResidualThreshold=(settings.solver_tolerance * fall) ** 2,
            deterministicOverlappingPairs=1,
            physicsClientId=self._client,
        )

    def _material(self, body: int, restitution: float, friction: float, rolling: float) -> None:
        self._bullet.changeDynamics(
            body,
            -1,
            restitution=restitution,
            lateralFriction=friction,
            rollingFriction=rolling,
            spinningFriction=rolling,
            linearDamping=0.0,
            angularDamping=0.0,
            contactProcessingThreshold=0.0,
            activationState=self._bullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            physicsClientId=self._client,
        )

    def _add_body(self, shape: int, mass: float, position: Any, quaternion: Any) -> int:
        if shape < 0:
            raise TeacherError('Bullet refused a shape')
        body: int = self._bullet.createMultiBody(
            mass,
            shape,
            basePosition=list(position),
            baseOrientation=list(quaternion),
            useMaximalCoordinates=True,
            physicsClientId=self._client,
        )
        if body < 0:
            raise TeacherError('Bullet refused a body; it may hold too many already')
        return body

    def _add_surfaces(self, start: State) -> None:
        fixed = self.scene.fixed_materials
        restitution = self.scene.values_of('restitution', fixed)
        friction = self.scene.values_of('friction', fixed)
        sheets = seen_from_behind(self.scene.surfaces, start.positions)
        for index, plane in enumerate(self.scene.surfaces):
            body = self._add_surface(plane, bool(sheets[index]))
            self._material(body, restitution[index], friction[index], 0.0)
        for index, obstacle in enumerate(self.scene.obstacles, len(self.scene.surfaces)):
            body = self._add_obstacle(obstacle)
            self._material(body, restitution[index], friction[index], 0.0)

    def _add_surface(self, plane: Plane, sheet: bool) -> int:
        bullet, client = self._bullet, self._client
        point = np.asarray(plane.point) / self._length
        if plane.is_half_space:
            shape = bullet.createCollisionShape(
                bullet.GEOM_PLANE, planeNormal=list(plane.normal), physicsClientId=client
            )
            return self._add_body(shape, 0.0, point, (0.0, 0.0, 0.0, 1.0))
        thickness = _THIN * self._radius.min() if sheet else _THICK * self._radius.max()
        half = np.append(
            np.minimum(plane.half_lengths / self._length, _ENDLESS / 2.0), thickness / 2
        )
        shape = bullet.createCollisionShape(
            bullet.GEOM_BOX, halfExtents=half.tolist(), physicsClientId=client
        )
        return self._add_body(
            shape, 0.0, point - half[2] * np.asarray(plane.normal), _rotation(plane.axes)
        )

    def _add_obstacle(self, obstacle: Obstacle) -> int:
        bullet, client, axes = self._bullet, self._client, obstacle.axes
        sizes = {name: getattr(obstacle, name) for name in ('radius', 'length', 'size')}
        scaled = {name: np.divide(v, self._length) for name, v in sizes.items() if v is not None}
        if obstacle.shape == 'box':
            kind, given = bullet.GEOM_BOX, {'halfExtents': (scaled['size'] / 2).tolist()}
        elif obstacle.shape == 'sphere':
            kind, given = bullet.GEOM_SPHERE, {'radius': float(scaled['radius'])}
        else:
            kind = bullet.GEOM_CYLINDER
            given = {'radius': float(scaled['radius']), 'height': float(scaled['length'])}
        shape = bullet.createCollisionShape(kind, **given, physicsClientId=client)
        point = np.asarray(obstacle.point) / self._length
        return self._add_body(shape, 0.0, point, _rotation(axes))

    def _add_spheres(self, start: State) -> tuple[list[int], RollingFriction | None]:
        scene, bullet, client = self.scene, self._bullet, self._client
        bodies: list[int] = []
        restitution = scene.per_sphere('restitution', len(start))
        friction = scene.per_sphere('friction', len(start))
        inertia = scene.per_sphere('inertia_factor', len(start))
        rolling = RollingFriction(
            bullet, client, bodies, scene, self._radius, self._mass, self._substep, self._gravity
        )
        bullets_own = self.settings.rolling_updates == 0
        for i in range(len(start)):
            shape = bullet.createCollisionShape(
                bullet.GEOM_SPHERE, radius=self._radius[i], physicsClientId=client
            )
            body = self._add_body(
                shape, self._mass[i], start.positions[i] / self._length, start.quaternions[i]
            )
            self._material(
                body, restitution[i], friction[i], rolling.bullets_own[i] if bullets_own else 0.0
            )
            if inertia[i] != SOLID:  # Bullet's own; it takes an inertia only with its mass
                mass, moment = self._mass[i], inertia[i] * self._mass[i] * self._radius[i] ** 2
                bullet.changeDynamics(
                    body, -1, mass=mass, localInertiaDiagonal=3 * [moment], physicsClientId=client
                )
            # Bullet's velocities live half a substep before its positions: see `_read`
            velocity = start.velocities[i] / self._length - 0.5 * self._substep * self._gravity
            bullet.resetBaseVelocity(
                body,
                velocity.tolist(),
                start.angular_velocities[i].tolist(),
                physicsClientId=client,
            )
            bodies.append(body)
        return bodies, rolling if rolling.rho.any() and not bullets_own else None

    def _velocities(self) -> Array:
        read, client = self._bullet.getBaseVelocity, self._client
        return np.array([read(body, physicsClientId=client) for body in self._bodies])

    def _read(self, change: Array) -> State:
        """State now; `change` of the velocities in the last substep, shape (n, 2, 3).

        Bullet's v += g h; x += v h is exact for free flight where v is taken to be the velocity
        half a substep before x. So half of a substep's change is added, but not that of an impact.
        """
        read, client = self._bullet.getBasePositionAndOrientation, self._client
        poses = [read(body, physicsClientId=client) for body in self._bodies]
        largest = 1.5 * np.linalg.norm(self._gravity) * self._substep
        smooth = np.linalg.norm(change[:, 0], axis=-1) <= largest
        velocities = self._velocities() + 0.5 * change * smooth[:, None, None]
        return State(
            positions=np.array([pose[0] for pose in poses]) * self._length,
            quaternions=np.array([pose[1] for pose in poses]),
            velocities=velocities[:, 0] * self._length,
            angular_velocities=velocities[:, 1],
        )


def simulate(
    scene: Scene,
    start: State,
    steps: int,
    dt: float = 0.1,
    settings: TeacherSettings = TeacherSettings(),
    done: Callable[[], object] | None = None,
) -> Trajectory:
    """Simulate `steps` steps of `dt` [s] in Bullet; index 0 of the result is the start.

    `done` is called after each step.
    """
    if steps < 0:
        raise TeacherError(f'steps is {steps}, expected 0 or more')
    with Teacher(scene, start, dt, settings) as teacher:
        states = [start]
        for _ in range(steps):
            states.append(teacher.step())
            if done is not None:
                done()
        return Trajectory.from_states(states, dt)


def _rotation(axes: Array) -> Array:
    """Quaternion (x, y, z, w) that turns x, y, z into the rows of `axes`, shape (4,)."""
    from scipy.spatial.transform import Rotation

    quaternion: Array = Rotation.from_matrix(axes.T).as_quat()
    return quaternion
