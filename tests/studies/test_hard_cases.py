# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The hard cases, and what is measured of engines that are wrong by construction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import warnings

import numpy as np
import pytest
from rigid_gns_core.commands.cli import main
from rigid_gns_core.errors import UserError
from rigid_gns_core.files.strict_json import read_json
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.state import State, Trajectory
from rigid_gns_core.studies.hard_cases import Case, Engine, hard_cases, measure_laws, run_cases
from rigid_gns_core.studies.hard_cases.cases import QUICK_STEPS
from rigid_gns_core.studies.hard_cases.checks import failures, measure_errors
from rigid_gns_core.studies.hard_cases.table import format_summary, format_table

CASES = {case.name: case for case in hard_cases(quick=True)}
DT = 0.1


def made(case: Case, move: Callable[[np.ndarray], np.ndarray]) -> Trajectory:
    """Return the start plus `move(times)` [m], shape (steps + 1, n or 1, 3); all at rest."""
    times = DT * np.arange(case.steps + 1)
    positions = case.start.positions + move(times)
    return Trajectory(
        positions=positions,
        velocities=np.zeros_like(positions),
        angular_velocities=np.zeros_like(positions),
        quaternions=np.tile(case.start.quaternions, (case.steps + 1, 1, 1)),
        dt=DT,
    )


def upwards(height: np.ndarray) -> np.ndarray:
    """Return the same height [m] for all spheres, as `made` takes it."""
    return height[:, None, None] * np.array([0.0, 0.0, 1.0])


def frozen(scene: Scene, start: State, steps: int) -> Trajectory:
    return made(Case('', '', scene, start, steps), lambda t: upwards(0.0 * t))


def ballistic(scene: Scene, start: State, steps: int) -> Trajectory:
    flight = made(Case('', '', scene, start, steps), lambda t: upwards(-0.5 * 9.81 * t**2))
    flight.velocities[..., 2] = -9.81 * flight.times[:, None]
    return flight


def climbing(scene: Scene, start: State, steps: int) -> Trajectory:
    return made(Case('', '', scene, start, steps), lambda t: upwards(0.01 * t))


def lost(scene: Scene, start: State, steps: int) -> Trajectory:
    trajectory = frozen(scene, start, steps)
    trajectory.positions[7:] = np.nan
    return trajectory


@pytest.mark.parametrize(
    ('simulate', 'name', 'wrong'),
    [
        (frozen, 'tower', []),
        (frozen, 'overlap_air', []),
        (frozen, 'half_below', []),
        (frozen, 'centre_below', ['inside']),  # it has to come back
        (ballistic, 'incline_edge', ['inside']),
        (ballistic, 'wedge', ['inside', 'drift']),
        (climbing, 'tower', ['energy_rise', 'drift']),
        (climbing, 'radius_ratio', ['energy_rise']),
        (lost, 'tower', ['finite']),
        (lost, 'heap', ['finite']),
    ],
)
def test_exactly_what_is_wrong_is_flagged(simulate, name: str, wrong: list[str]) -> None:
    (row,) = run_cases([Engine('engine', simulate, 'given')], [CASES[name]])
    assert row['failed'] == wrong
    assert row['verdict'] == ('FAILED' if wrong else 'ok')
    assert row['laws']['escaped'] == (len(CASES[name].start) if 'inside' in wrong else 0)
    assert row['laws']['diverged_at'] == (7 if 'finite' in wrong else None)


def test_velocities_are_those_given_or_those_of_poses() -> None:
    case = CASES['tower']
    trajectory = made(case, lambda t: upwards(0.0 * t))
    trajectory.velocities[50:, 3, 0] = 2.0  # 2 J that no pose tells of
    rise = measure_laws(case, trajectory, velocities='given')['energy_rise']
    assert rise == pytest.approx(2.0 / (8 * 9.81))
    assert measure_laws(case, trajectory, velocities='poses')['energy_rise'] == 0
    with pytest.raises(ValueError, match="velocities is 'both'"):
        measure_laws(case, trajectory, velocities='both')  # type: ignore[arg-type]
    with pytest.raises(ValueError, match='99 steps of 8 spheres'):
        measure_laws(case, trajectory.window(0, 100))


