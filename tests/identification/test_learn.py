# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Laws, noise and spins from synthetic tracks of a launcher whose values are known."""

from __future__ import annotations

from dataclasses import replace

from csv_balls import RADIUS, shots
from launched_balls import GIVEN, launched, NOISE, TRUE
import numpy as np
import pytest
from rigid_gns_core import Air, ContactLaw, load_simulator, Plane, Scene, UserError
from rigid_gns_core.data.tracks import Track
from rigid_gns_core.identification.coverage import fit_coverage
from rigid_gns_core.identification.first_look import shown_noise, shown_restitution
from rigid_gns_core.identification.joint_fit import JointFit
from rigid_gns_core.identification.ladder import fit_setup, Setup
from rigid_gns_core.identification.learn import _spins, learn
from rigid_gns_core.identification.left_out import Forecast
from rigid_gns_core.identification.parameters import Laws
from rigid_gns_core.identification.spins import broad_prior
from rigid_gns_core.identification.stretches import pieces, stretches
from rigid_gns_core.tracking.ball_model import BallModel
from rigid_gns_core.tracking.start_prior import StartPrior


def test_a_first_look_shows_noise_and_restitution() -> None:
    laws = Laws(GIVEN)
    found = pieces(launched(6), GIVEN, ['0'], laws.models, NOISE)
    # 850 frames, three coordinates; third differences of neighbours are not independent
    assert abs(shown_noise(found) / NOISE - 1) < 0.06
    shown = shown_restitution(laws, found, 0)
    # in air and with spin parabolas are not exact
    assert shown is not None and abs(shown - 0.93) < 0.03


def test_the_joint_fit_is_within_its_standard_errors_and_these_those_of_repeated_fits() -> None:
    """Of 6 sets of tracks with 5 parameters: normalised errors have a deviation near 1.

    The sum of their squares is chi-squared of 30 degrees: 15 to 51 but in 1 of 100 cases.
    """
    laws = Laws(GIVEN)
    laws.shown['contact 0.restitution'] = 0.92
    parameters = [laws.start_of(name) for name in TRUE]
    total = 0.0
    for seed in range(6):
        found = pieces(launched(8, seed + 10), GIVEN, ['0'], laws.models, NOISE)
        cut = stretches(found, laws.models, NOISE)
        noise = np.array([NOISE, 1e-5, 1e-3])
        fitted = JointFit(laws, cut, noise, broad_prior(0.02)).fit(parameters, {})
        # about 1 where laws and noise hold
        assert 0.8 < np.mean(fitted.losses) < 1.1
        for name, true in TRUE.items():
            total += ((fitted.values[name] - true) / fitted.errors[name]) ** 2
    assert 12.0 < total < 55.0


def test_a_joint_fit_ends_at_its_minimum_where_the_laws_are_wrong() -> None:
    """A force that no law has makes the loss large, and the way to its minimum long.

    A fit that goes on from the end of another one gains about what the last step did, less than
    0.1 of -2 log L; a third of a standard error of one parameter is worth as much.
    """
    laws = Laws(GIVEN)
    found = pieces(launched(20, 5, cross=2.0), GIVEN, ['0'], laws.models, NOISE)
    cut = stretches(found, laws.models, NOISE)
    others = ('contact 0.tangential_restitution', 'air.drag_slope', 'surface 0.tilt_x')
    names = [*TRUE, *others, 'surface 0.tilt_y', 'gravity.x', 'gravity.y', 'gravity.z']
    parameters = [laws.start_of(name) for name in names]
    fit = JointFit(laws, cut, np.array([NOISE, 1e-5, 1e-3]), broad_prior(0.02))
    first = fit.fit(parameters, {}, scan=False)
    second = fit.fit(parameters, first.values, first.starts, scan=False)
    counts = np.array([3 * len(one.times) for one in cut])
    before, after = (float(one.losses @ counts) for one in (first, second))
    assert before > 10_000
    assert before - after < 0.5


