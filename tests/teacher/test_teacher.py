# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The Bullet teacher: state in, state out, and what it refuses."""

from __future__ import annotations

from dataclasses import asdict
import sys

import numpy as np
import pytest
from rigid_gns_core import Air, ContactLaw, load_simulator, Obstacle
from rigid_gns_core.data.records import demo_record
from rigid_gns_core.scenes.plane import seen_from_behind
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.state import State
from rigid_gns_core.teacher.bullet import load_pybullet, simulate, Teacher
from rigid_gns_core.teacher.rolling import resist_rolling
from rigid_gns_core.teacher.settings import TeacherError, TeacherSettings

GRAVITY = 9.81


@pytest.fixture
def bullet():
    return pytest.importorskip('pybullet', reason='pybullet is not installed (extra: teacher)')


def spheres(positions, velocities=None, spins=None, quaternions=None) -> State:
    given = {'velocities': velocities, 'angular_velocities': spins, 'quaternions': quaternions}
    arrays = {name: np.array(value) for name, value in given.items() if value is not None}
    return State(positions=np.array(positions, dtype=np.float64), **arrays)


def scattered(count: int = 30, seed: int = 0) -> State:
    draw = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(*[np.arange(-7.5, 8.0, 3.0)] * 2), -1).reshape(-1, 2)[:count]
    return State(
        positions=np.c_[grid, draw.uniform(2.0, 6.0, count)],
        velocities=draw.normal(0.0, 3.0, (count, 3)),
        angular_velocities=draw.normal(0.0, 2.0, (count, 3)),
    )


def test_same_start_same_bytes(bullet) -> None:
    scene = Scene(surfaces=Plane.box(20.0, 20.0))
    first, second = (simulate(scene, scattered(), 15) for _ in range(2))
    for name in ('positions', 'quaternions', 'velocities', 'angular_velocities'):
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes()


def test_teachers_do_not_disturb_each_other(bullet) -> None:
    scene = Scene(surfaces=Plane.box(20.0, 20.0))
    alone = simulate(scene, scattered(), 5)
    with Teacher(scene, scattered()) as one, Teacher(Scene(radius=0.3), scattered(5, 1)) as two:
        for _ in range(5):
            one.step()
            two.step()
    assert np.array_equal(one.state.positions, alone.positions[-1])


def test_free_flight_is_exact(bullet) -> None:
    velocity, spin = np.array([3.0, 1.0, 2.0]), np.array([0.0, 4.0, 0.0])
    start = spheres([[0.0, 0.0, 50.0]], velocities=[velocity], spins=[spin])
    run = simulate(Scene(), start, 20)
    t = run.times[:, None]
    fall = np.array([0.0, 0.0, -GRAVITY])
    # float64 over 1920 substeps
    np.testing.assert_allclose(
        run.positions[:, 0], start.positions[0] + velocity * t + 0.5 * fall * t**2, atol=1e-10
    )
    np.testing.assert_allclose(run.velocities[:, 0], velocity + fall * t, atol=1e-10)
    half = 0.5 * spin[1] * run.times[-1]
    turned = run.quaternions[-1, 0] * np.sign(run.quaternions[-1, 0, 3]) * np.sign(np.cos(half))
    np.testing.assert_allclose(turned, [0.0, np.sin(half), 0.0, np.cos(half)], atol=1e-6)


def test_start_is_kept_as_given(bullet) -> None:
    quaternion = np.array([0.1, 0.2, 0.3, 0.9])
    quaternion /= np.linalg.norm(quaternion)
    start = spheres([[0.0, 0.0, 9.0]], quaternions=[quaternion])
    with Teacher(Scene(), start) as teacher:
        assert teacher.state is start
        np.testing.assert_allclose(teacher.step().quaternions, start.quaternions, atol=1e-12)


def test_properties_are_per_sphere(bullet) -> None:
    scene = Scene(
        surfaces=(Plane(restitution=1.0),),
        radius=(0.5, 1.0, 2.0),
        mass=(1.0, 5.0, 100.0),
        restitution=(0.2, 0.5, 0.9),
    )
    places = np.array([[0.0, 0.0, 3.5], [10.0, 0.0, 4.0], [20.0, 0.0, 5.0]])
    run = simulate(scene, spheres(places), 9)
    impact, speed = np.sqrt(2 * 3.0 / GRAVITY), np.sqrt(2 * 3.0 * GRAVITY)
    expected = np.array([0.2, 0.5, 0.9]) * speed - GRAVITY * (0.9 - impact)
    # 0.01 m/s is one substep of gravity
    np.testing.assert_allclose(run.velocities[-1, :, 2], expected, atol=0.03)


