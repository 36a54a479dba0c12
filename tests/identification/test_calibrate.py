# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fitted materials: closed-form bounces and slides, materials not identifiable, bad input."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rigid_gns_core.commands.calibrate import format_calibration
from rigid_gns_core.commands.cli import main
from rigid_gns_core.data.recipe import DataRecipe, recipe_hash
from rigid_gns_core.data.records import Record, record_path, write_recipe, write_record
from rigid_gns_core.files.config import from_mapping
from rigid_gns_core.identification.calibrate import _least_known, calibrate, Calibration, Fitted
from rigid_gns_core.identification.windows import windows_of, with_materials
from rigid_gns_core.prediction.laws import LawsSimulator
from rigid_gns_core.prediction.load import load_simulator
from rigid_gns_core.rollout.simulator import Simulator
from rigid_gns_core.running.progress import Progress
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.scene_file import load_scene
from rigid_gns_core.scenes.state import rotate_quaternions, Trajectory
from rigid_gns_core.tracking.pose_noise import estimate_noise, tracked_starts
import yaml

GRAVITY = 9.81
DT, STEPS = 0.1, 26
BELIEVED = Scene(restitution=0.7, friction=0.5, rolling_friction=0.02)


@pytest.fixture(scope='module')
def laws() -> Simulator:
    return load_simulator()


def heights(times: np.ndarray, drop: float, restitution: float) -> np.ndarray:
    """Of a ball that is dropped and bounces, above the ground."""
    fall = np.sqrt(2.0 * drop / GRAVITY)
    found = drop - 0.5 * GRAVITY * times**2
    begin, speed = fall, restitution * GRAVITY * fall
    for _ in range(20):
        since = times - begin
        found = np.where(since > 0, speed * since - 0.5 * GRAVITY * since**2, found)
        begin, speed = begin + 2.0 * speed / GRAVITY, restitution * speed
    return found


def dropped(restitution: float, noise: float = 0.0, seed: int = 0) -> Record:
    """Twelve balls that bounce side by side without spin: they tell restitution alone."""
    times = DT * np.arange(STEPS + 1)
    drops = np.linspace(2.0, 12.0, 12)
    places = np.zeros((STEPS + 1, 12, 3))
    places[..., 0] = 5.0 * np.arange(12)
    places[..., 2] = 1.0 + np.stack([heights(times, d, restitution) for d in drops], axis=1)
    return record(places, np.zeros_like(places), noise, seed)


def rolling(rho: float, noise: float = 0.0, seed: int = 0) -> Record:
    """Twelve balls that roll without slipping and slow down by rho g / 1.4."""
    times = DT * np.arange(STEPS + 1)[:, None]
    speeds = np.linspace(3.0, 10.0, 12)
    path = speeds * times - 0.5 * rho * GRAVITY / 1.4 * times**2
    places = np.zeros((STEPS + 1, 12, 3))
    places[..., 0], places[..., 1], places[..., 2] = path, 5.0 * np.arange(12), 1.0
    turns = np.zeros_like(places)
    turns[..., 1] = path  # about y, by the path over a radius of 1 m
    return record(places, turns, noise, seed)


def record(places: np.ndarray, turns: np.ndarray, noise: float, seed: int) -> Record:
    rng = np.random.default_rng(seed)
    quaternions = rotate_quaternions(np.tile([0.0, 0.0, 0.0, 1.0], (*places.shape[:2], 1)), turns)
    if turns.any():
        quaternions = rotate_quaternions(quaternions, rng.normal(0.0, noise, places.shape))
    places = places + rng.normal(0.0, noise, places.shape)
    trajectory = Trajectory.from_poses(places, quaternions, DT)
    return Record(trajectory=trajectory, scene=BELIEVED, seed=0, name=f'record {seed}')


