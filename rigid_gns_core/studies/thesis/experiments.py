# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Experiments: variants of one training recipe, and the thesis' values for each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
import re
from typing import Any, Literal

from ...files.config import config_folder, ConfigError, find_config, from_mapping, load_yaml

Kind = Literal['train', 'teacher', 'speed']
SETS = ('test', 'ood')
BASE = 'base'


@dataclass(frozen=True)
class Variant:
    """A row of a table, or a point of a figure.

    Args:
        name: Short name; equal changes have the same name in all experiments.
        label: Label in tables and figures.
        changes: Changes to the base recipe, nested as in config/train/gns.yaml; empty: the base
            itself, which is rolled out for `Budget.long_steps` on the test set too.
        x: Value on the axis of a figure; None: variants are labelled.
        thesis: The thesis' values by set and metric: a number, [mean, std], or 'diverged'.
    """

    name: str
    label: str
    changes: dict[str, Any] = field(default_factory=dict)
    x: float | None = None
    thesis: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not re.fullmatch(r'\w[\w.-]*', self.name):
            raise ConfigError(
                f'variant {self.name!r}: a name is a part of file names; use letters, digits, '
                '_, . and -'
            )
        for name, printed in self.thesis.items():
            if name not in SETS:
                raise ConfigError(
                    f'thesis.{name} of {self.name}: unknown set, allowed: {", ".join(SETS)}'
                )
            if not isinstance(printed, Mapping):
                raise ConfigError(
                    f'thesis.{name} of {self.name} is {printed!r}, expected a mapping'
                )
            for metric, value in printed.items():
                parts = value if isinstance(value, list) else [value]
                number = all(isinstance(p, (int, float)) for p in parts) and len(parts) in (1, 2)
                if not (number or value == 'diverged'):
                    raise ConfigError(
                        f'thesis.{name}.{metric} of {self.name} is {value!r}, expected a number, '
                        '[mean, std] or diverged (YAML reads 1e6 as text: write 1.0e+6)'
                    )


@dataclass(frozen=True)
class Experiment:
    """An experiment of the thesis, or one that it left open.

    Args:
        title: Title in one line.
        source: Section, figure or table of the thesis.
        claim: Conclusion of the thesis.
        variants: Variants that are compared.
        kind: 'train': each variant is trained and rolled out; 'teacher': the reference data are
            measured; 'speed': frames per second with random weights.
        axis: Label of the axis of `Variant.x`; empty: variants are labelled.
        metrics: Metrics of the figure, in the order of its panels; names as in docs/metrics.md.
        long: Whether to show rollouts of `Budget.long_steps` on the test set, which only the base
            has, instead of `Budget.steps`.
        name: Name of its file.
    """

    title: str
    source: str
    claim: str
    variants: tuple[Variant, ...]
    kind: Kind = 'train'
    axis: str = ''
    metrics: tuple[str, ...] = ('chamfer', 'mse', 'energy_gain')
    long: bool = False
    name: str = ''

    def __post_init__(self) -> None:
        names = [variant.name for variant in self.variants]
        if len(set(names)) < len(names) or not names:
            raise ConfigError(f'variants are {names}, expected at least one, each name once')
        if self.kind == 'teacher' and (unknown := sorted(set(names) - set(SETS))):
            raise ConfigError(
                f'variant {unknown[0]!r}: the teacher is measured on a set, allowed: '
                f'{", ".join(SETS)}'
            )
        for variant in self.variants:
            if self.kind == 'train' and (not variant.changes) != (variant.name == BASE):
                raise ConfigError(
                    f'variant {variant.name!r} has changes {variant.changes}; the one without any '
                    f'is called {BASE!r}, and no other'
                )

    def only(self, names: list[str] | None) -> tuple[Variant, ...]:
        """Variants by name; None: all.

        Raises:
            ConfigError: A name is unknown; the message lists the allowed ones.
        """
        known = {variant.name: variant for variant in self.variants}
        for name in names or ():
            if name not in known:
                raise ConfigError(
                    f'experiment {self.name} has no variant {name!r}, allowed: {", ".join(known)}'
                )
        return tuple(known[name] for name in names or known)


def load_experiment(name: str | Path) -> Experiment:
    """Load an experiment from a YAML file, or by a shipped name in config/experiments.

    Raises:
        ConfigError: No such experiment (the shipped ones are listed), or a wrong key or value.
    """
    path = find_config('experiments', name)
    return from_mapping(Experiment, {'name': path.stem, **load_yaml(path)}, str(path))


def shipped_experiments() -> dict[str, Experiment]:
    """Shipped experiments by name, in the order of the thesis."""
    order = [
        'ground_truth',
        'history',
        'message_passing',
        'connectivity',
        'speed',
        'ablation',
        'stability',
    ]
    names = sorted(path.stem for path in (config_folder() / 'experiments').glob('*.yaml'))
    return {name: load_experiment(name) for name in [*order, *names] if name in names}
