# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

# PYTHON_ARGCOMPLETE_OK
"""`rigid-gns`: commands, each in a module with its options that is imported on demand."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import suppress
import importlib
import io
import os
import select
import sys
from typing import Any

from ..errors import UserError

# name: (module with add_arguments(parser) and run(arguments) -> int, one-line help), for newcomers
# first
COMMANDS: dict[str, tuple[str, str]] = {
    'info': (
        'rigid_gns_core.commands.info',
        'what is installed, what is missing, the shipped models',
    ),
    'rollout': ('rigid_gns_core.commands.rollout', 'predict a trajectory from start positions'),
    'report': (
        'rigid_gns_core.commands.report',
        'one HTML file of a rollout or a bag: replay, curves, numbers',
    ),
    'evaluate': (
        'rigid_gns_core.commands.evaluate',
        'score predictions on data or a recorded bag',
    ),
    'import': (
        'rigid_gns_core.commands.import_bags',
        'make a data set of the tracked poses in bags and CSV files',
    ),
    'calibrate': (
        'rigid_gns_core.commands.calibrate',
        'fit air, contacts, spins and the frame to tracked positions, or materials to poses',
    ),
    'generate': (
        'rigid_gns_core.commands.generate',
        'generate Bullet trajectories into a folder of HDF5 files',
    ),
    'train': ('rigid_gns_core.commands.train', 'train a simulator from a YAML recipe'),
    'benchmark': (
        'rigid_gns_core.commands.benchmark',
        'speed against error, beside Bullet, MuJoCo and what other engines are installed',
    ),
    'hard-cases': (
        'rigid_gns_core.commands.hard_cases',
        'check the stability of simulators on hard cases',
    ),
    'fuzz': (
        'rigid_gns_core.commands.fuzz',
        'check laws and symmetries of the laws of contact on random scenes',
    ),
    'experiment': (
        'rigid_gns_core.commands.experiment',
        "the thesis' experiments, and worlds to learn: train, score, tables and figures",
    ),
    'closed-forms': (
        'rigid_gns_core.commands.closed_forms',
        'check the teacher, or a model, against closed forms',
    ),
}
EPILOG = """examples:
  rigid-gns info
  rigid-gns rollout --scene box_154 --steps 200 --out rollout.h5
  rigid-gns rollout --help

rigid-gns COMMAND --help shows the options of a command and an example.
eval "$(register-python-argcomplete rigid-gns)" lets the shell complete them.

exit code:
  0    done
  1    done, and a check failed
  2    bad input, or something is missing: the last line on standard error says what to do
  130  interrupted (Ctrl-C); generate, train and experiment resume when given again
  141  the reader of the output has closed it, as `head` does"""
CHECK_FAILED, BAD_INPUT, INTERRUPTED, NO_READER = 1, 2, 130, 141


def main(argv: Sequence[str] | None = None) -> int:
    """Run `rigid-gns COMMAND ...`; the exit code, see `EPILOG`."""
    _open_closed()
    if isinstance(sys.stdout, io.TextIOWrapper):  # an ASCII terminal has no ± and no m²
        sys.stdout.reconfigure(errors='replace')
    try:
        try:
            return _run(sys.argv[1:] if argv is None else list(argv))
        finally:
            sys.stdout.flush()  # here, where a closed pipe can be handled
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # for the flush at the exit
        return NO_READER


def evaluate(argv: Sequence[str] | None = None) -> int:
    """Run `rigid-gns evaluate ...` as the executable `evaluate` of `ros2 run`; the exit code."""
    return main(['evaluate', *(sys.argv[1:] if argv is None else argv)])


def make_parser(command: str | None = None) -> argparse.ArgumentParser:
    """Parser of all commands, with the options of one of them.

    Raises:
        ModuleNotFoundError: The command needs a module that is not installed.
    """
    parser = argparse.ArgumentParser(
        prog='rigid-gns',
        description='Simulators of rigid spheres: laws and learned.',
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument('--version', action=_Version, help='show the version and exit')
    subparsers = parser.add_subparsers(
        dest='command', required=True, metavar='COMMAND', parser_class=_CommandParser
    )
    for name, (module, text) in COMMANDS.items():
        subparser = subparsers.add_parser(
            name,
            help=text,
            description=text[0].upper() + text[1:] + '.',
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        if name == command:
            stage = importlib.import_module(module)
            stage.add_arguments(subparser)
            subparser.set_defaults(run=stage.run)
    return parser


class _CommandParser(argparse.ArgumentParser):
    """Parser of a command, which shows its own usage for unknown arguments."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        known, unknown = super().parse_known_args(args, namespace)
        if unknown:  # `rigid-gns` would show its own usage, without the options of the command
            self.error(f'unrecognized arguments: {" ".join(unknown)}')
        return known, unknown


class _Version(argparse.Action):
    """`--version`, which looks up the version on demand."""

    def __init__(self, option_strings: Sequence[str], dest: str, help: str) -> None:  # noqa: A002
        super().__init__(option_strings, dest, nargs=0, help=help)

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from ..installation.versions import PACKAGE, version_of

        print(f'{parser.prog} {version_of(PACKAGE) or "of a source tree that is not installed"}')
        parser.exit()


def _run(argv: list[str]) -> int:
    if '_ARGCOMPLETE' in os.environ:
        _complete()
    command = _command(argv)
    name = f'rigid-gns {command}' if command in COMMANDS else 'rigid-gns'
    try:
        arguments = make_parser(command).parse_args(argv)
        return int(arguments.run(arguments) or 0)
    except ModuleNotFoundError as error:
        _say(f'{name}: error: {_with_remedy(error)}')
        return BAD_INPUT
    except MemoryError as error:
        _say(f'{name}: error: this needs more memory than there is: {error}')
        return BAD_INPUT
    except (UserError, OSError, FloatingPointError) as error:
        if isinstance(error, BrokenPipeError) and _reader_left():
            raise
        _say(f'{name}: error: {error}')
        return BAD_INPUT
    except KeyboardInterrupt:
        _say(f'{name}: interrupted')
        return INTERRUPTED


def _say(text: str) -> None:
    with suppress(OSError):  # the exit code tells, too
        print(text, file=sys.stderr)


def _open_closed() -> None:
    """Open /dev/null for standard streams that are closed: a file of ours would take its place."""
    for name, mode in (('stdin', 'r'), ('stdout', 'w'), ('stderr', 'w')):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode))  # noqa: SIM115 - for the whole process


def _with_remedy(error: ModuleNotFoundError) -> str:
    """Message on a missing module with its remedy; errors of this package have one already."""
    from ..installation.extras import missing

    if error.name is None or 'which is not installed' in str(error):
        return str(error)
    if error.name.partition('.')[0] in ('rigid_gns_core', 'rigid_gns_ros'):
        raise error  # a bug: no input makes a module of this package missing
    return str(missing(error, 'this command'))


def _reader_left() -> bool:
    """Whether the reader of standard output has closed it."""
    poll = select.poll()
    poll.register(sys.stdout.fileno(), select.POLLOUT)
    return any(event & (select.POLLERR | select.POLLHUP) for _, event in poll.poll(0))


def _complete() -> None:
    """Print completions for the shell, and exit."""
    import argcomplete

    typed = os.environ['COMP_LINE'][: int(os.environ['COMP_POINT'])]
    argcomplete.autocomplete(
        make_parser(_command(typed.split()[1:])), always_complete_options='long'
    )


def _command(words: Sequence[str]) -> str | None:
    return next((word for word in words if not word.startswith('-')), None)


if __name__ == '__main__':
    sys.exit(main())
