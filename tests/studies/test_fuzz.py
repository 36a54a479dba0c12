# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random scenes: the laws keep all properties, and engines wrong by construction break each."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from pathlib import Path
from zlib import crc32

import numpy as np
import pytest
from rigid_gns_core import load_simulator
from rigid_gns_core.commands import cli
from rigid_gns_core.scenes.plane import closest_points, Plane
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.scenes.scene_file import load_start, write_start
from rigid_gns_core.scenes.state import State, Trajectory
from rigid_gns_core.studies.fuzz import (
    Case,
    check,
    draw_case,
    Engines,
    engines_of,
    fuzz,
    KINDS,
    PROPERTIES,
    properties,
)
from rigid_gns_core.studies.fuzz.changes import changes_of, tiled
from rigid_gns_core.studies.fuzz.run import SUBSTEPS
from rigid_gns_core.studies.fuzz.scenes import cuboid, profile

LOSSLESS = {'restitution': 1.0, 'friction': 0.0, 'rolling_friction': 0.0, 'gravity': (0, 0, 0)}
TABLE = Plane((0, 0, 0), (0, 0, 1), (1, 0, 0), 6.0, 4.0)


def flight(scene: Scene, start: State, steps: int) -> Trajectory:
    """Return free flight without gravity, which is right where nothing meets."""
    times = 0.1 * np.arange(steps + 1)[:, None, None]
    return Trajectory(
        positions=start.positions + times * start.velocities,
        velocities=np.tile(start.velocities, (steps + 1, 1, 1)),
        angular_velocities=np.tile(start.angular_velocities, (steps + 1, 1, 1)),
        quaternions=np.tile(start.quaternions, (steps + 1, 1, 1)),
        dt=0.1,
    )


# two spheres above a table, so far apart that nothing meets
PASSING = Case(
    0,
    0,
    'plate',
    Scene(surfaces=TABLE, radius=1.0, **LOSSLESS),
    State(
        positions=np.array([[-2.0, 0, 5.0], [2.0, 0, 9.0]]),
        velocities=np.array([[0.3, 0, 0.1], [0.1, 0.4, 0.0]]),
    ),
    20,
)


def lost(path: Trajectory, scene: Scene) -> None:
    path.positions[7, 1] = np.nan


def windy(path: Trajectory, scene: Scene) -> None:
    path.positions[..., 0] += 1e-3 * path.times[:, None]


def first_is_slow(path: Trajectory, scene: Scene) -> None:
    path.positions[:, 0] -= 1e-3 * path.times[:, None] * path.velocities[:, 0]


def sees_seams(path: Trajectory, scene: Scene) -> None:
    if len(scene.surfaces) > 1:
        path.positions[5:, :, 2] += 1e-3


def gains(path: Trajectory, scene: Scene) -> None:
    path.velocities[12:] *= 1 + 1e-6


def loses(path: Trajectory, scene: Scene) -> None:
    path.velocities[12:] *= 1 - 1e-6


def swerves(path: Trajectory, scene: Scene) -> None:
    """Turn the velocity of one sphere, which keeps its energy."""
    path.velocities[12:, 0] = path.velocities[12:, 0, [2, 1, 0]]


def spins_up(path: Trajectory, scene: Scene) -> None:
    path.angular_velocities[12:, 0] = (0, 0, 1e-4)


def falls_through(path: Trajectory, scene: Scene) -> None:
    heights = (path.positions - TABLE.point) @ np.asarray(scene.surfaces[0].normal)
    path.positions[15:] -= 1.5 * heights[15:, :, None] * np.asarray(scene.surfaces[0].normal)


def sinks(path: Trajectory, scene: Scene) -> None:
    path.positions[-5:, 0] = np.asarray(scene.surfaces[0].point) + (0, 0, 0.9)


def meets(path: Trajectory, scene: Scene) -> None:
    path.positions[-5:, 1] = path.positions[-5:, 0] + (0, 1.8, 0)


