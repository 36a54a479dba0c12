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

"""Pictures in a row: which times, which spheres where, and into which file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from .camera import Camera
from .picture import draw, Image, linear, Surroundings
from ..comparison import Comparison
from ..surfaces import focus
from ...installation.extras import needed
from ...running.progress import Progress
from ...scenes.state import Array, Trajectory

PREDICTED, REFERENCE = '#3b9fe3', '#f2a434'
INK = (29, 36, 48)
SUFFIXES = ('.mp4', '.gif', '.webp')
MP4_QUALITY = 7  # of imageio-ffmpeg, 1 to 10
WEBP_QUALITY = 72

Layout = Literal['beside', 'overlay']


@dataclass(frozen=True, kw_only=True)
class Film:
    """How to film.

    Args:
        width: Of each frame [pixels], even.
        height: Of each frame [pixels], even.
        fps: Frames per second.
        speed: Seconds shown per second of film.
        start: First time shown [s].
        stop: Last time shown [s]; None: the end.
        layout: 'beside': reference left, prediction right; 'overlay': the reference as a ghost.
        azimuth: Of the camera, around the vertical [degrees].
        elevation: Of the camera, above the level [degrees].
        zoom: Nearer by this factor.

    Raises:
        ValueError: A value is out of range.
    """

    width: int = 960
    height: int = 540
    fps: float = 25.0
    speed: float = 1.0
    start: float = 0.0
    stop: float | None = None
    layout: Layout = 'beside'
    azimuth: float = -60.0
    elevation: float = 24.0
    zoom: float = 1.0

    def __post_init__(self) -> None:
        for name in ('width', 'height'):
            value = getattr(self, name)
            if not (64 <= value <= 4096 and value % 4 == 0):
                raise ValueError(
                    f'{name} is {value} pixels, expected 64 to 4096 and a multiple of 4'
                )
        for name in ('fps', 'speed'):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f'{name} is {value:g}, expected more than 0')

    def times(self, duration: float) -> Array:
        """Return times of the frames [s] in a trajectory of `duration` [s], shape (frames,)."""
        stop = duration if self.stop is None else min(self.stop, duration)
        if not 0 <= self.start < stop:
            raise ValueError(
                f'start is {self.start:g} s and stop {stop:g} s, expected 0 <= start < stop; the '
                f'trajectory has {duration:g} s'
            )
        return np.arange(self.start, stop + 1e-9, self.speed / self.fps)


def frames(comparison: Comparison, film: Film) -> Iterator[Image]:
    """Frames of a film, each RGB of shape (height, width, 3)."""
    sides = list(comparison.sides.items())
    low, high = focus([trajectory for _, trajectory in sides], comparison.scene)
    surroundings = Surroundings.of(comparison.scene, low, high)
    beside = film.layout == 'beside' and len(sides) == 2
    width = film.width // 2 if beside else film.width
    camera = Camera.around(
        low,
        high,
        comparison.scene.up,
        azimuth=film.azimuth,
        elevation=film.elevation,
        zoom=film.zoom,
        aspect=width / film.height,
    )
    radii = comparison.scene.per_sphere('radius', comparison.predicted.count)
    colours = [np.tile(linear(colour), (len(radii), 1)) for colour in (PREDICTED, REFERENCE)]
    for time in film.times(comparison.predicted.steps * comparison.predicted.dt):
        images = [
            draw(
                camera,
                surroundings,
                *poses_at(trajectory, time),
                radii,
                colours[side],
                width=width,
                height=film.height,
            )
            for side, (_, trajectory) in enumerate(sides)
        ]
        names = [name for name, _ in sides]
        if beside:
            picture = np.concatenate([images[1], images[0]], axis=1)
            labels = [(0, names[1], REFERENCE), (width, names[0], PREDICTED)]
        elif len(sides) == 2:
            picture = (0.65 * images[0] + 0.35 * images[1]).astype(np.uint8)
            labels = [
                (0, names[0], PREDICTED),
                (film.width // 2, f'{names[1]} (ghost)', REFERENCE),
            ]
        else:
            picture, labels = images[0], [(0, names[0], PREDICTED)]
        yield _labelled(picture, labels, f'{time:.1f} s')


def poses_at(trajectory: Trajectory, time: float) -> tuple[Array, Array]:
    """Positions [m], shape (n, 3), and quaternions, shape (n, 4), between two frames."""
    place = min(time / trajectory.dt, float(trajectory.steps))
    before = min(int(place), max(trajectory.steps - 1, 0))
    after = min(before + 1, trajectory.steps)
    share = place - before
    positions = (1 - share) * trajectory.positions[before] + share * trajectory.positions[after]
    one, other = trajectory.quaternions[before], trajectory.quaternions[after]
    sign = np.where((one * other).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
    turned = (1 - share) * one + share * sign * other
    return positions, turned / np.linalg.norm(turned, axis=1, keepdims=True)


def write_film(path: str | Path, comparison: Comparison, film: Film) -> int:
    """Film into an .mp4, .gif or .webp; a file that exists is replaced.

    Returns:
        Number of frames.

    Raises:
        ValueError: The suffix is another one, or the times are out of range.
        ModuleNotFoundError: What writes the format is not installed.
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(f'{path}: suffix {path.suffix!r}, expected one of {", ".join(SUFFIXES)}')
    needed('PIL', str(path))
    ffmpeg = needed('imageio_ffmpeg', str(path)) if path.suffix.lower() == '.mp4' else None
    # before anything is written
    times = film.times(comparison.predicted.steps * comparison.predicted.dt)
    path.parent.mkdir(parents=True, exist_ok=True)
    with Progress(len(times), path.name, unit='frame') as progress:
        pictures = _counted(frames(comparison, film), progress)
        if ffmpeg is not None:
            return _write_mp4(ffmpeg, path, pictures, film)
        return _write_animation(path, list(pictures), film)


