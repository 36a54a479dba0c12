# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a figure of an experiment shows: one point for each variant, in each panel."""

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
        place: On the axis of variants.
        label: Of the variant.
        mean: Ours, over seeds; None: not run, or nothing finite; inf: a seed's median is.
        std: Of `mean`.
        lost: Rollouts that diverged, of `rollouts`.
        rollouts: How many there were.
        thesis: What the thesis prints: a number, [mean, std], a word, or nothing.
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
        """Whether nothing of ours is to be seen."""
        return self.mean is None and not self.lost

    @property
    def finite(self) -> bool:
        """Whether ours has a place on the scale."""
        return self.mean is not None and isfinite(self.mean)


@dataclass(frozen=True)
class Panel:
    """One metric on one set.

    Args:
        metric: Name of the metric; with `_median` where medians over rollouts are shown.
        which: 'test' or 'ood'.
        points: One for each variant.
        floor: The teacher against itself, or half a radius where that is more; None: it has none.
        bounded: Whether `floor` is half a radius.
        steps: Of each rollout; None: nothing is rolled out.
    """

    metric: str
    which: str
    points: tuple[Point, ...]
    floor: float | None = None
    bounded: bool = False
    steps: int | None = None

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest value to be seen; the thesis' only where they are near ours."""
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
        """Whether the values span so much that a plain axis would hide some."""
        return self.limits[0] > 0


def panels_of(table: Mapping[str, Any]) -> list[Panel]:
    """Panels of a table, set by set; without those in which nothing has run."""
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
    """Return the number, or mean and std, that the thesis prints; empty: it is none."""
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
    """Floor, and whether its bound is more; none of a law, which has no reference."""
    if table['kind'] != 'train':
        return None, False
    floor = table['floor'].get(which, {}).get(str(table['steps'][which]), {})
    own, least = floor.get(metric), floor.get(f'least_{metric}')
    if least is not None and (own is None or least > own):
        return least, True
    return own, False