def test_surface_materials_multiply(bullet) -> None:
    surfaces = (
        Plane((-10.0, 0.0, 0.0), length_x=10.0, length_y=10.0, restitution=0.5),
        Plane((10.0, 0.0, 0.0), length_x=10.0, length_y=10.0, restitution=1.0),
    )
    run = simulate(
        Scene(surfaces=surfaces, restitution=0.8),
        spheres([[-10.0, 0.0, 4.0], [10.0, 0.0, 4.0]]),
        9,
    )
    impact, speed = np.sqrt(2 * 3.0 / GRAVITY), np.sqrt(2 * 3.0 * GRAVITY)
    expected = np.array([0.4, 0.8]) * speed - GRAVITY * (0.9 - impact)
    np.testing.assert_allclose(run.velocities[-1, :, 2], expected, atol=0.03)


def test_sphere_rolls_off_the_end_of_a_finite_plane(bullet) -> None:
    plane = Plane((0.0, 0.0, 10.0), length_x=10.0, length_y=10.0)
    start = spheres(
        positions=[[0.0, 0.0, 11.0], [0.0, 3.0, 11.0]],
        velocities=[[4.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
        spins=[[0.0, 4.0, 0.0], [0.0, 0.0, 0.0]],
    )
    run = simulate(Scene(surfaces=(plane,), rolling_friction=0.0), start, 25)
    on = run.times < 1.2  # the edge is reached after 5 m at 4 m/s
    np.testing.assert_allclose(run.positions[on, 0, 2], 11.0, atol=1e-4)
    assert run.positions[-1, 0, 2] < 6.0
    still = run.positions[:, 1] - start.positions[1]
    np.testing.assert_allclose(still, 0.0, atol=1e-4)


def test_strip_of_infinite_length(bullet) -> None:
    angle = np.radians(20.0)
    normal = (np.sin(angle), 0.0, np.cos(angle))
    strip = Plane(normal=normal, direction=(1.0, 0.0, 0.0), length_y=6.0)
    far = 300.0 * strip.axes[0]
    start = spheres([np.asarray(normal) + far, np.asarray(normal) + 5.0 * strip.axes[1]])
    run = simulate(Scene(surfaces=(strip,), rolling_friction=0.0), start, 20)
    travelled = np.linalg.norm(run.positions[-1, 0] - run.positions[0, 0])
    assert travelled == pytest.approx(0.5 * GRAVITY * np.sin(angle) / 1.4 * 4.0, rel=0.01)
    assert run.positions[-1, 1, 2] < -10.0  # beside the strip there is nothing


@pytest.mark.parametrize('normal', [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])
def test_both_faces_of_a_strip_bounce_and_bear(bullet, normal) -> None:
    strip = Plane((0.0, 0.0, 5.0), normal, (1.0, 0.0, 0.0), 20.0)
    start = spheres(
        [[0.0, 0.0, 6.0], [0.0, 50.0, 2.0], [14.0, 0.0, 4.0]],
        velocities=[[0.0, 0.0, 0.0], [0.0, 0.0, 12.0], [0.0, 0.0, 12.0]],
    )
    run = simulate(Scene(surfaces=strip, restitution=1.0), start, 20)
    # the back is 1e-3 radii behind the front
    np.testing.assert_allclose(run.positions[:, 0, 2], 6.0, atol=2e-3)
    under, beside = run.positions[:, 1, 2], run.positions[:, 2, 2]
    assert under.max() < 4.0 + 0.1  # a substep of 240 at 10 m/s is 0.004 m
    energy = 0.5 * run.velocities[:, 1, 2] ** 2 + GRAVITY * under
    # the impact is found a substep late, below a height that it should not reach
    np.testing.assert_allclose(energy, energy[0], rtol=1e-3)
    flight = 4.0 + 12.0 * run.times - 0.5 * GRAVITY * run.times**2
    np.testing.assert_allclose(beside, flight, atol=1e-9)


def test_a_strip_below_its_back_is_a_fence_from_both_sides(bullet) -> None:
    fence = Plane(direction=(0.0, 0.0, 1.0), normal=(1.0, 0.0, 0.0), length_x=4.0)
    start = spheres(
        [[3.0, 0.0, 0.0], [-3.0, 9.0, 0.0], [-3.0, 18.0, 3.5]],
        velocities=[[-30.0, 5.0, 0.0], [30.0, 5.0, 0.0], [30.0, 5.0, 0.0]],
    )
    scene = Scene(surfaces=fence, gravity=0.0, restitution=1.0, friction=0.0)
    last = simulate(scene, start, 5).velocities[-1]
    expected = [[30.0, 5.0, 0.0], [-30.0, 5.0, 0.0], [30.0, 5.0, 0.0]]
    np.testing.assert_allclose(last, expected, atol=5e-3)  # Bullet's normal of the back leans


def test_walls_of_a_box_are_thick_and_a_fence_is_not(bullet) -> None:
    box = Plane.box(20.0, 20.0)
    fence = Plane((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), 2.0)
    surfaces = (*box, fence)
    inside, outside = [(5.0, 0.0, 3.0)], [(-15.0, 0.0, 3.0)]
    assert seen_from_behind(box, inside).tolist() == [False] * 5
    assert seen_from_behind(Plane.box(20.0, 20.0, 8.0), inside).tolist() == [False] + [True] * 4
    assert seen_from_behind(surfaces, inside).tolist() == [False] * 5 + [True]
    assert seen_from_behind(box, outside).tolist() == [False, True, False, False, False]
    tiles = [Plane((x, 0.0, 0.0), length_x=10.0, length_y=20.0) for x in (-5.0, 5.0)]
    assert not seen_from_behind((*tiles, *box[1:]), inside).any()


def test_fast_sphere_does_not_pass_a_wall(bullet) -> None:
    start = spheres([[0.0, 0.0, 5.0]], velocities=[[200.0, 130.0, 0.0]])
    run = simulate(Scene(surfaces=Plane.box(20.0, 20.0), restitution=0.9), start, 20)
    # at 200 m/s a substep is 0.2 m, by so much an impact may be late
    assert np.abs(run.positions[..., :2]).max() < 9.0 + 0.3


@pytest.mark.parametrize('degrees', [0.0, 30.0, 45.0])
def test_rolling_friction_has_no_direction(bullet, degrees: float) -> None:
    angle = np.radians(degrees)
    heading = np.array([np.cos(angle), np.sin(angle), 0.0])
    start = spheres(
        positions=[[0.0, 0.0, 0.02]],
        velocities=[0.7 * heading],
        spins=[35.0 * np.cross([0.0, 0.0, 1.0], heading)],
    )
    # mass and radius must not matter either
    run = simulate(Scene(radius=0.02, mass=250.0, rolling_friction=0.05), start, 40, 0.0141)
    slower = (0.7 - np.linalg.norm(run.velocities[-1, 0])) / run.times[-1]
    assert slower == pytest.approx(0.05 * GRAVITY / 1.4, rel=0.01)
    path = run.positions[-1, 0] - run.positions[0, 0]
    assert np.linalg.norm(np.cross(path, heading)) < 1e-6


def test_a_blow_on_a_standing_sphere_has_no_rolling_friction_between_spheres(bullet) -> None:
    # rolling friction acts on surfaces, so what strikes from above spins off as without any;
    # between the spheres, Bullet's own took a fifth of that spin
    start = spheres([[0.0, 0.0, 1.0], [0.0, -0.8, 6.0]], velocities=[[0.0, 0, 0], [0.0, 0, -20]])
    spins = []
    for rolling in (0.0, 0.03):
        scene = Scene(surfaces=(Plane(),), friction=0.5, rolling_friction=rolling)
        end = simulate(scene, start, 4)[-1]
        spins.append(end.angular_velocities[1, 0])
    assert abs(spins[0]) > 5.0
    assert spins[1] == pytest.approx(spins[0], rel=1e-6)  # nothing else differs for that sphere


def test_slow_sphere_never_falls_asleep(bullet) -> None:
    start = spheres(
        positions=[[0.0, 0.0, 1.0]], velocities=[[0.01, 0.0, 0.0]], spins=[[0.0, 0.01, 0.0]]
    )
    run = simulate(Scene(rolling_friction=0.0), start, 60)
    assert run.positions[-1, 0, 0] == pytest.approx(0.06, rel=1e-3)


def test_thousand_spheres(bullet) -> None:
    grid = np.stack(np.meshgrid(*[np.arange(10) * 2.5] * 3), -1).reshape(-1, 3) + [0.0, 0.0, 2.0]
    run = simulate(Scene(), spheres(grid), 1, settings=TeacherSettings(substeps=4))
    np.testing.assert_allclose(run.positions[-1, :, 2], grid[:, 2] - 0.5 * GRAVITY * 0.01)


def test_resist_rolling_never_reverses() -> None:
    normal = np.array([[0.0, 0.0, 1.0]] * 2)
    velocities = np.array([[0.01, 0.0, 0.0], [1.0, 0.0, 0.0]])
    spins = np.array([[0.0, 0.01, 0.02], [0.0, -3.0, 0.0]])  # the second slips
    one, value = np.ones(2), np.full(2, 0.1)
    left = resist_rolling(velocities, spins, one, normal, one, value, one, np.full(2, 0.4), 1e-6)
    np.testing.assert_allclose(left.velocities, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], atol=1e-15)
    np.testing.assert_allclose(left.angular_velocities, [[0, 0, 0], [0, -2.75, 0]], atol=1e-15)
    assert left.stopped.tolist() == [True, False]


def test_hollow_spheres_roll_as_they_do(bullet) -> None:
    slope = np.radians(10.0)
    plane = Plane(normal=(np.sin(slope), 0.0, np.cos(slope)), friction=1.0)
    for inertia in (0.4, 2 / 3):
        for rho in (0.0, 0.05):
            scene = Scene(
                surfaces=(plane,), friction=1.0, rolling_friction=rho, inertia_factor=inertia
            )
            run = simulate(scene, spheres([plane.normal]), 10)
            speed = run.velocities[-1, 0] @ [np.cos(slope), 0.0, -np.sin(slope)]
            down = GRAVITY * (np.sin(slope) - rho * np.cos(slope)) / (1.0 + inertia)
            assert speed == pytest.approx(down, rel=2e-3)  # as the group `incline`


@pytest.mark.parametrize(
    ('given', 'what'),
    [
        ({'air': Air()}, 'air'),
        ({'sphere_contact': ContactLaw()}, 'a contact law'),
        ({'surfaces': Plane(contact=ContactLaw())}, 'a contact law'),
        ({'surfaces': Plane(velocity=(1.0, 0.0, 0.0))}, 'a surface that moves'),
    ],
)
def test_what_bullet_has_not_is_refused(given: dict, what: str) -> None:
    with pytest.raises(TeacherError, match=f'the scene has {what}, which this teacher has not'):
        simulate(Scene(**given), spheres([[0.0, 0.0, 3.0]]), 1)


def test_missing_pybullet_tells_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'pybullet', None)
    with pytest.raises(ModuleNotFoundError, match='Bullet teacher needs pybullet.*pip install'):
        load_pybullet()