def test_the_push_out_of_the_first_step_is_no_energy_rise() -> None:
    case = CASES['half_below']
    first = made(case, lambda t: upwards(1.0 * (t > 0)))
    later = made(case, lambda t: upwards(0.4 * (t > 0) + 0.6 * (t > 1.05)))
    laws = measure_laws(case, first)
    assert (laws['push_out'], laws['energy_rise']) == pytest.approx((1.0, 0.0), abs=1e-12)
    laws = measure_laws(case, later)
    assert (laws['push_out'], laws['energy_rise']) == pytest.approx((0.4, 0.6))
    first.velocities[1:, 0, 2] = 1.0  # pushed out with a kick: only the kick counts
    assert measure_laws(case, first)['energy_rise'] == pytest.approx(0.5 / 9.81)
    # where nothing overlaps at the start, nothing is forgiven
    assert measure_laws(replace(case, overlaps=False), first)['energy_rise'] > 1.0


def test_depth_and_drift_are_of_the_second_half() -> None:
    case = CASES['tower']
    early = made(case, lambda t: upwards(-0.3 * ((t > 1) & (t < 3))))
    assert measure_laws(case, early)['deepest'] < 1e-12
    late = made(case, lambda t: upwards(-0.3 * ((t > 6) & (t < 7)) - 0.1 * (t > 8)))
    laws = measure_laws(case, late)
    assert (laws['deepest'], laws['final_depth']) == pytest.approx((0.15, 0.05))
    assert laws['drift'] == pytest.approx(0.3)
    assert measure_laws(replace(case, rests=False), late)['drift'] is None


def test_depth_is_judged_where_a_case_bounds_it() -> None:
    case = CASES['heavy_column']
    assert case.deepest == 5e-3  # 1e-2 radii
    for depth, wrong in ((0.009, []), (0.011, ['deepest'])):
        sinks = made(case, lambda t, depth=depth: upwards(-depth * (t > 6)))
        engine = Engine('sinks', lambda *_, sinks=sinks: sinks, 'given')
        (row,) = run_cases([engine], [replace(case, rests=False)])
        assert row['failed'] == wrong
        assert ('!' in format_table([row]).splitlines()[2]) == bool(wrong)
    free = replace(case, deepest=None, rests=False)
    assert failures(measure_laws(free, made(free, lambda t: upwards(-0.4 * (t > 6))))) == []


def test_a_sphere_around_an_edge_has_not_escaped() -> None:
    case = CASES['plane_end']
    # over the edge at x = 5 and then down; or down through the plane
    over = made(
        case, lambda t: np.outer(np.minimum(t, 3.0), [3.0, 0, 0])[:, None] + upwards(-9 * (t > 4))
    )
    assert measure_laws(case, over)['escaped'] == 0
    through = made(case, lambda t: upwards(-9.0 * (t > 4)))
    assert measure_laws(case, through)['escaped'] == 2  # one begins above the edge itself


def test_no_corner_of_a_closed_box_is_a_way_out() -> None:
    case = CASES['elastic']
    trajectory = frozen(case.scene, case.start, case.steps)
    for aim, escaped in (((8.0, 8.0, 8.0), 1), ((0.0, 0.0, 14.0), 2)):
        trajectory.positions[50:, escaped] = aim
        assert measure_laws(case, trajectory)['escaped'] == escaped
    assert failures(measure_laws(case, trajectory))[0] == 'inside'


