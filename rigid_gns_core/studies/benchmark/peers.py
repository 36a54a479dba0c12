# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The peers: Bullet, MuJoCo, Rapier, Jolt, LAMMPS, the thesis' GNS and the laws."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from importlib import metadata
from typing import Any, Protocol, TypeVar
import warnings

import numpy as np

from .bullet_engine import BulletSpheres
from .jolt_engine import JoltSettings, JoltSpheres
from .lammps_engine import describe as describe_lammps
from .lammps_engine import LammpsSpheres, load_lammps
from .mujoco_engine import describe, load_mujoco, MujocoSettings, MujocoSpheres
from .rapier_engine import RapierSettings, RapierSpheres
from .scenes import FRAME
from ...errors import UserError
from ...files.checkpoint import LAWS
from ...prediction.load import load_simulator
from ...rollout.simulator import Simulator
from ...scenes.scene import Scene
from ...scenes.state import Array, State
from ...teacher.bullet import load_pybullet
from ...teacher.settings import TeacherSettings

BULLET_SUBSTEPS = (1, 2, 3, 6, 12, 24, 48, 96)
MUJOCO_SUBSTEPS = (6, 12, 24, 48)
GAME_SUBSTEPS = (1, 2, 6, 12, 24)
LAWS_SUBSTEPS = (1, 2, 4, 8, 16)
BULLET_ITERATIONS = 10

_Settings = TypeVar('_Settings')
"""Iterations of Bullet's solver: errors as with the teacher's 50, and up to twice as fast."""


class Run(Protocol):
    """A running simulation of a scene."""

    def advance(self) -> Array:
        """Advance by `FRAME`; the centres after it [m], shape (n, 3).

        Raises:
            FloatingPointError: The simulation diverged.
        """
        ...

    def close(self) -> None:
        """Free what it holds."""
        ...


@dataclass(frozen=True)
class Peer:
    """A simulator at one setting.

    Args:
        name: Unique name in the table.
        family: Family, whose peers form one line of a chart.
        label: Label of its point in a chart: the setting.
        start: Begins a scene; raises UserError where it does not support the scene.
        settings: Settings for the report.
    """

    name: str
    family: str
    label: str
    start: Callable[[Scene, State], Run]
    settings: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class PeerSet:
    """The peers of a run.

    Args:
        peers: Peers in the order of the table.
        absent: Families that are not installed, with the reason.
        notes: Notes on the families.
    """

    peers: tuple[Peer, ...]
    absent: dict[str, str]
    notes: dict[str, str]


NOTES = {
    'Bullet': 'maximal coordinates, its own rolling friction, positions read once per frame; '
    'otherwise the settings of the teacher',
    'MuJoCo': 'has no coefficient of restitution: the damping ratio of its contacts is set to the '
    'closed form for the restitution of each pair; its planes are infinite',
    'Rapier': 'a game engine, in a process of its own; it has no rolling friction here',
    'Jolt': 'a game engine, in a process of its own; it has no rolling friction',
    'LAMMPS': 'granular spheres as springs, of finite stiffness; boxes of one material, without '
    'rolling friction; not made for few spheres',
    'GNS': "the thesis' network; trained on one material, not on those of the other scenes",
    'laws': 'the laws of contact; the number is their substeps K, by default 8',
}


def all_peers(
    families: Iterable[str] | None = None,
    *,
    quick: bool = False,
    bullet_iterations: int = BULLET_ITERATIONS,
) -> PeerSet:
    """The peers, family by family.

    Args:
        families: Families to include; None: all.
        quick: Whether to take few settings.
        bullet_iterations: Iterations of Bullet's solver.

    Raises:
        UserError: A family is unknown; the message lists the known ones.
    """
    makers: dict[str, Callable[[], list[Peer]]] = {
        'Bullet': lambda: _bullet((2, 6) if quick else BULLET_SUBSTEPS, bullet_iterations),
        'MuJoCo': lambda: _mujoco((12,) if quick else MUJOCO_SUBSTEPS),
        'Rapier': lambda: _rapier((6,) if quick else GAME_SUBSTEPS),
        'Jolt': lambda: _jolt((6,) if quick else GAME_SUBSTEPS),
        'LAMMPS': _lammps,
        'GNS': _gns,
        'laws': lambda: _laws((8,) if quick else LAWS_SUBSTEPS),
    }
    wanted = list(makers) if families is None else list(dict.fromkeys(families))
    if unknown := sorted(set(wanted) - set(makers)):
        raise UserError(f'unknown peer {unknown[0]!r}, known: {", ".join(makers)}')
    peers: list[Peer] = []
    absent: dict[str, str] = {}
    for family in (name for name in makers if name in wanted):
        try:
            peers += makers[family]()
        except ModuleNotFoundError as error:
            absent[family] = str(error)
    return PeerSet(tuple(peers), absent, {name: NOTES[name] for name in makers if name in wanted})


