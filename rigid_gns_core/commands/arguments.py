# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the options of several commands share: their types, and the names a shell offers."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable

from ..files.config import config_folder
from ..running.workers import BACKENDS, Workers


def positive(text: str) -> int:
    """Type of a command line option that takes a whole number from 1 on."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f'{text!r}, expected a whole number, at least 1')
    return int(text)


def completes(
    action: argparse.Action, names: Callable[[], Iterable[str]] | Iterable[str]
) -> argparse.Action:
    """Let the shell offer names for an option that takes others too, such as files.

    Args:
        action: What `add_argument` returned.
        names: They, or what finds them when a shell asks.
    """

    def completer(**_: object) -> list[str]:  # argcomplete tells what was typed; it filters itself
        return list(names() if callable(names) else names)

    action.completer = completer  # type: ignore[attr-defined]  # where argcomplete looks for it
    return action


def shipped_models() -> list[str]:
    """Names of the shipped models, the default first."""
    from ..files.checkpoint import LAWS, shipped_networks

    return [LAWS, *shipped_networks()]


def configs(kind: str) -> Callable[[], list[str]]:
    """Find the names of the shipped YAML files in config/`kind`."""

    def find() -> list[str]:
        return sorted(path.stem for path in (config_folder() / kind).glob('*.yaml'))

    return find


def add_worker_arguments(parser: argparse.ArgumentParser) -> None:
    """Options that say who does the work."""
    parser.add_argument(
        '--workers', type=int, metavar='N', help='processes; default: one per core'
    )
    parser.add_argument(
        '--backend',
        choices=BACKENDS,
        default='loky',
        help='processes of this machine (loky, the default), or a cluster that shares the folders',
    )
    parser.add_argument(
        '--scheduler', metavar='ADDRESS', help='of the cluster, such as tcp://host:8786'
    )


def chosen_workers(arguments: argparse.Namespace) -> Workers:
    """Workers of the options of `add_worker_arguments`."""
    return Workers(arguments.workers, arguments.backend, arguments.scheduler)