def test_errors_are_over_the_floor_of_the_teacher() -> None:
    case = replace(CASES['tower'], steps=40)
    truth, near, far, wrong = (
        made(case, lambda t, a=a: np.outer(t, [a, 0.0, 0.0])[:, None])
        for a in (0.0, 0.001, 0.05, -0.3)
    )
    errors = measure_errors(case, wrong, [truth, near, far])
    assert errors is not None and list(errors) == ['10', '30']
    assert list(errors['30'].values()) == pytest.approx([0.9, 0.15, 1.8])
    errors = measure_errors(case, wrong, [truth, near, near])
    assert errors is not None
    assert list(errors['10'].values()) == pytest.approx([0.3, 0.001, 0.6])
    blown = made(case, lambda t: upwards(1.0 * t))
    assert measure_errors(case, wrong, [truth, near, blown]) is None
    errors = measure_errors(case, lost(case.scene, case.start, 40), [truth, near, far])
    assert errors is not None and errors['10']['ratio'] == np.inf


def test_refusals_breaks_and_warnings() -> None:
    def refuses(scene: Scene, start: State, steps: int) -> Trajectory:
        raise UserError('one radius only')

    def breaks(scene: Scene, start: State, steps: int) -> Trajectory:
        raise FloatingPointError('a solver gave up')

    def warns(scene: Scene, start: State, steps: int) -> Trajectory:
        warnings.warn('the rollout diverged: step 3', stacklevel=1)
        warnings.warn('friction is new', stacklevel=1)
        return frozen(scene, start, steps)

    engines = [Engine(e.__name__, e) for e in (refuses, breaks, warns)]
    rows = list(run_cases(engines, [CASES['corner']]))
    assert [row['verdict'] for row in rows] == ['refused', 'FAILED', 'FAILED']
    assert rows[0]['refused'] == 'one radius only' and rows[0]['laws'] is None
    assert rows[1]['failed'] == rows[2]['failed'] == ['finite']
    text = format_table(rows)
    assert 'refused' in text and 'one radius only' in text
    assert 'no!' in text and '(3) friction is new' in text and 'ratio' not in text
    assert 'breaks: 0 ok, 1 FAILED, 0 refused (corner)' in format_summary(rows)


@pytest.mark.parametrize('name', CASES)
def test_cases_start_as_described(name: str) -> None:
    case = CASES[name]
    depth = measure_laws(case, frozen(case.scene, case.start, case.steps))['deepest']
    assert (depth > 0.1) == case.overlaps
    assert case.overlaps or depth < 1e-9
    for plane in case.enclosing:
        heights = (case.start.positions - plane.point) @ np.asarray(plane.normal)
        assert (heights > 0).all() or case.overlaps
    assert case.enclosing
    assert case.steps <= QUICK_STEPS
    assert case.text and '\n' not in case.text


def test_half_spaces_enclose_and_walls_of_a_room_do_where_the_case_says_so() -> None:
    strip = Plane((0.0, 0.0, 5.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), 4.0)
    below = State(positions=np.array([[0.0, 0.0, 1.0]]))
    case = Case('strip', '', Scene(surfaces=(Plane(), strip)), below, 4)
    assert case.enclosing == (Plane(),)
    assert measure_laws(case, frozen(case.scene, case.start, 4))['inside']
    assert len(CASES['tower'].enclosing) == 5


def test_cases_are_chosen_by_name_and_seed() -> None:
    assert [case.name for case in hard_cases(['long', 'tower'])] == ['tower', 'long']
    assert hard_cases(['long'])[0].steps == 20_000
    (one,), (other,) = hard_cases(['elastic'], seed=1), hard_cases(['elastic'], seed=2)
    assert one.seed == 1 and not np.array_equal(one.start.velocities, other.start.velocities)
    with pytest.raises(ValueError, match="unknown case 'towr', known: cubes, tower"):
        hard_cases(['towr'])
    with pytest.raises(ValueError, match='steps of case'):
        Case('short', '', Scene(), State(positions=np.ones((1, 3))), 1)


