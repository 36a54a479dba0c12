# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Charts over time: error and floor, energy, penetration, momentum, and timing of a bag."""

from __future__ import annotations

from typing import Any

import numpy as np

from .comparison import Comparison, position_errors
from ..scenes.scene import Scene
from ..scenes.state import Array, Trajectory
from ..scoring import angular_momentum, energy, linear_momentum
from ..scoring.penetration import sphere_penetration, surface_penetration

# least error on the logarithmic axis [radii]
LEAST_ERROR = 1e-6


def chart(
    key: str, title: str, unit: str, times: Array, curves: list[dict[str, Any]], **more: Any
) -> dict[str, Any]:
    """Data of one chart.

    Args:
        key: Short name.
        title: Title.
        unit: Unit of the curves.
        times: Times of their points [s], shape (m,).
        curves: Curves with `label`, `values` of shape (m,), and `style`.
        more: `log` axis, `least` value, `note` below the chart, `apart`: a cursor of its own.
    """
    rounded = [{**curve, 'values': _rounded(curve['values'])} for curve in curves]
    return {
        'key': key,
        'title': title,
        'unit': unit,
        'times': _rounded(times, 7),
        'curves': rounded,
        **more,
    }


def charts(comparison: Comparison) -> list[dict[str, Any]]:
    """All charts of a comparison, in the order of the page."""
    found = [] if comparison.reference is None else [_error(comparison)]
    found += [_energy(comparison), _penetration(comparison), *_momentum(comparison)]
    return [*found, *_recording(comparison)]


def _error(comparison: Comparison) -> dict[str, Any]:
    reference = comparison.reference
    assert reference is not None
    radius = float(np.mean(comparison.scene.radius))
    least = LEAST_ERROR * radius
    distance = position_errors(comparison.predicted, reference)
    curves = [
        _curve('mean', distance.mean(axis=1), 'predicted'),
        _curve('median', np.median(distance, axis=1), 'predicted dashed'),
        _curve('worst sphere', distance.max(axis=1), 'predicted thin'),
    ]
    for name, floor in comparison.floors.items():
        curves.append(
            _curve(f'floor: {name}', position_errors(floor, reference).mean(axis=1), 'floor')
        )
    for curve in curves:
        curve['values'] = np.maximum(curve['values'], least)
    curves.append(_curve('half a radius', np.full(len(distance), 0.5 * radius), 'bound dashed'))
    note = (
        'Mean error of other simulations of the same start is the floor: in a chaotic scene '
        'nobody stays below it for long.'
        if comparison.floors
        else 'In a chaotic scene errors grow whatever the model: simulations of the same start '
        'with other substeps, given as --floor, tell how fast.'
    )
    return chart(
        'error', 'Position error', 'm', reference.times, curves, log=True, least=least, note=note
    )


def _energy(comparison: Comparison) -> dict[str, Any]:
    curves = []
    for side, (name, trajectory) in enumerate(comparison.sides.items()):
        energies = energy(trajectory, comparison.scene)
        line = ' dashed' if side else ''
        for label, values in (
            ('total', energies.with_rotation),
            ('potential', energies.potential),
            ('kinetic', energies.kinetic),
            ('rotational', energies.rotational),
        ):
            curves.append(_curve(f'{label}, {name}', values, f'{label}{line}'))
    return chart('energy', 'Energy', 'J', comparison.predicted.times, curves)


def penetration_depths(trajectory: Trajectory, scene: Scene) -> tuple[Array, Array]:
    """Deepest penetration between spheres, and of spheres into surfaces, at each time [diameters].

    Each of shape (steps + 1,). Spheres that went through a surface are not included; the
    evaluation, which follows their paths, counts them.
    """
    scene = scene.of_fixed_surfaces()
    radius = scene.per_sphere('radius', trajectory.count)
    spheres, surfaces = np.zeros(len(trajectory)), np.zeros(len(trajectory))
    for step in range(len(trajectory)):
        frame = trajectory.positions[step : step + 1]
        spheres[step] = sphere_penetration(frame, radius).deepest
        # half a diameter: a deeper centre lies behind the surface
        surfaces[step] = surface_penetration(frame, radius, scene.surfaces, limit=0.5).deepest
    return spheres, surfaces


def _penetration(comparison: Comparison) -> dict[str, Any]:
    curves = []
    for side, (name, trajectory) in enumerate(comparison.sides.items()):
        spheres, surfaces = penetration_depths(trajectory, comparison.scene)
        style = 'reference' if side else 'predicted'
        curves.append(_curve(f'spheres, {name}', spheres, style))
        curves.append(_curve(f'surfaces, {name}', surfaces, f'{style} dashed'))
    times = comparison.predicted.times
    return chart('penetration', 'Deepest penetration', 'diameters', times, curves)


def _momentum(comparison: Comparison) -> list[dict[str, Any]]:
    up = comparison.scene.up
    linear, spin = [], []
    for side, (name, trajectory) in enumerate(comparison.sides.items()):
        momentum = linear_momentum(trajectory, comparison.scene)
        across = np.linalg.norm(momentum - np.outer(momentum @ up, up), axis=1)
        style = 'reference' if side else 'predicted'
        linear.append(_curve(f'horizontal, {name}', across, style))
        linear.append(_curve(f'upwards, {name}', momentum @ up, f'{style} dashed'))
        vertical = angular_momentum(trajectory, comparison.scene) @ up
        spin.append(_curve(name, vertical, style))
    times = comparison.predicted.times
    return [
        chart('momentum', 'Momentum', 'kg m/s', times, linear),
        chart('spin', 'Angular momentum about the vertical', 'kg m²/s', times, spin),
    ]


def _recording(comparison: Comparison) -> list[dict[str, Any]]:
    titles = {
        'lateness': 'Lateness of predictions',
        'period': 'Time between predictions',
        'model step': 'Time of a model step',
    }
    return [
        chart(name, titles[name], 'ms', times, [_curve(name, values, 'predicted')], apart=True)
        for name, (times, values) in comparison.recording.items()
    ]


def _curve(label: str, values: Array, style: str) -> dict[str, Any]:
    return {'label': label, 'values': values, 'style': style}


def _rounded(values: Array, digits: int = 5) -> list[float]:
    return [float(f'{value:.{digits}g}') for value in values]