@pytest.mark.slow
def test_tracks_tell_a_scene() -> None:
    lines = []
    learned = learn(launched(12), GIVEN, ['0'], lines.append)
    told = learned.parameters
    for name, true in TRUE.items():
        assert abs(told[name].value - true) < 4 * told[name].error, name
    tracker = learned.scene.tracker
    assert tracker is not None and tracker.spins is not None
    rows = np.array(tracker.spins.windows)
    launched_rows = rows[rows[:, 0] < 0.2]
    # of 12 launches that spread by 15 and 30, each known to about 20
    np.testing.assert_allclose(launched_rows[:, 7:9].mean(axis=0), [90.0, 25.0], atol=20.0)
    assert 0.8 < tracker.noise / NOISE < 2.4  # or doubled
    # a vacuum is off by decimetres, the laws by centimetres
    assert lines[0].every['0.4'][1] > 4 * learned.table[-1].every['0.4'][1]
    assert isinstance(learned.scene.surfaces[0].contact, ContactLaw)


def test_friction_is_found_from_far_off_within_a_ladder() -> None:
    """Balls that bounce without friction, from 0.3, with which they would grip: no slope there."""
    tracks = [
        Track(f'{k}', times, places[:, None], None, ('0',))
        for k, (times, places) in enumerate(shots(6, 0.7, noise=0.5e-3))
    ]
    law = ContactLaw(restitution=0.9, friction=0.3)
    scene = Scene(surfaces=Plane(contact=law), radius=RADIUS, mass=0.0027)
    laws = Laws(scene)
    cut = stretches(pieces(tracks, scene, ['0'], laws.models, 5e-4), laws.models, 5e-4)
    setup = Setup(
        ('contact 0.restitution', 'contact 0.friction'), 'none', np.inf, (5e-4, 1e-3, 0.01)
    )
    fitted, _, unknown = fit_setup(laws, setup, cut, None)
    assert unknown == 0
    assert abs(fitted.values['contact 0.friction']) < 0.01
    assert abs(fitted.values['contact 0.restitution'] - 0.9) < 0.01


def test_coverage_widens_what_is_too_narrow() -> None:
    """Normal errors three times those that a covariance says: a spread of 9.

    The fit takes their tails to be heavier: parts of 50 and 90 % are met within 3 %.
    """
    rng = np.random.default_rng(0)
    found = [
        Forecast(0, True, 0.4, 0.4, 3.0 * rng.normal(0.0, 0.01, 3), 0, 1e-4 * np.eye(3))
        for _ in range(800)
    ]
    (spread, off, _, _), held = fit_coverage(found, np.array([1e-3, 1e-4, 0.02]))
    _, half, most = held['0.4']
    assert abs(half - 0.5) < 0.03 and abs(most - 0.9) < 0.03
    assert 5.0 < spread + (0.5 * off * 0.4**2) ** 2 / 1e-4 < 13.0


def test_coverage_holds_where_laws_are_slightly_wrong_and_some_forecasts_fail() -> None:
    """Accelerations that are off by 0.5 m/s^2, and one in twenty that is a metre off.

    Within 7 % at each of two horizons, of 400 forecasts each: 2.5 % is their standard error.
    """
    rng = np.random.default_rng(1)
    found = []
    for k in range(800):
        horizon = (0.2, 0.6)[k % 2]
        off = 0.5 * horizon**2 * rng.normal(0.0, 0.5, 3) + rng.normal(0.0, 0.005, 3)
        if k % 40 < 2:
            off += rng.normal(0.0, 1.0, 3)
        found.append(Forecast(0, True, horizon, horizon, off, 0, 0.005**2 * np.eye(3)))
    (_, off, _, _), held = fit_coverage(found, np.array([1e-3, 1e-3, 0.02]))
    assert 0.3 < off < 0.9
    for _, half, most in held.values():
        assert abs(half - 0.5) < 0.07 and abs(most - 0.9) < 0.07