@pytest.mark.parametrize(
    ('wrong', 'broken'),
    [
        (lambda path, scene: None, set()),
        (lost, {'finite'}),
        (windy, {'turned', 'mirrored', 'momentum'}),
        (first_is_slow, {'permuted', 'momentum'}),
        (sees_seams, {'tiled'}),
        (gains, {'energy', 'conserved', 'momentum'}),
        (loses, {'conserved', 'momentum'}),
        (swerves, {'momentum', 'turned', 'mirrored', 'permuted'}),
        (spins_up, {'momentum', 'energy', 'conserved', 'turned', 'mirrored', 'permuted'}),
    ],
)
def test_exactly_what_is_wrong_is_told(wrong, broken: set[str]) -> None:
    def simulate(scene: Scene, start: State, steps: int) -> Trajectory:
        path = flight(scene, start, steps)
        wrong(path, scene)
        return path

    assert {f.name for f in check(PASSING, Engines(simulate, simulate, simulate))} == broken


@pytest.mark.parametrize(
    ('wrong', 'broken', 'size'),
    [(falls_through, 'inside', 13.6), (sinks, 'depth', 0.1), (meets, 'depth', 0.2)],
)
def test_bodies_are_solid(wrong, broken: str, size: float) -> None:
    def simulate(scene: Scene, start: State, steps: int) -> Trajectory:
        path = flight(scene, start, steps)
        wrong(path, scene)
        return path

    failures = {f.name: f for f in check(PASSING, Engines(simulate, simulate, simulate))}
    assert failures[broken].size == pytest.approx(size, rel=0.01)
    assert 'sphere 0' in failures[broken].text


def test_a_room_and_an_endless_plane_have_no_way_out() -> None:
    still = State(positions=np.zeros((1, 3)), velocities=np.array([[3.0, 0, 0]]))
    engines = Engines(flight, flight, flight)
    for kind, planes in (
        ('room', cuboid(4, 4, 4, inside=True)),
        ('plate', Plane((3, 0, 0), (-1, 0, 0))),
    ):
        case = Case(0, 0, kind, Scene(surfaces=planes, **LOSSLESS), still, 20)
        assert 'inside' in {failure.name for failure in check(case, engines)}
    # beside a plate, and back below it, is a way around its edge
    around = np.array([[0, 0, 1.2], [3.5, 0, 0.8], [3.5, 0, -0.8], [0, 0, -1.2]])[:, None]
    path = flight(PASSING.scene, replace(still, velocities=np.array([[80.0, 0, 0]])), 3)
    case = replace(PASSING, start=still, steps=3)
    names = [
        failure.name for failure in properties.broken_laws(case, replace(path, positions=around))
    ]
    assert 'inside' not in names


@pytest.mark.parametrize('lengths', [(4.0, np.inf), (np.inf, 4.0)])
def test_behind_a_strip_is_a_place_and_through_it_is_none(lengths) -> None:
    strip = Plane((0, 0, 5.0), (0, 0, -1.0), (1, 0, 0), *lengths)
    still = State(positions=np.array([[0, 0, 6.5]]), velocities=np.zeros((1, 3)))
    case = Case(0, 0, 'strip', Scene(surfaces=strip, **LOSSLESS), still, 20)
    path = flight(case.scene, still, 20)
    assert properties.broken_laws(case, path) == []
    path.positions[10:, 0, 2] = 3.5
    assert 'inside' in {failure.name for failure in properties.broken_laws(case, path)}