def warm_up(peers: Iterable[Peer]) -> None:
    """Run a few steps of each peer, so that compiling and loading are not timed."""
    start = State(positions=np.array([[0.0, 0.0, 1.05], [0.1, 0.0, 3.1], [0.0, 2.5, 1.0]]))
    for peer in peers:
        run = peer.start(Scene(), start)
        for _ in range(3):
            run.advance()
        run.close()


def _bullet(substeps: tuple[int, ...], iterations: int) -> list[Peer]:
    load_pybullet()
    version = metadata.version('pybullet')

    def described(settings: TeacherSettings) -> dict[str, Any]:
        return {'engine': 'pybullet', 'version': version, **asdict(settings)}

    def at(count: int) -> Peer:
        settings = TeacherSettings(substeps=count, solver_iterations=iterations, rolling_updates=0)
        return _at('Bullet', count, BulletSpheres, settings, described)

    return [at(count) for count in substeps]


def _mujoco(substeps: tuple[int, ...]) -> list[Peer]:
    load_mujoco()
    return [_at('MuJoCo', n, MujocoSpheres, MujocoSettings(n), describe) for n in substeps]


def _rapier(substeps: tuple[int, ...]) -> list[Peer]:
    kind = RapierSpheres
    return [_at(kind.peer, n, kind, RapierSettings(n), kind.describe) for n in substeps]


def _jolt(substeps: tuple[int, ...]) -> list[Peer]:
    kind = JoltSpheres
    return [_at(kind.peer, n, kind, JoltSettings(n), kind.describe) for n in substeps]


def _at(
    family: str,
    substeps: int,
    run: Callable[[Scene, State, float, _Settings], Run],
    settings: _Settings,
    described: Callable[[_Settings], dict[str, Any]],
) -> Peer:
    """A simulator at so many substeps."""

    def start(scene: Scene, state: State) -> Run:
        return run(scene, state, FRAME, settings)

    return Peer(f'{family} {substeps}', family, str(substeps), start, described(settings))


def _lammps() -> list[Peer]:
    load_lammps()

    def start(scene: Scene, state: State) -> Run:
        return LammpsSpheres(scene, state, FRAME)

    return [Peer('LAMMPS', 'LAMMPS', '', start, describe_lammps())]


class OwnSpheres:
    """A rollout of a simulator of this package, with the interface of `Run`.

    Raises:
        UserError: The model does not support the scene, or has frames of another length.
    """

    def __init__(self, simulator: Simulator, scene: Scene, start: State) -> None:
        if abs(simulator.native_dt(scene) - FRAME) > 1e-9:
            raise UserError(
                f'frames of {simulator.name!r} are {simulator.native_dt(scene):g} s here, not '
                f'{FRAME:g} s; the scenes of the benchmark have spheres of 1 m'
            )
        given = (scene, start.positions, start.velocities, start.angular_velocities)
        with warnings.catch_warnings():
            warnings.simplefilter(
                'ignore'
            )  # of materials outside the training range: in the notes
            self._rollout = simulator.start(*given, quaternions=start.quaternions)

    def advance(self) -> Array:
        """Advance by a frame; the centres after it [m], shape (n, 3)."""
        return self._rollout.step().positions

    def close(self) -> None:
        """Free what it holds."""
        del self._rollout


def _own(simulator: Simulator) -> Callable[[Scene, State], Run]:
    def start(scene: Scene, state: State) -> Run:
        return OwnSpheres(simulator, scene, state)

    return start


def _gns() -> list[Peer]:
    simulator = load_simulator('gns')
    settings = {'model': 'gns', 'weights_sha256': simulator.card['weights_sha256']}
    return [Peer('GNS', 'GNS', '', _own(simulator), settings)]


def _laws(substeps: tuple[int, ...]) -> list[Peer]:
    peers = []
    for count in substeps:
        simulator = load_simulator(LAWS, substeps=count)
        name = f'{LAWS} {count}'
        peers.append(Peer(name, LAWS, str(count), _own(simulator), simulator.card))
    return peers
