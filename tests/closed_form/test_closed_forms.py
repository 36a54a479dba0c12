# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The closed forms on Bullet, on a model, and on engines right or wrong by construction."""

from __future__ import annotations

from dataclasses import asdict
import json

import numpy as np
import pytest
from rigid_gns_core.closed_form import Check, GROUPS, laws, run_checks
from rigid_gns_core.closed_form.bounces import bounces
from rigid_gns_core.closed_form.engines import scaled
from rigid_gns_core.commands.cli import main
from rigid_gns_core.commands.closed_forms import format_checks
from rigid_gns_core.files.checkpoint import DEFAULT_MODEL
from rigid_gns_core.scenes.plane import Plane
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.scenes.state import State, Trajectory


def ballistic(restitution_error: float = 0.0):
    """Return an engine that knows one bounce on z = 0 and nothing else."""

    def simulate(scene: Scene, start: State, steps: int, dt: float) -> Trajectory:
        g, radius = -scene.gravity[2], scene.per_sphere('radius', len(start))
        t = (np.arange(steps + 1) * dt)[:, None]
        height = start.positions[:, 2] - radius
        impact = np.sqrt(2 * height / g)
        e = scene.per_sphere('restitution', len(start)) * (1 + restitution_error)
        since = np.maximum(t - impact, 0.0)
        up = e * g * impact
        hit = t > impact
        positions = np.tile(start.positions, (steps + 1, 1, 1))
        velocities = np.zeros_like(positions)
        positions[..., 2] = radius + np.where(
            hit, up * since - 0.5 * g * since**2, height - 0.5 * g * t**2
        )
        velocities[..., 2] = np.where(hit, up - g * since, -g * t)
        return Trajectory(
            positions=positions,
            velocities=velocities,
            angular_velocities=0.0 * velocities,
            quaternions=np.tile(start.quaternions, (steps + 1, 1, 1)),
            dt=dt,
        )

    return simulate


def test_bounce_measure_has_no_bias() -> None:
    restitutions, drops = np.array([0.3, 0.6, 0.9]), np.array([0.5, 10.0, 230.0])
    for error in (0.0, 0.02):
        for measured in bounces(ballistic(error), 1.0, restitutions, drops):
            expected = np.broadcast_to(restitutions[:, None, None] * (1 + error), measured.shape)
            np.testing.assert_allclose(measured, expected, rtol=1e-9)


def test_wrong_engine_fails() -> None:
    assert all(check.passed for check in run_checks(ballistic(), groups=('bounce',)))
    assert not all(check.passed for check in run_checks(ballistic(0.02), groups=('bounce',)))
    assert not Check('name', 'case', np.nan, 1.0, np.nan, 0.1).passed
    with pytest.raises(ValueError, match="unknown group of checks 'x', allowed: bounce"):
        run_checks(ballistic(), groups=('x',))


def test_table_shows_the_worst_case() -> None:
    checks = [Check('a', 'good', 1, 1, 0, 0.1), Check('a', 'bad', 2, 1, 1, 0.1)]
    of = {'radius': 1.0}
    text = format_checks([asdict(one) | of | {'passed': one.passed} for one in checks])
    assert 'FAIL  bad' in text
    assert 'good' not in text


def test_closed_forms_conserve() -> None:
    draw = np.random.default_rng(0)
    for _ in range(20):
        normal = draw.normal(size=3)
        normal /= np.linalg.norm(normal)
        velocities, spins = draw.normal(size=(2, 3)), draw.normal(size=(2, 3))
        velocities[0] -= 10.0 * normal  # they approach
        masses, radii = draw.uniform(0.5, 5.0, 2), draw.uniform(0.5, 2.0, 2)
        positions = np.outer([radii[0], -radii[1]], normal)
        for friction in (0.0, 0.1, 5.0):
            after = laws.impact_of_spheres(velocities, spins, normal, radii, masses, 0.7, friction)
            before = laws.momenta(positions, velocities, spins, masses, radii)
            for a, b in zip(before, laws.momenta(positions, *after, masses, radii), strict=True):
                np.testing.assert_allclose(a, b, atol=1e-12)
            total = [
                laws.energy(positions, *motion, masses, radii, np.zeros(3))
                for motion in ((velocities, spins), after)
            ]
            assert total[1] < total[0]
        # a second body of infinite mass at rest is a surface
        heavy = laws.impact_of_spheres(
            np.array([velocities[0], [0, 0, 0]]),
            np.array([spins[0], [0, 0, 0]]),
            normal,
            radii,
            np.array([masses[0], 1e15]),
            0.7,
            0.2,
        )
        wall = laws.impact_on_surface(velocities[0], spins[0], normal, radii[0], 0.7, 0.2)
        np.testing.assert_allclose(heavy[0][0], wall[0], atol=1e-9)
        np.testing.assert_allclose(heavy[1][0], wall[1], atol=1e-9)


@pytest.mark.parametrize('group', ['bounce', 'incline', 'level', 'oblique', 'collision', 'pile'])
def test_bullet_passes_with_single_contacts(group: str) -> None:
    pytest.importorskip('pybullet', reason='pybullet is not installed (extra: teacher)')
    from rigid_gns_core.teacher.bullet import simulate

    failed = [c for c in run_checks(simulate, quick=True, groups=(group,)) if not c.passed]
    assert not failed


def test_command_fails_where_a_check_does(tmp_path, capsys) -> None:
    pytest.importorskip('pybullet', reason='pybullet is not installed (extra: teacher)')
    file = tmp_path / 'card.json'
    # at 8 substeps per 0.1 s a bounce is off by more than 1 %
    assert main(['closed-forms', '--quick', '--substeps', '8', '--json', str(file)]) == 1
    assert 'FAIL' in capsys.readouterr().out
    card = json.loads(file.read_text())
    assert card['models']['teacher']['settings']['substeps'] == 8
    assert any(not check['passed'] for check in card['models']['teacher']['checks'])


def test_another_size_is_the_same_check() -> None:
    scene = Scene(surfaces=Plane.box(8.0, 9.0), radius=(1.0, 2.0), mass=3.0, restitution=0.6)
    start = State(positions=np.array([[0.0, 0.0, 4.0], [3.0, 0.0, 9.0]]))
    seen: list[Scene] = []

    def engine(scene: Scene, start: State, steps: int, dt: float) -> Trajectory:
        seen.append(scene)
        return ballistic()(scene, start, steps, dt)

    small = scaled(engine, 0.02)(scene, start, 30, 0.1)
    assert seen[0].radius == pytest.approx((0.02, 0.04)) and seen[0].mass == pytest.approx(2.4e-5)
    assert seen[0].surfaces[1].length_y == pytest.approx(0.02 * scene.surfaces[1].length_y)
    whole = ballistic()(scene, start, 30, 0.1)
    np.testing.assert_allclose(small.positions, whole.positions, rtol=1e-12)
    np.testing.assert_allclose(small.velocities, whole.velocities, atol=1e-12)
    assert small.dt == pytest.approx(0.1)


def test_the_default_model_passes_at_any_size(tmp_path) -> None:
    file = tmp_path / 'card.json'
    words = ['--model', DEFAULT_MODEL, '--radius', '1', '0.02', '--quick', '--json', str(file)]
    assert main(['closed-forms', *words]) == 0
    checks = json.loads(file.read_text())['models'][DEFAULT_MODEL]['checks']
    done = {(check['radius'], check['group']) for check in checks}
    assert {group for radius, group in done if radius == 1} == set(GROUPS)
    assert {group for radius, group in done if radius == 0.02} == set(GROUPS) - {'bounce'}
