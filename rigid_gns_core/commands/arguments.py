# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Options that several commands share: types, shell completion, workers."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from pathlib import Path

from ..files.config import config_folder
from ..running.workers import BACKENDS, Workers

_FIGURES = ('.png', '.pdf', '.svg')


def positive(text: str) -> int:
    """Option type: a whole number, at least 1."""
    if not text.isdecimal() or len(text) > 18 or int(text) < 1:
        raise argparse.ArgumentTypeError(f'{text!r}, expected a whole number, at least 1')
    return int(text)


def length(text: str) -> float:
    """Option type: a finite length [m], greater than 0."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < float('inf'):
        raise argparse.ArgumentTypeError(f'{text!r}, expected a length greater than 0 [m]')
    return value


def seed_number(text: str) -> int:
    """Option type: a seed, a whole number from 0 that 63 bits hold."""
    if not text.isdecimal() or len(text) > 19 or int(text) >= 2**63:
        raise argparse.ArgumentTypeError(
            f'{text!r}, expected a whole number from 0 to {2**63 - 1}'
        )
    return int(text)


def figure_file(text: str) -> Path:
    """Option type: a file whose suffix names the format of a figure."""
    if Path(text).suffix not in _FIGURES:
        raise argparse.ArgumentTypeError(
            f'{text!r}, expected a name that ends in {", ".join(_FIGURES)}'
        )
    return Path(text)


def completes(
    action: argparse.Action, names: Callable[[], Iterable[str]] | Iterable[str]
) -> argparse.Action:
    """Complete an option by names in the shell; the option may take other values, such as files.

    Args:
        action: Return value of `add_argument`.
        names: Names, or a function that finds them on demand.

    Returns:
        The action.
    """

    def completer(**_: object) -> list[str]:  # argcomplete filters by what was typed
        return list(names() if callable(names) else names)

    action.completer = completer  # type: ignore[attr-defined]  # where argcomplete looks for it
    return action


def shipped_models() -> list[str]:
    """Names of the shipped models, the default first."""
    from ..files.checkpoint import LAWS, shipped_networks

    return [LAWS, *shipped_networks()]


def configs(kind: str) -> Callable[[], list[str]]:
    """Function that finds the names of the shipped YAML files in config/`kind`."""

    def find() -> list[str]:
        return sorted(path.stem for path in (config_folder() / kind).glob('*.yaml'))

    return find


def add_worker_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `chosen_workers`."""
    parser.add_argument(
        '--workers', type=int, metavar='N', help='processes; default: one per core'
    )
    parser.add_argument(
        '--backend',
        choices=BACKENDS,
        default='loky',
        help='processes on this machine (loky, the default), or a cluster with shared folders',
    )
    parser.add_argument(
        '--scheduler', metavar='ADDRESS', help='scheduler of the cluster, such as tcp://host:8786'
    )


def chosen_workers(arguments: argparse.Namespace) -> Workers:
    """Workers by the options of `add_worker_arguments`."""
    return Workers(arguments.workers, arguments.backend, arguments.scheduler)
