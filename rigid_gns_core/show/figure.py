# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Figure of a prediction and its reference: positions, energy and error over time."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np

from .obstacles import quads_of
from ..errors import UserError
from ..files.atomic_file import whole_file
from ..scenes.scene import Plane, Scene
from ..scenes.state import Array, Trajectory
from ..scoring import divergence, Energy, energy
from ..scoring.error import check_comparable
from ..studies.axes import clean_axes, GRID, INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe-Ito colours, safe for colour-blind readers
REFERENCE = '#e69f00'
PREDICTED = '#0072b2'
KINDS = {'total': '#000000', 'potential': '#009e73', 'kinetic': '#d55e00', 'rotational': '#cc79a7'}
SURFACE = '#8c8c8c'
FAR = 1e4
"""Half length at which infinite sides are cut [m]."""


def write_figure(
    path: str | Path,
    predicted: Trajectory,
    reference: Trajectory,
    scene: Scene,
    *,
    title: str = '',
    names: tuple[str, str] = ('predicted', 'reference'),
) -> Path:
    """Draw a prediction and its reference into a PNG (or PDF, SVG: by the suffix).

    Views from above and from the side at four times, spheres to scale; below, energies and errors
    over time. No display is needed. Steps that only one trajectory has, or after a divergence, are
    left out.

    Args:
        path: File to write; an existing one is replaced.
        predicted: The prediction.
        reference: The reference, with the same time step and spheres.
        scene: Surfaces and sphere properties.
        title: Headline.
        names: Names of prediction and reference.

    Raises:
        UserError: Time steps or spheres differ, or a trajectory diverges at the start.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    frames = min(len(predicted), len(reference))
    predicted, reference = predicted.window(0, frames), reference.window(0, frames)
    check_comparable(predicted, reference)
    lost = [s for t in (predicted, reference) if (s := divergence(t, scene)) is not None]
    if lost:
        if min(lost) == 0:
            raise UserError('a trajectory diverges at its start, so there is nothing to draw')
        predicted, reference = predicted.window(0, min(lost)), reference.window(0, min(lost))
        title = f'{title}  (diverged at step {min(lost)})'.strip()
    # the start, two times between and the end
    shown_at = np.round(np.array([0.0, 0.1, 0.35, 1.0]) * reference.steps)
    steps = sorted({int(step) for step in shown_at})

    axes_of_view = _view_axes(scene)
    # the same limits at all times, with every sphere inside
    seen = np.concatenate([predicted.positions[steps], reference.positions[steps]])
    shown = seen @ axes_of_view.T
    margin = 1.5 * float(np.max(scene.radius))
    low, high = _limits(shown, scene, axes_of_view, margin)
    width, depth, height = high - low
    panel = 12.6 / len(steps)
    top = min(panel * depth / width, 3.6)
    side = float(np.clip(panel * height / width, 0.6, 3.6))
    figure = Figure(figsize=(13.0, top + side + 5.0), layout='constrained', facecolor='white')
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(3, 1, height_ratios=[top + 0.3, side + 0.3, 3.2])
    for row, (across, label) in enumerate(((1, 'from above'), (2, 'from the side'))):
        cells = grid[row].subgridspec(1, len(steps), wspace=0.04)
        for column, step in enumerate(steps):
            axes = figure.add_subplot(cells[column])
            _draw_view(axes, predicted, reference, scene, step, axes_of_view, across, low, high)
            if row == 0:
                axes.set_title(f'{step * reference.dt:.3g} s', fontsize=11, color=INK)
            if column == 0:
                axes.set_ylabel(f'{label}\n{"y" if across == 1 else "height"} [m]', color=INK)
            else:
                axes.tick_params(labelleft=False)
    curves = grid[2].subgridspec(1, 2)
    _draw_energy(figure.add_subplot(curves[0]), predicted, reference, scene, names)
    _draw_error(figure.add_subplot(curves[1]), predicted, reference, scene, names[1])
    _legend(figure, names)
    if title:
        figure.suptitle(title, fontsize=14, color=INK, x=0.01, ha='left')
    path = Path(path)
    with whole_file(path) as partial:
        figure.savefig(partial, dpi=110, format=path.suffix[1:])
    return path


def _view_axes(scene: Scene) -> Array:
    """Axes of the views, as rows: two horizontal ones, near x and y, and up; shape (3, 3)."""
    up = scene.up
    first = np.eye(3)[0] if abs(up[0]) < 0.9 else np.eye(3)[1]
    first = first - up * (first @ up)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(up, first), up])


def _corners(plane: Plane) -> Array:
    """Corners of a surface [m], shape (4, 3), with infinite sides cut at `FAR`."""
    half_x, half_y = (min(length / 2, FAR) for length in (plane.length_x, plane.length_y))
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return np.asarray(plane.point) + (signs * [half_x, half_y]) @ plane.axes[:2]


def _limits(shown: Array, scene: Scene, view: Array, margin: float) -> tuple[Array, Array]:
    low, high = shown.min((0, 1)), shown.max((0, 1))
    for plane in scene.surfaces:
        corners = _corners(plane) @ view.T
        near = np.abs(corners) < 1e3
        # the ends of surfaces are included where they are near the spheres
        for axis in range(3):
            inside = corners[near[:, axis], axis]
            span = 0.5 * (high - low).max()
            inside = inside[(inside > low[axis] - span) & (inside < high[axis] + span)]
            if len(inside):
                low[axis] = min(low[axis], inside.min())
                high[axis] = max(high[axis], inside.max())
    return low - margin, high + margin


def _draw_view(
    axes: Axes,
    predicted: Trajectory,
    reference: Trajectory,
    scene: Scene,
    step: int,
    view: Array,
    across: int,
    low: Array,
    high: Array,
) -> None:
    from matplotlib.collections import EllipseCollection

    pick = [0, across]
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[across], high[across])
    axes.set_aspect('equal', anchor='C')
    _draw_surfaces(axes, scene, view, pick)
    diameters = 2.0 * scene.per_sphere('radius', reference.count)
    angles = np.zeros(reference.count)
    for trajectory, style in (
        (reference, {'facecolors': REFERENCE, 'edgecolors': 'white', 'linewidths': 0.4}),
        (predicted, {'facecolors': 'none', 'edgecolors': PREDICTED, 'linewidths': 1.0}),
    ):
        centres = (trajectory.positions[step] @ view.T)[:, pick]
        circles = EllipseCollection(
            diameters,
            diameters,
            angles,
            units='xy',
            offsets=centres,
            offset_transform=axes.transData,
            zorder=3,
            **style,
        )
        axes.add_collection(circles, autolim=False)
    clean_axes(axes)


def _draw_surfaces(axes: Axes, scene: Scene, view: Array, pick: list[int]) -> None:
    seen_from = ({0, 1, 2} - set(pick)).pop()
    fixed = scene.of_fixed_surfaces()
    for obstacle in fixed.obstacles:
        for corners in quads_of(obstacle):
            axes.fill(*(corners @ view.T)[:, pick].T, facecolor=SURFACE, zorder=1)
    for plane in fixed.surfaces:
        facing = abs(float(np.asarray(plane.normal) @ view[seen_from]))
        bounded = np.isfinite(plane.length_x) and np.isfinite(plane.length_y)
        if facing > 0.99 and not bounded:
            continue  # it would fill the background
        corners = (_corners(plane) @ view.T)[:, pick]
        filled = 0.01 < facing <= 0.99
        axes.fill(
            *corners.T,
            facecolor=SURFACE if filled else 'none',
            alpha=0.25 if filled else 1.0,
            edgecolor=SURFACE,
            linewidth=1.6,
            zorder=1,
        )


def _draw_energy(
    axes: Axes, predicted: Trajectory, reference: Trajectory, scene: Scene, names: tuple[str, str]
) -> None:
    from matplotlib.lines import Line2D

    dashed: dict[str, Any] = {'linestyle': (0, (4, 2)), 'linewidth': 1.4}
    solid: dict[str, Any] = {'linestyle': '-', 'linewidth': 1.6}
    parts = [
        (reference, energy(reference, scene), dashed),
        (predicted, energy(predicted, scene), solid),
    ]
    peak = max(float(_curve(e, 'total').max()) for _, e, _ in parts)
    scale, unit = _energy_unit(peak)
    for trajectory, energies, style in parts:
        for kind, colour in KINDS.items():
            axes.plot(trajectory.times, _curve(energies, kind) / scale, color=colour, **style)
    handles = [Line2D([], [], color=c, linewidth=1.6, label=kind) for kind, c in KINDS.items()]
    handles += [
        Line2D([], [], color=INK, label=name, **style)
        for name, (_, _, style) in zip(names, reversed(parts), strict=True)
    ]
    axes.legend(handles=handles, frameon=False, fontsize=9, ncols=2)
    axes.set_title('Energy', loc='left', fontsize=11, color=INK)
    axes.set_xlabel('time [s]', color=INK)
    axes.set_ylabel(f'energy of all spheres [{unit}]', color=INK)
    axes.set_xlim(0, max(reference.times[-1], reference.dt))
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    axes.grid(color=GRID, linewidth=0.8)
    clean_axes(axes)


def _draw_error(
    axes: Axes, predicted: Trajectory, reference: Trajectory, scene: Scene, name: str
) -> None:
    distance = np.linalg.norm(predicted.positions - reference.positions, axis=2)
    radius = float(np.mean(scene.per_sphere('radius', reference.count)))
    floor = 1e-4 * radius
    times = reference.times
    quarters = np.maximum(np.percentile(distance, [25, 75], axis=1), floor)
    axes.fill_between(
        times, *quarters, color=PREDICTED, alpha=0.15, linewidth=0, label='middle half of spheres'
    )
    mean, median = distance.mean(axis=1), np.median(distance, axis=1)
    axes.plot(times, np.maximum(mean, floor), color=PREDICTED, linewidth=1.8, label='mean')
    axes.plot(
        times,
        np.maximum(median, floor),
        color=PREDICTED,
        linewidth=1.4,
        linestyle=(0, (1, 1)),
        label='median',
    )
    axes.axhline(
        0.5 * radius, color=INK, linewidth=1.0, linestyle=(0, (4, 2)), label='half a radius'
    )
    axes.set_yscale('log')
    axes.set_ylim(bottom=10 ** np.floor(np.log10(max(mean.min(), floor))))
    axes.set_xlim(0, max(times[-1], reference.dt))
    axes.set_title('Position error', loc='left', fontsize=11, color=INK)
    axes.set_xlabel('time [s]', color=INK)
    axes.set_ylabel(f'distance to {name} [m]', color=INK)
    axes.grid(color=GRID, linewidth=0.8)
    axes.legend(frameon=False, fontsize=9, loc='lower right')
    clean_axes(axes)


def _legend(figure: Figure, names: tuple[str, str]) -> None:
    from matplotlib.lines import Line2D

    def dot(**style: Any) -> Line2D:
        return Line2D([], [], linestyle='none', marker='o', markersize=9, **style)

    handles = [
        dot(markerfacecolor='none', markeredgecolor=PREDICTED, markeredgewidth=1.4),
        dot(markerfacecolor=REFERENCE, markeredgecolor='white'),
    ]
    figure.legend(
        handles, list(names), loc='outside upper right', ncols=2, frameon=False, fontsize=11
    )


def _curve(energies: Energy, kind: str) -> Array:
    return energies.with_rotation if kind == 'total' else getattr(energies, kind)


def _energy_unit(peak: float) -> tuple[float, str]:
    for scale, unit in ((1e6, 'MJ'), (1e3, 'kJ'), (1.0, 'J'), (1e-3, 'mJ')):
        if peak >= 2 * scale:
            return scale, unit
    return 1e-6, 'µJ'
