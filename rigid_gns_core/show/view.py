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

"""`rigid-gns view`: a rollout or a bag in Rerun: spheres over time beside curves."""

from __future__ import annotations

import argparse
import importlib
from pathlib import Path
from typing import Any

import numpy as np

from .comparison import Comparison
from .series import charts
from .surfaces import focus, visible_quads
from ..commands.source import add_source, read_comparison
from ..installation.extras import needed

ENTITIES = ('world/predicted', 'world/reference')
COLOURS = ((59, 159, 227), (242, 164, 52))
APPLICATION = 'rigid_gns'
TIMELINE = 'time'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `rigid-gns view`."""
    add_source(parser)
    parser.add_argument(
        '--save',
        type=Path,
        metavar='RRD',
        help='write a file, which `rerun FILE` opens, instead of opening the viewer',
    )
    parser.epilog = (
        'examples:\n'
        '  rigid-gns view rollout.h5 --reference bullet.h5\n'
        '  rigid-gns view bags/first --save first.rrd'
    )


def run(arguments: argparse.Namespace) -> int:
    """Open the viewer, or write a file; returns 0."""
    save: Path | None = arguments.save
    if save is not None and save.suffix != '.rrd':
        raise ValueError(f'--save is {save}, expected a name that ends with .rrd')
    rerun = _rerun()
    comparison = read_comparison(arguments, scored=False)
    recording = rerun.RecordingStream(APPLICATION)
    if save is None:
        recording.spawn()
    else:
        save.parent.mkdir(parents=True, exist_ok=True)
        recording.save(str(save))
    send(recording, comparison)
    recording.flush()
    if save is not None:
        print(f'wrote {save} ({save.stat().st_size / 1e6:.1f} MB); rerun {save} shows it')
    return 0


def send(recording: Any, comparison: Comparison) -> None:
    """Send all of a comparison to a Rerun recording.

    Spheres are `world/predicted` and `world/reference`, surfaces `world/surfaces`, and curves
    `curves/CHART/CURVE`.
    """
    rerun, blueprint = _rerun(), importlib.import_module('rerun.blueprint')
    recording.log('world', rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    _send_surfaces(recording, comparison)
    radii = comparison.scene.per_sphere('radius', comparison.predicted.count)
    for entity, colour, trajectory in zip(
        ENTITIES, COLOURS, comparison.sides.values(), strict=False
    ):
        frames, count = trajectory.positions.shape[:2]
        recording.log(
            entity, rerun.Points3D.from_fields(radii=radii, colors=[colour]), static=True
        )
        points = rerun.Points3D.columns(positions=trajectory.positions.reshape(-1, 3))
        recording.send_columns(
            entity,
            indexes=[rerun.TimeColumn(TIMELINE, duration=trajectory.times)],
            columns=points.partition(np.full(frames, count)),
            strict=True,
        )
    views = []
    for chart in charts(comparison):
        times = np.asarray(chart['times'])
        for curve in chart['curves']:
            entity = rerun.new_entity_path(['curves', chart['key'], curve['label']])
            recording.log(entity, rerun.SeriesLines(names=curve['label']), static=True)
            recording.send_columns(
                entity,
                indexes=[rerun.TimeColumn(TIMELINE, duration=times)],
                columns=rerun.Scalars.columns(scalars=np.asarray(curve['values'])),
                strict=True,
            )
        title = f'{chart["title"]} [{chart["unit"]}]'
        views.append(blueprint.TimeSeriesView(name=title, origin=f'curves/{chart["key"]}'))
    recording.send_blueprint(
        blueprint.Blueprint(
            blueprint.Horizontal(
                blueprint.Spatial3DView(name=comparison.title, origin='world'),
                blueprint.Tabs(*views),
                column_shares=[3, 2],
            )
        )
    )


def _send_surfaces(recording: Any, comparison: Comparison) -> None:
    rerun = _rerun()
    low, high = focus(list(comparison.sides.values()), comparison.scene)
    quads = visible_quads(comparison.scene, low, high)
    if not quads:
        return
    corners = np.concatenate([quad.corners for quad in quads])
    triangles = [4 * index + np.array([[0, 1, 2], [0, 2, 3]]) for index in range(len(quads))]
    recording.log(
        'world/surfaces',
        rerun.Mesh3D(
            vertex_positions=corners,
            triangle_indices=np.concatenate(triangles),
            vertex_normals=np.repeat([quad.normal for quad in quads], 4, axis=0),
            vertex_colors=np.tile([225, 229, 233, 255], (len(corners), 1)),
        ),
        static=True,
    )


def _rerun() -> Any:
    return needed('rerun', '`rigid-gns view`, unlike `report`,')
