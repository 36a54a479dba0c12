# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Data of a figure: panels, each with one point for each variant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any

from .aggregate import MEDIANS
from .experiments import SETS

_TRUTH = {'poses': 'ours, by differences of poses', 'given': "ours, by Bullet's own velocities"}


@dataclass(frozen=True)
class Point:
    """A variant in a panel.

    Args:
        place: Position on the axis of variants.
        label: Label of the variant.
        mean: Our mean over seeds; None: not run, or nothing finite; inf: the median of a seed is.
        std: Standard deviation over seeds.
        lost: Number of rollouts that diverged.
        rollouts: Number of all rollouts.
        thesis: The thesis' value: a number, [mean, std], a word, or None.
    """

    place: float
    label: str
    mean: float | None = None
    std: float = 0.0
    lost: int = 0
    rollouts: int = 0
    thesis: Any = None

    @property
    def empty(self) -> bool:
        """Whether there is no result of ours to draw."""
        return self.mean is None and not self.lost

    @property
    def finite(self) -> bool:
        """Whether our mean can be drawn on the axis."""
        return self.mean is not None and isfinite(self.mean)


@dataclass(frozen=True)
class Panel:
    """One metric on one set.

    Args:
        metric: Name of the metric, with `_median` for medians over rollouts.
        which: 'test' or 'ood'.
        points: A point for each variant.
        floor: The teacher against itself, or half a radius if that is more; None: no floor.
        bounded: Whether `floor` is half a radius.
        steps: Steps of each rollout; None: there are no rollouts.
    """

    metric: str
    which: str
    points: tuple[Point, ...]
    floor: float | None = None
    bounded: bool = False
    steps: int | None = None

    @property
    def limits(self) -> tuple[float, float]:
        """Limits of the value axis; the thesis' values count only where they are near ours."""
        ours = [p.mean for p in self.points if p.mean is not None]
        ours = [v for v in [*ours, self.floor or 0.0] if 0 < v < inf]
        if not ours:
            return 0.0, 1.0
        low, high = min(ours), max(ours)
        theirs = [number for p in self.points for number in printed_numbers(p.thesis)[:1]]
        near = [v for v in theirs if low / 200 < v < high * 200]
        low, high = min([low, *near]), max([high, *near])
        return (low / 2, high * 2) if high / low > 10 else (0.0, 1.4 * high)

    @property
    def logarithmic(self) -> bool:
        """Whether the axis is logarithmic, as the values span more than a decade."""
        return self.limits[0] > 0


def panels_of(table: Mapping[str, Any]) -> list[Panel]:
    """Panels of a table, set by set, without those in which no cell has run."""
    panels = []
    for which in SETS:
        steps = table['steps'][which] if table['kind'] == 'train' else None
        for metric in table['metrics']:
            median = table['kind'] == 'train' and metric in MEDIANS
            shown = f'{metric}_median' if median else metric
            points = _points(table, which, metric, shown)
            if not all(point.empty for point in points):
                floor, bounded = _floor(table, which, shown)
                panels.append(Panel(shown, which, tuple(points), floor, bounded, steps))
    return panels


def printed_numbers(value: Any) -> list[float]:
    """Number, or mean and standard deviation, of a value of the thesis; empty: it is none."""
    if value is None or isinstance(value, str):
        return []
    return [float(part) for part in (value if isinstance(value, list) else [value])]


def _points(table: Mapping[str, Any], which: str, metric: str, shown: str) -> list[Point]:
    if table['kind'] == 'teacher':
        return _truth_points(table, which, metric)
    points = []
    for index, row in enumerate(table['rows']):
        score: Mapping[str, Any] = {}
        if table['kind'] == 'train':
            score = row['sets'].get(which, {}).get(str(table['steps'][which]), {})
            values = score.get('metrics', {})
        else:
            values = row.get('values', {}) if which == 'test' else {}
        statistic = values.get(shown) or {'mean': None, 'std': None}
        points.append(
            Point(
                index if row.get('x') is None else row['x'],
                row['label'],
                statistic['mean'],
                statistic['std'] or 0.0,
                score.get('diverged', 0),
                score.get('rollouts', 0),
                row['thesis'].get(which, {}).get(metric),
            )
        )
    return points


def _truth_points(table: Mapping[str, Any], which: str, metric: str) -> list[Point]:
    points = []
    for row in (row for row in table['rows'] if row['variant'] == which and row['laws']):
        printed = row['thesis'].get(which, {}).get(metric)
        points.append(Point(0, 'thesis: Blender', thesis=printed))
        for place, (kind, label) in enumerate(_TRUTH.items(), start=1):
            statistic = row['laws'][kind][metric]
            points.append(Point(place, label, statistic['mean'], statistic['std'] or 0.0))
    return points


def _floor(table: Mapping[str, Any], which: str, metric: str) -> tuple[float | None, bool]:
    """Floor, and whether it is the least floor; None for laws, which have no reference."""
    if table['kind'] != 'train':
        return None, False
    floor = table['floor'].get(which, {}).get(str(table['steps'][which]), {})
    own, least = floor.get(metric), floor.get(f'least_{metric}')
    if least is not None and (own is None or least > own):
        return least, True
    return own, False
