# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Runs cases one after the other, and counts what fails."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from itertools import count
import warnings

from .comparisons import Engines, Simulate
from .failure import Failure, PROPERTIES
from .properties import check
from .scenes import Case, draw_case, kind_of, KINDS
from ...files.tables import format_rows
from ...rollout.simulator import Simulator
from ...scenes.scene import Scene
from ...scenes.state import State, Trajectory

SUBSTEPS = (32, 64)
"""Many substeps, and twice as many."""


class Tally:
    """How many cases of each kind were run, and how many of them broke each property."""

    def __init__(self) -> None:
        self.cases: Counter[str] = Counter()
        self.failed: Counter[str] = Counter()
        self.broken: Counter[tuple[str, str]] = Counter()

    def add(self, case: Case, failures: list[Failure]) -> None:
        """Count a case."""
        self.cases[case.kind] += 1
        self.failed[case.kind] += bool(failures)
        self.broken.update({(case.kind, failure.name) for failure in failures})

    @property
    def done(self) -> int:
        """Number of cases."""
        return self.cases.total()

    @property
    def total_failed(self) -> int:
        """Number of cases that broke a property."""
        return self.failed.total()

    def __str__(self) -> str:
        rows = [
            [kind, str(self.cases[kind]), str(self.failed[kind])]
            + [str(self.broken[kind, name] or '') for name in PROPERTIES]
            for kind in KINDS
            if self.cases[kind]
        ]
        all_of = [sum(self.broken[kind, name] for kind in KINDS) for name in PROPERTIES]
        rows.append(
            [
                'all',
                str(self.done),
                str(self.total_failed),
                *(str(number or '') for number in all_of),
            ]
        )
        return format_rows(['kind', 'cases', 'failed', *PROPERTIES], rows)


def engines_of(default: Simulator, many: Simulator, most: Simulator) -> Engines:
    """Engines of simulators."""
    return Engines(*map(_simulate, (default, many, most)))


def fuzz(
    engines: Engines, seed: int, first: int = 0, kinds: Collection[str] = tuple(KINDS)
) -> Iterator[tuple[Case, list[Failure]]]:
    """Draw and check cases of these kinds without end, from number `first` on."""
    for number in count(first):
        if kind_of(number) in kinds:
            case = draw_case(seed, number)
            yield case, check(case, engines)


def _simulate(simulator: Simulator) -> Simulate:
    def simulate(scene: Scene, start: State, steps: int) -> Trajectory:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')  # that it diverged is a property
            return simulator.rollout(scene, **vars(start), steps=steps)

    return simulate