def _counted(pictures: Iterator[Image], progress: Progress) -> Iterator[Image]:
    for picture in pictures:
        yield picture
        progress.update()


def _write_mp4(ffmpeg: Any, path: Path, pictures: Iterator[Image], film: Film) -> int:
    writer = ffmpeg.write_frames(
        str(path), (film.width, film.height), fps=film.fps, quality=MP4_QUALITY, macro_block_size=4
    )
    writer.send(None)  # as the library wants it
    count = 0
    try:
        for picture in pictures:
            writer.send(np.ascontiguousarray(picture))
            count += 1
    finally:
        writer.close()
    return count


def _write_animation(path: Path, pictures: list[Image], film: Film) -> int:
    from PIL import Image as Pillow

    images = [Pillow.fromarray(picture) for picture in pictures]
    options: dict[str, Any] = {'quality': WEBP_QUALITY, 'method': 6}
    if path.suffix.lower() == '.gif':
        # one palette for all frames, of a few of them in a row: colours do not flicker
        some = np.concatenate(pictures[:: max(1, len(pictures) // 6)])
        palette = Pillow.fromarray(some).quantize(128, dither=Pillow.Dither.NONE)
        images = [image.quantize(palette=palette, dither=Pillow.Dither.NONE) for image in images]
        options = {'optimize': False, 'disposal': 1}
    images[0].save(
        path,
        save_all=True,
        append_images=images[1:],
        duration=round(1000 / film.fps),
        loop=0,
        **options,
    )
    return len(images)


def _labelled(picture: Image, labels: list[tuple[int, str, str]], clock: str) -> Image:
    from PIL import Image as Pillow
    from PIL import ImageDraw, ImageFont

    image = Pillow.fromarray(picture)
    pen = ImageDraw.Draw(image)
    size = max(12, picture.shape[0] // 22)
    font = ImageFont.load_default(size)
    gap = size // 2
    for left, text, colour in labels:
        x = left + gap
        pen.ellipse((x, gap + size // 4, x + size * 0.7, gap + size * 0.95), fill=colour)
        pen.text((x + size, gap), text, font=font, fill=INK)
    pen.text((image.width - gap, gap), clock, font=font, fill=INK, anchor='ra')
    return np.asarray(image)