def test_what_the_cases_are_about_is_there() -> None:
    gaps = np.diff(CASES['tower'].start.positions[:, 2])
    assert np.array_equal(gaps, np.full(7, 2.0))
    cube = CASES['cubes'].start.positions[:27]
    between = np.linalg.norm(cube[:, None] - cube, axis=2)
    assert np.count_nonzero(between == 2.0) == 2 * 54  # every neighbour touches exactly
    mixed = CASES['radius_ratio'].scene
    assert max(mixed.radius) / min(mixed.radius) == pytest.approx(5.0)
    assert max(mixed.mass) / min(mixed.mass) == pytest.approx(125.0)
    assert CASES['plane_end'].start.positions[1, 0] == 5.0  # the edge, exactly
    assert len(CASES['elastic'].enclosing) == 6
    for name in ('room_6', 'room_12', 'room_40'):
        assert CASES[name].closed and len(CASES[name].start) == 7
    seams = CASES['seams'].scene.surfaces[:25]
    assert sum(s.length_x * s.length_y for s in seams) == pytest.approx(15.0**2)  # no gap
    column = CASES['heavy_column'].scene.mass
    assert np.all(np.diff(column) > 0) and max(column) / min(column) == 1e5


def test_command_writes_all_numbers(tmp_path, capsys) -> None:
    file = tmp_path / 'report.json'
    words = ['--model', 'gns', '--cases', 'half_below', 'heavy_on_light', '--no-teacher']
    code = main(['hard-cases', *words, '--quick', '--json', str(file)])
    report = read_json(file)
    first, second = report['rows']
    assert second['verdict'] == 'refused' and 'mass differs' in second['refused']
    assert first['velocities'] == 'poses' and first['dt'] == 0.1 and first['errors'] is None
    assert first['failed'] == failures(first['laws'])
    assert code == 0  # only the default model is judged
    assert report['thresholds']['energy_rise'] == 1e-4 and report['version']
    assert report['cases']['half_below']['steps'] == 60
    assert 'mass differs' in capsys.readouterr().out


@pytest.mark.parametrize(('simulate', 'code'), [(frozen, 0), (climbing, 1)])
def test_only_the_default_model_decides_the_exit_code(simulate, code: int, monkeypatch) -> None:
    monkeypatch.setattr(
        'rigid_gns_core.commands.hard_cases.load_engine',
        lambda name, *_: Engine(name, simulate, 'given'),
    )
    words = ['hard-cases', '--cases', 'tower', '--no-teacher']
    assert main(words) == code
    assert main([*words, '--model', 'another']) == 0


def test_the_teacher_is_kept_in_the_cache(tmp_path, monkeypatch) -> None:
    pytest.importorskip('pybullet', reason='pybullet is not installed (extra: teacher)')
    from rigid_gns_core.studies import chaos_floor as module
    from rigid_gns_core.studies.chaos_floor import References
    from rigid_gns_core.studies.hard_cases.engines import teacher_engine
    from rigid_gns_core.teacher.settings import TeacherSettings

    settings = TeacherSettings(substeps=12)
    engines = [teacher_engine(settings), Engine('frozen', frozen, 'given')]
    case = CASES['corner']
    fresh = list(run_cases(engines, [case], References(settings, tmp_path)))
    own = fresh[0]['errors']['30']
    assert own['error'] == own['ratio'] == 0 and own['floor'] > 0
    assert fresh[1]['errors']['10']['ratio'] > 3
    assert 'ratio' in format_table(fresh)

    def never(*_: object) -> Trajectory:
        raise AssertionError('it is in the cache')

    monkeypatch.setattr(module, 'bullet', never)
    assert list(run_cases(engines, [case], References(settings, tmp_path))) == fresh
    other = CASES['half_below']
    with pytest.raises(AssertionError, match='in the cache'):  # another start is another file
        References(settings, tmp_path).of('corner', other.scene, other.start, 10, DT)
    for path in tmp_path.glob('*.npz'):
        path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(OSError, match='damaged, delete it'):
        list(run_cases(engines, [case], References(settings, tmp_path)))
