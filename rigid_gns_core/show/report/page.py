# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""One HTML file of a comparison: replay, curves and numbers; it needs nothing from outside."""

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

# more frames than a screen shows in a minute; the replay is linear between those it has
MAX_FRAMES = 2001
# name to import by: file; three.js in two parts, as its makers build it
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
    """Write the report; a file that exists is replaced.

    Args:
        path: HTML file.
        comparison: What it shows, of the same steps throughout (`comparison.cut`).
        max_frames: Of a longer replay only every second, third, ... frame is kept.

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
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding='utf-8')
    return path


def payload(comparison: Comparison, max_frames: int = MAX_FRAMES) -> dict[str, Any]:
    """Return what the page's scripts read: poses, surfaces and curves."""
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
    """Return the end of the scale of speeds [m/s]: all but 1 % of spheres and times are below."""
    speeds = np.linalg.norm(comparison.predicted.velocities, axis=2)
    return max(float(np.quantile(speeds, 0.99)), 1e-6)


def _summary(comparison: Comparison) -> str:
    predicted = comparison.predicted
    surfaces = len(comparison.scene.surfaces)
    parts = [
        f'{predicted.count} spheres',
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
    """Return a module as an address that holds it; such modules cannot name others by path."""
    source = _static(name).replace('"./three.core.min.js"', '"three/core"')
    return 'data:text/javascript;charset=utf-8;base64,' + base64.b64encode(
        source.encode('utf-8')
    ).decode('ascii')


def _script_safe(text: str) -> str:
    return text.replace('<', '\\u003c')  # no value can end the script that holds it


def _filled(template: str, **values: str) -> str:
    """`{{name}}` in the template for its value, once: braces in a value stay as they are."""
    return re.sub(r'\{\{(\w+)\}\}', lambda match: values[match[1]], template)
