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

"""`rigid-gns render`: a moving picture of a rollout or a bag; no display and no GPU are needed."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..show.comparison import add_source, read_comparison

SIZE = (960, 540)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `rigid-gns render`."""
    add_source(parser)
    parser.add_argument(
        '--out', required=True, type=Path, metavar='FILE', help='.mp4, .gif or .webp to write'
    )
    parser.add_argument(
        '--layout',
        choices=('beside', 'overlay'),
        default='beside',
        help='reference and prediction side by side (default), or the reference as a ghost',
    )
    parser.add_argument(
        '--size',
        type=int,
        nargs=2,
        default=SIZE,
        metavar=('W', 'H'),
        help=f'pixels, multiples of 4 (default {SIZE[0]} {SIZE[1]})',
    )
    parser.add_argument('--fps', type=float, default=25.0, help='frames per second (default 25)')
    parser.add_argument(
        '--speed', type=float, default=1.0, help='seconds shown per second of film (default 1)'
    )
    parser.add_argument('--start', type=float, default=0.0, metavar='S', help='first time [s]')
    parser.add_argument('--stop', type=float, metavar='S', help='last time [s] (default: the end)')
    parser.add_argument(
        '--azimuth', type=float, default=-60.0, metavar='DEG', help='of the camera (default -60)'
    )
    parser.add_argument(
        '--elevation', type=float, default=24.0, metavar='DEG', help='of the camera (default 24)'
    )
    parser.add_argument(
        '--zoom', type=float, default=1.0, help='camera nearer by this (default 1)'
    )
    parser.epilog = (
        'example:\n  rigid-gns render rollout.h5 --reference bullet.h5 --stop 10 --out rollout.mp4'
    )


def run(arguments: argparse.Namespace) -> int:
    """Film; prints where it is and returns 0."""
    from ..show.render.movie import Film, SUFFIXES, write_film

    out: Path = arguments.out
    if out.suffix.lower() not in SUFFIXES:
        raise ValueError(f'--out is {out}, expected a name that ends with {", ".join(SUFFIXES)}')
    film = Film(
        width=arguments.size[0],
        height=arguments.size[1],
        fps=arguments.fps,
        speed=arguments.speed,
        start=arguments.start,
        stop=arguments.stop,
        layout=arguments.layout,
        azimuth=arguments.azimuth,
        elevation=arguments.elevation,
        zoom=arguments.zoom,
    )
    count = write_film(out, read_comparison(arguments, scored=False), film)
    print(f'{count} frames; wrote {out} ({out.stat().st_size / 1e6:.1f} MB)')
    return 0