def test_bad_input_is_named(bullet) -> None:
    start = spheres([[0.0, 0.0, 3.0]])
    with pytest.raises(TeacherError, match='substeps of the teacher is 0'):
        TeacherSettings(substeps=0)
    with pytest.raises(TeacherError, match='contact_erp of the teacher is 2'):
        TeacherSettings(contact_erp=2.0)
    with pytest.raises(TeacherError, match='no sphere'):
        Teacher(Scene(), State(positions=np.zeros((0, 3))))
    with pytest.raises(TeacherError, match='dt is -1'):
        simulate(Scene(), start, 1, dt=-1.0)
    with pytest.raises(TeacherError, match='steps is -1'):
        simulate(Scene(), start, -1)
    with pytest.raises(ValueError, match='mass is given for 2 spheres, but there are 1'):
        simulate(Scene(mass=(1.0, 2.0)), start, 1)
    teacher = Teacher(Scene(), start)
    teacher.close()
    teacher.close()
    with pytest.raises(TeacherError, match='closed'):
        teacher.step()


def test_the_shipped_record_was_made_with_the_default_settings():
    made_with = demo_record().teacher
    defaults = asdict(TeacherSettings())
    assert {name: made_with[name] for name in defaults} == defaults


@pytest.mark.parametrize(
    ('obstacle', 'place'),
    [
        (Obstacle('sphere', (0.3, 0.0, 1.0), radius=2.0), (0.9, 0.2, 5.0)),
        (Obstacle('box', (0.3, 0.0, 1.0), (0.4, 0.1, 1.0), size=(3.0, 4.0, 2.0)), (0.5, 0.2, 5.0)),
        (
            Obstacle('cylinder', (0.3, 0.0, 1.0), (0.0, 1.0, 0.2), radius=2.0, length=6.0),
            (0.9, 0.2, 5.0),
        ),
    ],
    ids=lambda of: getattr(of, 'shape', ''),
)
def test_obstacles_are_those_of_the_laws(bullet, obstacle, place) -> None:
    scene = Scene(surfaces=(), obstacles=(obstacle,), restitution=0.8, rolling_friction=0.0)
    start, settings = spheres([place]), TeacherSettings(substeps=960)
    run = simulate(scene, start, 12, settings=settings)
    laws = load_simulator('laws').rollout(scene, steps=12, **vars(start))
    assert np.abs(laws.velocities[-1, 0, :2]).max() > 0.5  # it was struck aside
    # Bullet finds an impact up to a substep late: 0.1 ms at 5 m/s
    np.testing.assert_allclose(run.positions, laws.positions, atol=5e-3)


def test_rings_are_refused(bullet) -> None:
    scene = Scene(obstacles=(Obstacle('ring', radius=1.0),))
    with pytest.raises(TeacherError, match='the scene has a ring, which this teacher has not'):
        Teacher(scene, spheres([(0, 0, 2)]))