@pytest.mark.parametrize(
    ('restitution', 'noise', 'bound'),
    # a speed of 10 m/s after a bounce is known to noise / (sqrt(2) 0.1 s): 0.007 m/s for 1 mm, of
    # each of some ten balls; without noise the model's own law is left, 1e-3
    [(0.64, 0.0, 2e-3), (0.9, 1e-3, 4e-3), (0.5, 5e-3, 1e-2)],
)
def test_restitution_of_bounces_is_found(
    laws: Simulator, restitution: float, noise: float, bound: float
) -> None:
    records = [dropped(restitution**2, noise, seed) for seed in range(2)]
    found = calibrate(laws, records, names=['restitution'])
    assert found.materials['restitution'].told
    assert found.values['restitution'] == pytest.approx(restitution, abs=bound)
    before, after = found.position_error
    assert after < before, 'what noise leaves in a start stays'


def test_rolling_friction_is_found(laws: Simulator) -> None:
    records = [rolling(0.05, 1e-3, seed) for seed in range(2)]
    found = calibrate(laws, records, names=['rolling_friction'])
    # 0.001 more slows by 7 mm/s^2: 1.3 mm in 0.6 s, where noise of 1 mm in poses and starts is
    # 5 mm in each of 96 ways and as much in rotations
    assert found.values['rolling_friction'] == pytest.approx(0.05, abs=1.5e-3)
    assert found.materials['rolling_friction'].told


def test_materials_that_are_not_identifiable_are_kept_and_named(
    laws: Simulator, capsys: pytest.CaptureFixture[str]
) -> None:
    """Balls that drop without spin never slide nor roll."""
    found = calibrate(laws, [dropped(0.64)])
    assert found.values['restitution'] == pytest.approx(0.8, abs=3e-3)
    for name, value in (('friction', 0.5), ('rolling_friction', 0.02)):
        one = found.materials[name]
        assert (one.told, one.value) == (False, value)


def test_surfaces_of_their_own(laws: Simulator) -> None:
    """The product of ball and ground is all that bounces on the ground tell."""
    found = calibrate(laws, [dropped(0.56)], names=['surface_restitution'])
    assert 0.7 * found.values['surface_restitution'] == pytest.approx(0.56, abs=3e-3)
    scene = with_materials(BELIEVED, found.values)
    assert scene.restitution == 0.7
    assert scene.surfaces[0].restitution == found.values['surface_restitution']


def test_of_a_product_one_factor_is_kept(laws: Simulator) -> None:
    """Balls that meet the ground alone tell the product: no factor may pass for known."""
    names = ['restitution', 'surface_restitution']
    found = calibrate(laws, [dropped(0.448)], names=names)
    ball, ground = (found.materials[name] for name in names)
    assert (ground.told, ground.value) == (False, 0.7)
    assert ball.told and 0.7 * ball.value == pytest.approx(0.448, abs=3e-3)


@pytest.mark.parametrize(
    ('errors', 'least'),
    [
        ({}, None),
        ({'restitution': 0.09, 'friction': 0.14}, None),
        ({'restitution': 0.114, 'surface_restitution': 0.146}, 'surface_restitution'),
        ({'restitution': 0.146, 'surface_restitution': 0.114}, 'restitution'),
        ({'friction': 0.2, 'rolling_friction': 0.03}, 'rolling_friction'),  # 1.3 and 1.5 times
        ({'restitution': np.inf, 'surface_restitution': np.inf}, 'surface_restitution'),
    ],
)
def test_the_least_known_material_goes_first(errors: dict, least: str | None) -> None:
    assert _least_known(errors) == least


def test_starts_are_exact_in_flight_and_not_trusted_at_a_bounce() -> None:
    record = dropped(0.64)
    trajectory = record.trajectory
    noise = estimate_noise([(trajectory.times, trajectory.positions, trajectory.quaternions)])
    assert noise.position < 1e-6 and noise.rotation is None
    starts = tracked_starts(
        trajectory.positions, trajectory.quaternions, DT, np.array([0.0, 0.0, -GRAVITY]), noise
    )
    assert not starts.trusted[[0, -1]].any()
    ball = 11  # dropped from 12 m, meets the ground after 1.564 s
    flight = slice(1, 15)
    np.testing.assert_allclose(
        starts.velocities[flight, ball, 2], -GRAVITY * trajectory.times[flight], atol=1e-9
    )
    assert starts.trusted[flight, ball].all()
    assert not starts.trusted[15:17, ball].any()
    assert starts.trusted[17:-1, ball].all()


