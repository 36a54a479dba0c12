# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""`rigid-gns render` and `view`: outlines, shadows, times and messages."""

from __future__ import annotations

from pathlib import Path
import sys

import numpy as np
import pytest
from rigid_gns_core.commands import cli, Plane, Scene
from rigid_gns_core.scenes.state import rotate_quaternions, Trajectory
from rigid_gns_core.show import Comparison
from rigid_gns_core.show.render.camera import Camera
from rigid_gns_core.show.render.movie import Film, frames, poses_at, PREDICTED
from rigid_gns_core.show.render.picture import draw, Image, linear, rotation_matrices, Surroundings

pytest.importorskip('PIL', reason='pictures are labelled by Pillow')

from .test_report import record, trajectory

UPRIGHT = np.array([[0.0, 0.0, 0.0, 1.0]])
LOW, HIGH = np.full(3, -3.0), np.full(3, 3.0)
SIZE = 120


def picture(scene: Scene, positions: np.ndarray, camera: Camera) -> Image:
    colours = np.array([linear('#ff2020'), linear('#2020ff')])[: len(positions)]
    surroundings = Surroundings.of(scene, LOW, HIGH)
    turns = np.tile(UPRIGHT, (len(positions), 1))
    radii = np.ones(len(positions))
    return draw(camera, surroundings, positions, turns, radii, colours, width=SIZE, height=SIZE)


def above(height: float = 40.0) -> Camera:
    """Look down from `height` [m]; up in the picture is y, and it is 12 m high on the ground."""
    axes = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]])
    return Camera(np.array([0.0, 0.0, height]), axes, 6.0 / height)


def red(image: Image) -> np.ndarray:
    image = image.astype(float)
    return image[..., 0] > 1.5 * image[..., 2]


def test_a_sphere_has_its_outline_where_it_belongs() -> None:
    image = picture(Scene(surfaces=()), np.array([[2.0, 1.0, 0.0]]), above())
    rows, columns = np.nonzero(red(image))
    metres = 12.0 / SIZE
    assert (columns.mean() + 0.5 - SIZE / 2) * metres == pytest.approx(2.0, abs=0.02)
    assert (SIZE / 2 - rows.mean() - 0.5) * metres == pytest.approx(1.0, abs=0.02)
    # pixels that the outline cuts are red or not: half a pixel along all of it
    assert len(rows) * metres**2 == pytest.approx(np.pi, abs=np.pi * metres)