def test_more_substeps_must_agree_where_many_do() -> None:
    def drifts(speed: float):
        def simulate(scene: Scene, start: State, steps: int) -> Trajectory:
            path = flight(scene, start, steps)
            return replace(path, positions=path.positions + speed * path.times[:, None, None])

        return simulate

    def names(*speeds: float) -> set[str]:
        return {f.name for f in check(PASSING, Engines(*map(drifts, speeds)))}

    assert 'substeps' in names(0.05, 0.0, 0.0)
    assert 'substeps' not in names(0.005, 0.0, 0.0)  # 1 cm
    # many substeps disagree from frame 5 on, before the default is far enough off
    assert 'substeps' not in names(0.03, 0.002, 0.0)
    fast = replace(
        PASSING, start=replace(PASSING.start, velocities=200 * PASSING.start.velocities)
    )
    failures = check(fast, Engines(drifts(0.05), flight, flight))
    assert 'substeps' not in {failure.name for failure in failures}


def test_nothing_is_compared_beyond_chaos() -> None:
    def tosses(scene: Scene, start: State, steps: int) -> Trajectory:
        path = flight(scene, start, steps)
        rng = np.random.default_rng(crc32(start.positions.tobytes()))
        path.positions[6:] += rng.normal(0.0, 1e-3, path.positions[6:].shape)
        return path

    case = replace(PASSING, scene=replace(PASSING.scene, surfaces=()))
    assert {f.name for f in check(case, Engines(tosses, flight, flight))} == {'momentum'}


def test_a_file_that_says_something_else_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not list(properties.changed_by_file(PASSING))

    def heavier(path, scene: Scene, start: State) -> None:
        write_start(path, replace(scene, mass=2.0), start)

    def slower(path, scene: Scene, start: State) -> None:
        write_start(path, scene, replace(start, velocities=0.5 * start.velocities))

    for wrong, text in ((heavier, 'the scene is another'), (slower, 'the start is another')):
        monkeypatch.setattr(properties, 'write_start', wrong)
        (failure,) = properties.changed_by_file(PASSING)
        assert failure.name == 'file' and text in failure.text


@pytest.mark.parametrize('number', range(4 * len(KINDS)))
def test_starts_overlap_nothing_and_are_drawn_by_seed_and_number(number: int) -> None:
    case = draw_case(3, number)
    assert case.kind == list(KINDS)[number % len(KINDS)]
    again = draw_case(3, number)
    assert (case.scene, case.steps) == (again.scene, again.steps)
    np.testing.assert_array_equal(case.start.velocities, again.start.velocities)
    assert case.scene != draw_case(4, number).scene
    radius = case.scene.per_sphere('radius', len(case.start))
    apart = np.linalg.norm(case.start.positions[:, None] - case.start.positions, axis=2)
    apart += np.where(np.eye(len(radius)), np.inf, 0.0) - np.add.outer(radius, radius)
    assert apart.min() >= 0
    points, heights = closest_points(case.scene.surfaces, case.start.positions)
    assert (
        np.linalg.norm(case.start.positions[:, None] - points, axis=2) > radius[:, None] - 1e-8
    ).all()
    assert not case.closed or (heights > 0).all()


def test_cases_become_more_complex() -> None:
    first, last = ([len(draw_case(0, k + n).start) for k in range(22)] for n in (0, 220))
    assert max(first) <= 2 < max(last) <= 6


def test_profiles_have_their_faces_to_the_left() -> None:
    floor, wall = profile([(0, 0), (4, 0), (4, 3)], 2.0)
    assert (floor.normal, wall.normal) == ((0, 0, 1), (-1, 0, 0))
    assert (wall.point, wall.length_x, wall.length_y) == ((4, 0, 1.5), 3, 2)
    for inside, side in ((True, -1), (False, 1)):
        for plane in cuboid(2, 4, 6, inside=inside):
            outwards = np.asarray(plane.point) / np.linalg.norm(plane.point)
            np.testing.assert_allclose(plane.normal, side * outwards)