@pytest.mark.parametrize(
    ('model', 'arguments', 'message'),
    [
        ('gns', {}, "model 'gns' is a gns, which takes no materials.*train --from"),
        ('laws', {'names': ['colour']}, "unknown material 'colour', allowed: restitution"),
        ('laws', {'names': []}, '0 materials, 1 records'),
        ('laws', {'steps': 40}, 'no window of 40 steps .* has 26 steps, and .* needs 41'),
    ],
)
def test_bad_input_is_named(model: str, arguments: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        calibrate(load_simulator(model), [dropped(0.64)], **arguments)


def test_another_time_step_is_refused(laws: Simulator) -> None:
    other = dropped(0.64)
    slow = Trajectory.from_poses(other.trajectory.positions, other.trajectory.quaternions, 0.05)
    record = Record(trajectory=slow, scene=BELIEVED, seed=0, name='slow')
    with pytest.raises(ValueError, match="record 'slow' has a time step of 0.05 s, but .* 0.1 s"):
        calibrate(laws, [record])


def test_windows_share_no_tracked_frame() -> None:
    windows = windows_of([dropped(0.64)], 6)
    assert len(windows) == 4
    ends = [window.positions[-1] for window in windows[:-1]]
    starts = [window.start.positions for window in windows[1:]]
    for end, start in zip(ends, starts, strict=True):
        np.testing.assert_array_equal(end, start)


def record_order(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """List to which each compilation and each begin of a progress is added."""
    order: list[str] = []
    warm_up, begin = LawsSimulator.warm_up, Progress.__init__
    monkeypatch.setattr(LawsSimulator, 'warm_up', lambda s: (warm_up(s), order.append('compiled')))
    monkeypatch.setattr(
        Progress, '__init__', lambda *a, **k: (begin(*a, **k), order.append('begun'))[0]
    )
    return order


def test_the_command_writes_a_scene(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    recipe = from_mapping(
        DataRecipe,
        {'trajectories': 1, 'seed': 0, 'steps': STEPS, 'spheres': [12, 12], 'box_side': [0, 100]},
    )
    data, out = tmp_path / 'data', tmp_path / 'lab.yaml'
    one = dropped(0.64)
    marked = Record(**{**vars(one), 'recipe': recipe_hash(recipe)})
    write_record(record_path(data, 0), marked, 'poses')
    write_recipe(data, recipe)
    words = ['calibrate', '--data', str(data), '--out', str(out), '--fit', 'restitution']
    numbers = tmp_path / 'new' / 'folder' / 'numbers.json'
    order = record_order(monkeypatch)  # the time that is left must not count the compiler
    assert main([*words, '--json', str(numbers)]) == 0
    assert order == ['compiled', 'begun']
    printed = capsys.readouterr().out
    assert 'restitution of two spheres 0.64, of a sphere and a surface 0.64' in printed
    assert numbers.is_file()
    assert load_scene(out).restitution == pytest.approx(0.8, abs=3e-3)
    assert set(yaml.safe_load(out.read_text())) == {'scene'}
    assert main(words) == 2
    assert 'exists' in capsys.readouterr().err


def test_values_of_pairs_use_the_materials_of_the_surfaces() -> None:
    own = (Plane(restitution=0.5), Plane(point=(0.0, 0.0, 9.0), normal=(0.0, 0.0, -1.0)))
    one = Fitted(value=0.9, error=0.01, before=0.8, told=True)
    found = Calibration({'restitution': one}, (9, 1), 6, {}, (0.2, 0.1))
    text = format_calibration(found, Scene(surfaces=own, restitution=0.9))
    assert 'restitution of two spheres 0.81, of a sphere and a surface 0.45 or 0.81' in text
    text = format_calibration(found, Scene(surfaces=(), restitution=0.9))
    assert 'of two spheres 0.81\n' in text


def test_materials_of_a_scene() -> None:
    scene = Scene(surfaces=(Plane(friction=0.9),), restitution=(0.5, 0.6))
    changed = with_materials(scene, {'restitution': 0.8, 'friction': 0.4})
    assert changed.restitution == 0.8
    assert changed.surfaces[0].friction == 0.9, 'a surface with a value of its own keeps it'