def test_the_nearer_sphere_hides_the_other() -> None:
    behind = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 5.0]])
    assert not red(picture(Scene(surfaces=()), behind, above())).any()
    nearer = red(picture(Scene(surfaces=()), behind[::-1], above()))
    assert nearer[SIZE // 2 - 5 : SIZE // 2 + 5, SIZE // 2 - 5 : SIZE // 2 + 5].all()


def test_spheres_and_slabs_throw_shadows() -> None:
    def darkness(scene: Scene, positions: np.ndarray) -> float:
        image = picture(scene, positions, above()).astype(float)
        return float((image.max(axis=2) < 190).mean())

    ground = Scene(surfaces=(Plane(),))
    far = np.array([[500.0, 500.0, 1.0]])
    assert darkness(ground, far) == 0.0
    sphere = np.array([[0.0, 0.0, 3.0]])
    empty = darkness(Scene(surfaces=()), sphere)
    # the shadow of a sphere is at least a disc of its radius; the sphere hides part of it
    assert darkness(ground, sphere) - empty > 0.5 * np.pi / 144
    slab = Plane((0.0, 0.0, 4.0), length_x=2.0, length_y=2.0)
    assert darkness(Scene(surfaces=(Plane(), slab)), far) > 2.0 / 144


def test_surfaces_are_seen_from_the_front_only() -> None:
    sphere = np.array([[0.0, 0.0, 0.0]])
    lid = Plane((0.0, 0.0, 3.0), (0.0, 0.0, -1.0), length_x=8.0, length_y=8.0)
    assert red(picture(Scene(surfaces=(lid,)), sphere, above())).any()
    floor = Plane((0.0, 0.0, 3.0), length_x=8.0, length_y=8.0)
    assert not red(picture(Scene(surfaces=(floor,)), sphere, above())).any()


def test_the_camera_sees_the_whole_box() -> None:
    low, high = np.array([-5.0, 2.0, 0.0]), np.array([9.0, 30.0, 4.0])
    up = np.array([0.0, 0.0, 1.0])
    camera = Camera.around(low, high, up, azimuth=20.0, elevation=40.0, aspect=1.5)
    corners = np.stack(np.meshgrid(*np.stack([low, high], axis=1)), axis=-1).reshape(-1, 3)
    x, y, z = ((corners - camera.eye) @ camera.axes.T).T
    farthest = max(np.abs(x / z).max() / (1.5 * camera.slope), np.abs(y / z).max() / camera.slope)
    assert farthest == pytest.approx(1.0)
    np.testing.assert_allclose(camera.axes @ camera.axes.T, np.eye(3), atol=1e-12)
    assert camera.eye[0] > high[0] and camera.axes[2] @ up < 0  # from +x, downwards


def test_rotations_are_those_of_the_states() -> None:
    turned = rotate_quaternions(UPRIGHT, np.array([[0.0, 0.0, np.pi / 2]]))
    np.testing.assert_allclose(rotation_matrices(turned)[0] @ [1, 0, 0], [0, 1, 0], atol=1e-12)


def test_poses_between_frames() -> None:
    moving = trajectory()
    positions, quaternions = poses_at(moving, 0.25)
    np.testing.assert_allclose(positions[:, 0], 0.25)
    wanted = rotate_quaternions(UPRIGHT, np.array([[0.0, 0.0, 0.5]]))
    np.testing.assert_allclose(quaternions[:1], wanted, atol=1e-4)
    np.testing.assert_allclose(poses_at(moving, 99.0)[0], moving.positions[-1])
    one = Trajectory.from_poses(moving.positions[:1], moving.quaternions[:1], 0.1)
    np.testing.assert_allclose(poses_at(one, 0.0)[0], moving.positions[0])


def test_the_reference_is_left_and_the_prediction_right() -> None:
    scene = Scene(surfaces=Plane.box(20.0, 20.0))
    comparison = Comparison(title='', scene=scene, predicted=trajectory(), reference=trajectory())
    image = next(frames(comparison, Film(width=240, height=120))).astype(float)[30:]
    blue = image[..., 2] > 1.5 * image[..., 0]
    assert blue[:, 120:].any() and not blue[:, :120].any()
    assert linear(PREDICTED)[2] > linear(PREDICTED)[0]


@pytest.mark.parametrize('suffix', ['gif', 'webp', 'mp4'])
def test_films_are_written(suffix: str, tmp_path: Path) -> None:
    if suffix == 'mp4':
        pytest.importorskip('imageio_ffmpeg', reason="pip install 'rigid_gns_ros[render]'")
    source, out = record(tmp_path / 'a.h5'), tmp_path / f'a.{suffix}'
    options = ['--size', '96', '64', '--fps', '5', '--stop', '1', '--out', str(out)]
    assert cli.main(['render', str(source), *options]) == 0
    if suffix != 'mp4':
        from PIL import Image as Pillow

        with Pillow.open(out) as film:
            assert (film.size, film.n_frames) == ((96, 64), 6)
    else:
        import imageio_ffmpeg

        assert imageio_ffmpeg.count_frames_and_secs(str(out))[0] == 6


@pytest.mark.parametrize(
    ('options', 'text'),
    [
        (['--out', 'a.avi'], 'ends with .mp4, .gif, .webp'),
        (['--out', 'a.gif', '--size', '97', '64'], 'width is 97 pixels'),
        (['--out', 'a.gif', '--start', '9'], 'the trajectory has 2 s'),
        (['--out', 'a.gif', '--elevation', '90'], 'elevation is 90 degrees'),
        (['--out', 'a.gif', '--fps', '0'], 'fps is 0'),
    ],
)
def test_bad_films_are_refused(
    options: list[str],
    text: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    record(Path('one.h5'))
    assert cli.main(['render', 'one.h5', *options]) == 2
    assert text in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ['one.h5']


@pytest.mark.parametrize(
    ('command', 'module', 'extra'),
    [
        (['render', 'one.h5', '--out', 'a.mp4'], 'imageio_ffmpeg', 'render'),
        (['view', 'one.h5', '--save', 'a.rrd'], 'rerun', 'viz'),
    ],
)
def test_what_is_not_installed_is_named(
    command: list[str],
    module: str,
    extra: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, module, None)
    record(Path('one.h5'))
    assert cli.main(command) == 2
    assert f"pip install 'rigid_gns_ros[{extra}]'" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ['one.h5']


def test_a_comparison_goes_to_rerun(tmp_path: Path) -> None:
    pytest.importorskip('rerun', reason="pip install 'rigid_gns_ros[viz]'")
    ours = record(tmp_path / 'a.h5', 1.1, engine='rigid_gns', model='laws')
    other, out = record(tmp_path / 'b.h5', engine='pybullet'), tmp_path / 'c.rrd'
    assert cli.main(['view', str(ours), '--reference', str(other), '--save', str(out)]) == 0
    content = out.read_bytes()
    for entity in (b'/world/predicted', b'/world/reference', b'/curves/error/mean'):
        assert entity in content