def test_too_few_tracks_are_told() -> None:
    with pytest.raises(UserError, match='takes at least 4; import more tracks'):
        learn(launched(3), GIVEN, ['0'])


def test_a_fitted_law_takes_the_place_of_materials() -> None:
    given = replace(GIVEN, surfaces=Plane(restitution=0.9, friction=0.4), restitution=0.9)
    values = {'contact 0.restitution': 0.7, 'gravity.x': 0.3, 'air.drag_coefficient': 0.5}
    scene = Laws(given).scene_at(values)
    law, before = scene.surfaces[0].contact, BallModel.of(given).laws[0]
    assert law is not None and law.restitution == 0.7
    assert law.friction == before[3] and scene.surfaces[0].friction is None
    assert scene.gravity == (0.3, 0.0, -9.81)
    assert scene.air is not None and scene.air.drag_coefficient == 0.5
    rows = BallModel.of(scene)
    np.testing.assert_allclose(rows.laws, Laws(given).models_at(values)[0].laws, atol=1e-12)
    np.testing.assert_allclose(rows.ball, Laws(given).models_at(values)[0].ball, atol=1e-12)


def test_a_drag_crisis_is_found() -> None:
    """Of 12 throws of a volleyball through it, with 3 mm of noise; drag is never below 0."""
    air = Air(drag_coefficient=0.45, drag_drop=0.28, crisis_speed=9.5)
    scene = Scene(surfaces=(), radius=0.105, mass=0.27, inertia_factor=2 / 3, air=air)
    rng, simulator, tracks = np.random.default_rng(2), load_simulator(), []
    for number in range(12):
        velocity = [rng.uniform(6.0, 14.0), 0.0, rng.uniform(1.0, 5.0)]
        run = simulator.rollout(scene, [[0.0, 0.0, 2.0]], [velocity], steps=24)
        places = run.positions + rng.normal(0.0, 3e-3, run.positions.shape)
        tracks.append(Track(f'{number}', run.times, places, None, ('0',)))
    laws = Laws(replace(scene, air=None))
    found = stretches(pieces(tracks, scene, ['0'], laws.models, 3e-3), laws.models, 3e-3)
    names = ('air.drag_coefficient', 'air.drag_drop', 'air.crisis_speed')
    fit = JointFit(laws, found, np.array([3e-3, 1e-5, 1e-3]), None)
    fitted = fit.fit([laws.start_of(name) for name in names], {})
    for name, true in zip(names, (0.45, 0.28, 9.5), strict=True):
        assert abs(fitted.values[name] - true) < 4 * fitted.errors[name], name
    # of the drop's prior of 0.2, and of that of the speed of 4 m/s
    assert fitted.errors['air.drag_drop'] < 0.1 and fitted.errors['air.crisis_speed'] < 1.5
    below = laws.air_at({'air.drag_coefficient': 0.2, 'air.drag_drop': 0.5})
    assert below is not None and below.drag_drop == 0.2


def test_a_fit_has_the_restitution_that_its_scene_has() -> None:
    """One that falls with speed from beyond 1 was fitted as it is, and written as from 1."""
    laws = Laws(GIVEN)
    values = {
        'contact 0.restitution': 0.66,
        'contact 0.restitution_drop': -0.41,
        'contact 0.restitution_speed': 1.24,
    }
    fitted = laws.models_at(values)[0].laws
    np.testing.assert_array_equal(fitted, BallModel.of(laws.scene_at(values)).laws)


def test_a_scene_of_balls_that_do_not_spin_says_so() -> None:
    """Where no spin predicted best, an estimate has none, or that of rolling."""
    spins = _spins(Setup((), 'none', np.inf, (1e-3, 1e-2, 0.02)), None)
    assert spins is not None
    mean, covariance = StartPrior.of(spins).at(np.ones(3), np.array([3.0, 1.0, 0.0]))
    assert np.abs(mean).max() < 1e-12 and np.sqrt(np.trace(covariance)) < 0.1