def test_changes_leave_the_same_scene() -> None:
    case = draw_case(0, 10 * len(KINDS) - 1)  # several plates and spheres
    for change in changes_of(case):
        there = flight(change.scene, change.start, 3)
        back, here = change.back(there), flight(case.scene, case.start, 3)
        for name in ('positions', 'velocities', 'angular_velocities'):
            np.testing.assert_allclose(getattr(back, name), getattr(here, name), atol=1e-12)
        gaps = [
            np.linalg.norm(p[:, None] - closest_points(scene.surfaces, p)[0], axis=2).min(axis=1)
            for scene, p in (
                (case.scene, case.start.positions),
                (change.scene, change.start.positions),
            )
        ]
        np.testing.assert_allclose(np.sort(gaps[0]), np.sort(gaps[1]), atol=1e-12)


def test_tiles_cover_their_plate() -> None:
    strip = Plane((1, 2, 3), (0, 1, 1), (1, 0, 0), 5.0, np.inf)
    scene = tiled(Scene(surfaces=(TABLE, strip)), np.random.default_rng(0))
    assert len(scene.surfaces) > 2
    area = sum(t.length_x * t.length_y for t in scene.surfaces if np.isfinite(t.length_y))
    assert area == pytest.approx(24.0)
    assert sum(t.length_x for t in scene.surfaces if np.isinf(t.length_y)) == pytest.approx(5.0)


def test_the_laws_keep_all_properties() -> None:
    simulators = (load_simulator('laws', substeps=k) for k in SUBSTEPS)
    cases = fuzz(engines_of(load_simulator('laws'), *simulators), seed=0)
    told = [
        f'{case.number} {case.kind}: {failure}'
        for case, failures in islice(cases, 3 * len(KINDS))
        for failure in failures
    ]
    assert not told, '\n'.join(told)


def test_command_tells_what_fails_and_how_to_see_it_again(
    tmp_path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    engines = Engines(*3 * [lambda scene, start, steps: flight(scene, start, steps)])
    monkeypatch.setattr('rigid_gns_core.commands.fuzz.engines_of', lambda *_: engines)
    out = tmp_path / 'failed'
    words = ['fuzz', '--seed', '5', '--from', '9', '--cases', '1', '--out', str(out)]
    assert cli.main(words) == cli.CHECK_FAILED  # it leaves the room, or falls like nothing does
    said = capsys.readouterr()
    assert 'case 9 (room, spheres: 1): ' in said.err
    assert 'again: rigid-gns fuzz --seed 5 --from 9 --cases 1' in said.err
    kind, cases, failed = said.out.splitlines()[-1].split()[:3]
    assert (kind, cases, failed) == ('all', '1', '1')
    scene, start = load_start(out / '5_9.yaml')
    case = draw_case(5, 9)
    assert scene == case.scene
    np.testing.assert_array_equal(start.velocities, case.start.velocities)
    record = ['--steps', '2', '--out', str(tmp_path / 'a.h5')]
    assert cli.main(['rollout', '--scene', str(out / '5_9.yaml'), *record]) == 0


def test_command_goes_on_for_seconds_and_tallies_when_interrupted(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module = 'rigid_gns_core.commands.fuzz'

    def endless(*_):
        for number in range(10**9):
            yield draw_case(0, number % 3), []

    monkeypatch.setattr(f'{module}.fuzz', endless)
    assert cli.main(['fuzz', '--seconds', '1']) == 0
    assert int(capsys.readouterr().out.splitlines()[-1].split()[1]) > 3

    def interrupted(*_):
        yield draw_case(0, 0), []
        raise KeyboardInterrupt

    monkeypatch.setattr(f'{module}.fuzz', interrupted)
    assert cli.main(['fuzz']) == cli.INTERRUPTED
    said = capsys.readouterr()
    assert said.out.splitlines()[-1].split() == ['all', '1', '0']
    assert said.err.endswith('rigid-gns fuzz: interrupted\n')


def test_every_property_is_described() -> None:
    page = (Path(__file__).resolve().parents[2] / 'docs' / 'fuzzing.md').read_text(
        encoding='utf-8'
    )
    for name in (*PROPERTIES, *KINDS):
        assert f'`{name}`' in page
