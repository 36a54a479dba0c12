# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""MuJoCo as a peer: spheres on planes, at the settings that were best in this benchmark.

MuJoCo has no coefficient of restitution: contacts are springs with dampers. The damping ratio for
a restitution e is known in closed form, so that each surface gets that of its pair with a sphere.
docs/benchmark.md says how the settings were chosen.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from importlib import metadata
from types import ModuleType
from typing import Any, Literal

import numpy as np

from .plain_scene import check_plain, common_values
from ...installation.extras import needed
from ...scenes.scene import Scene
from ...scenes.state import Array, State


@dataclass(frozen=True)
class MujocoSettings:
    """Settings of MuJoCo.

    Args:
        substeps: Steps of MuJoCo per frame.
        solver: Constraint solver.
        integrator: Integrator; both give the same here, as only contact forces depend on velocity.
        iterations: Largest number of iterations of the solver in a substep.
        tolerance: Improvement, scaled as MuJoCo does, below which the solver stops.
        stiffness: Inverse angular frequency of a contact spring [substeps]; below about 1.5 the
            substeps do not resolve a bounce.
        impedance: MuJoCo's solimp at zero and at full depth.
    """

    substeps: int = 24
    solver: Literal['Newton', 'CG'] = 'CG'
    integrator: Literal['Euler', 'implicitfast'] = 'Euler'
    iterations: int = 10
    tolerance: float = 1e-4
    stiffness: float = 1.5
    impedance: tuple[float, float] = (0.9, 0.95)


def load_mujoco() -> ModuleType:
    """Import mujoco.

    Raises:
        ModuleNotFoundError: It is not installed; the message says how to install it.
    """
    module: ModuleType = needed('mujoco', 'the peer MuJoCo')
    return module


class MujocoSpheres:
    """A live MuJoCo scene that is advanced frame by frame.

    Args:
        scene: Surfaces, infinite for MuJoCo, and properties, the same for all spheres.
        start: State at time 0.
        dt: Length of a frame [s].
        settings: Settings of MuJoCo.

    Raises:
        UserError: MuJoCo cannot express the scene.
        ModuleNotFoundError: mujoco is not installed.
    """

    def __init__(
        self, scene: Scene, start: State, dt: float, settings: MujocoSettings = MujocoSettings()
    ) -> None:
        self._mujoco = load_mujoco()
        self._substeps = settings.substeps
        text = _model(scene, start, dt / settings.substeps, settings)
        self._model = self._mujoco.MjModel.from_xml_string(text)
        self._data = self._mujoco.MjData(self._model)
        self.place(start)

    def place(self, state: State) -> None:
        """Put the spheres where they are in a state."""
        # v += g h; x += v h is exact in flight if v is that of half a substep before x
        early = state.velocities - 0.5 * self._model.opt.timestep * self._model.opt.gravity
        poses = np.concatenate([state.positions, np.roll(state.quaternions, 1, axis=1)], axis=1)
        self._data.qpos[:] = poses.ravel()
        # MuJoCo takes the spin in the body frame
        spins = _unturned(state.quaternions, state.angular_velocities)
        self._data.qvel[:] = np.concatenate([early, spins], axis=1).ravel()

    def advance(self) -> Array:
        """Advance by a frame; the centres after it [m], shape (n, 3).

        Raises:
            FloatingPointError: MuJoCo failed.
        """
        try:
            self._mujoco.mj_step(self._model, self._data, self._substeps)
        except self._mujoco.FatalError as error:
            raise FloatingPointError(f'MuJoCo gave up: {error}') from error
        positions: Array = self._data.qpos.reshape(-1, 7)[:, :3].copy()
        return positions

    def state(self) -> State:
        """State now; its velocities are those of the instant."""
        from scipy.spatial.transform import Rotation

        quaternions = np.roll(self._data.qpos.reshape(-1, 7)[:, 3:], -1, axis=1)
        moving = self._data.qvel.reshape(-1, 6)
        early = 0.5 * self._model.opt.timestep * self._model.opt.gravity
        spins = Rotation.from_quat(quaternions).apply(moving[:, 3:])
        positions = self._data.qpos.reshape(-1, 7)[:, :3]
        return State(
            positions=positions,
            quaternions=quaternions,
            velocities=moving[:, :3] + early,
            angular_velocities=spins,
        )

    def close(self) -> None:
        """Free MuJoCo's memory."""
        del self._model, self._data


