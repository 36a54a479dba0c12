# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report of a comparison: one self-contained HTML file with replay, curves and numbers."""

from __future__ import annotations

import base64
import html
from importlib import resources
import json
from pathlib import Path
import re
from typing import Any

import numpy as np

from .packing import pack_positions, pack_quaternions
from .tables import notes, tables, tiles
from ..comparison import Comparison
from ..series import charts
from ..surfaces import extent, focus, visible_quads
from ...errors import UserError
from ...files.atomic_file import whole_file

# more frames than a screen shows in half a minute; the replay interpolates linearly between them
MAX_FRAMES = 2001
# name of the module for imports: file; three.js is built in two parts
MODULES = {
    'three': 'vendor/three.module.min.js',
    'three/core': 'vendor/three.core.min.js',
    'three/orbit': 'vendor/OrbitControls.js',
    'report/decode': 'decode.js',
    'report/colours': 'colours.js',
    'report/stage': 'stage.js',
    'report/player': 'player.js',
    'report/charts': 'charts.js',
    'report/main': 'main.js',
}


def write_report(
    path: str | Path, comparison: Comparison, *, max_frames: int = MAX_FRAMES
) -> Path:
    """Write the report; an existing file is replaced.

    Args:
        path: HTML file to write.
        comparison: Comparison to show, with equal steps of all trajectories (`comparison.cut`).
        max_frames: Largest number of frames; of a longer replay every second, third, ... is kept.

    Raises:
        UserError: `max_frames` is below 2.
    """
    if max_frames < 2:
        raise UserError(f'max_frames is {max_frames}, expected at least 2')
    evaluation = comparison.evaluation
    text = _filled(
        _static('page.html'),
        title=html.escape(comparison.title),
        summary=html.escape(_summary(comparison)),
        licences='\n'.join(_static(f'vendor/LICENSE.{name}') for name in ('three', 'uPlot')),
        style=_static('vendor/uPlot.min.css') + _static('page.css'),
        imports=_script_safe(json.dumps({'imports': {n: _module(f) for n, f in MODULES.items()}})),
        tiles=tiles(evaluation, comparison.names),
        notes=notes(evaluation),
        tables=tables(evaluation),
        payload=_script_safe(json.dumps(payload(comparison, max_frames), separators=(',', ':'))),
        uplot=_static('vendor/uPlot.iife.min.js'),
    )
    path = Path(path)
    with whole_file(path) as partial:
        partial.write_text(text, encoding='utf-8')
    return path


def payload(comparison: Comparison, max_frames: int = MAX_FRAMES) -> dict[str, Any]:
    """Data for the scripts of the page: poses, surfaces and curves."""
    scene, sides = comparison.scene, comparison.sides
    trajectories = list(sides.values())
    stride = max(1, -(-comparison.predicted.steps // (max_frames - 1)))
    shown = slice(None, None, stride)
    low, high = extent(trajectories, scene)
    near, far = focus(trajectories, scene)
    return {
        'sides': list(sides),
        'count': comparison.predicted.count,
        'frames': len(comparison.predicted.positions[shown]),
        'dt': stride * comparison.predicted.dt,
        'radii': scene.per_sphere('radius', comparison.predicted.count).tolist(),
        'up': scene.up.tolist(),
        'extent': [low.tolist(), high.tolist()],
        'focus': [near.tolist(), far.tolist()],
        'fastest': _fastest(comparison),
        'quads': [
            {'corners': quad.corners.tolist(), 'endless': quad.endless}
            for quad in visible_quads(scene, near, far)
        ],
        'tracks': [
            {
                'positions': pack_positions(t.positions[shown], low, high),
                'quaternions': pack_quaternions(t.quaternions[shown]),
            }
            for t in trajectories
        ],
        'charts': charts(comparison),
    }


def _fastest(comparison: Comparison) -> float:
    """Upper end of the scale of speeds [m/s], their 99 % quantile over spheres and times."""
    speeds = np.linalg.norm(comparison.predicted.velocities, axis=2)
    return max(float(np.quantile(speeds, 0.99)), 1e-6)


def _summary(comparison: Comparison) -> str:
    predicted = comparison.predicted
    surfaces = len(comparison.scene.surfaces)
    parts = [
        f'{predicted.count} sphere{"s" if predicted.count != 1 else ""}',
        f'{surfaces} surface{"s" if surfaces != 1 else ""}',
        f'{predicted.steps * predicted.dt:.4g} s',
        f'steps of {1e3 * predicted.dt:.4g} ms',
        ' against '.join(comparison.sides),
    ]
    if comparison.lost is not None:
        parts.append(f'diverged at step {comparison.lost}: what follows is not shown')
    return ' · '.join(parts)


def _static(name: str) -> str:
    return (resources.files(__package__) / 'static' / name).read_text(encoding='utf-8')


def _module(name: str) -> str:
    """Module as a data URL; such modules cannot import others by path."""
    source = _static(name).replace('"./three.core.min.js"', '"three/core"')
    return 'data:text/javascript;charset=utf-8;base64,' + base64.b64encode(
        source.encode('utf-8')
    ).decode('ascii')


def _script_safe(text: str) -> str:
    return text.replace('<', '\\u003c')  # a value must not end the script element


def _filled(template: str, **values: str) -> str:
    """Template with each `{{name}}` replaced by its value; braces within values stay."""
    return re.sub(r'\{\{(\w+)\}\}', lambda match: values[match[1]], template)