class MujocoSamples:
    """Many starts of one scene, rolled out at once by `mujoco.rollout`.

    Args:
        scene: As of `MujocoSpheres`.
        starts: Fields of shape (s, n, k).
        dt: Length of a frame [s].
        settings: Settings of MuJoCo.
        threads: Threads, each with data of its own.
    """

    def __init__(
        self, scene: Scene, starts: State, dt: float, settings: MujocoSettings, threads: int
    ) -> None:
        mujoco, self._substeps = load_mujoco(), settings.substeps
        states = [
            State(**{name: values[i] for name, values in vars(starts).items()})
            for i in range(len(starts.positions))
        ]
        one, kind = (
            MujocoSpheres(scene, states[0], dt, settings),
            mujoco.mjtState.mjSTATE_FULLPHYSICS,
        )
        self._model = one._model
        self._starts = np.empty((len(states), mujoco.mj_stateSize(self._model, kind)))
        for state, values in zip(states, self._starts, strict=True):
            one.place(state)
            mujoco.mj_getState(self._model, one._data, values, kind)
        self._data = [mujoco.MjData(self._model) for _ in range(threads)]

    def roll(self, frames: int) -> Array:
        """Centres of the first sphere after so many frames [m], shape (s, 3)."""
        from mujoco.rollout import rollout

        states, _ = rollout(
            self._model, self._data, self._starts, nstep=frames * self._substeps,
            persistent_pool=True,
        )  # fmt: skip
        places: Array = states[:, -1, 1:4]  # after the time
        return places


def describe(settings: MujocoSettings) -> dict[str, Any]:
    """Settings for the report, with engine, version and friction cone."""
    return {
        'engine': 'mujoco',
        'version': metadata.version('mujoco'),
        'cone': 'elliptic',
        **asdict(settings),
    }


def damping_ratio(restitution: float) -> float:
    """Damping ratio of a spring-damper contact with this restitution."""
    if restitution <= 0.0:
        return 1.0
    log = float(np.log(restitution))
    return -log / float(np.hypot(np.pi, log))


def _model(scene: Scene, start: State, substep: float, settings: MujocoSettings) -> str:
    check_plain('MuJoCo', scene, start)
    names = ('radius', 'mass', 'restitution', 'friction', 'rolling_friction')
    values = common_values('MuJoCo', scene, len(start), *names)
    radius, rolling = values['radius'], values['rolling_friction'] * values['radius']
    lines = [
        '<mujoco>',
        # refsafe would soften contacts to at least two substeps; a reset would hide an instability
        f'<option {_option(scene, substep, settings)}>',
        '<flag autoreset="disable" refsafe="disable"/>',
        '</option>',
        '<size memory="1G"/>',  # an upper bound, for scenes of many contacts
        '<worldbody>',
    ]
    contact = _contact(values['restitution'] ** 2, substep, settings)
    restitution = scene.surface_values('restitution') * values['restitution']
    friction = scene.surface_values('friction') * values['friction']
    for index, plane in enumerate(scene.surfaces):
        point = ' '.join(map(str, plane.point))
        axis = ' '.join(map(str, plane.normal))
        # MuJoCo takes the larger friction of a pair, unless one geom has a higher priority
        lines.append(
            f'<geom type="plane" size="0 0 1" pos="{point}" zaxis="{axis}" priority="1" condim="6"'
            f' friction="{friction[index]} {rolling} {rolling}"'
            f' {_contact(restitution[index], substep, settings)}/>'
        )
    # spheres do not resist each other's rolling
    sphere = (
        f'<freejoint/><geom type="sphere" size="{radius}" mass="{values["mass"]}" condim="3"'
        f' friction="{values["friction"] ** 2} 0 0" {contact}/>'
    )
    lines += [f'<body>{sphere}</body>'] * len(start)
    return '\n'.join([*lines, '</worldbody>', '</mujoco>'])


def _option(scene: Scene, substep: float, settings: MujocoSettings) -> str:
    return (
        f'timestep="{substep!r}" gravity="{" ".join(map(str, scene.gravity))}" cone="elliptic" '
        f'jacobian="sparse" solver="{settings.solver}" integrator="{settings.integrator}" '
        f'iterations="{settings.iterations}" tolerance="{settings.tolerance!r}"'
    )


def _contact(restitution: float, substep: float, settings: MujocoSettings) -> str:
    ratio = damping_ratio(restitution)
    time = settings.stiffness * substep / ratio
    low, high = settings.impedance
    return f'solref="{time!r} {ratio!r}" solimp="{low} {high} 0.001 0.5 2"'


def _unturned(quaternions: Array, vectors: Array) -> Array:
    """World vectors in the frames of bodies, shape (n, 3)."""
    from scipy.spatial.transform import Rotation

    turned: Array = Rotation.from_quat(quaternions).inv().apply(vectors)
    return turned
