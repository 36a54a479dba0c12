"""`rigid-gns`: one command per stage, whose module owns its options and is imported on demand."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence

# name: (module with add_arguments(parser) and run(arguments) -> int, one-line help)
COMMANDS: dict[str, tuple[str, str]] = {
    'teacher-card': ('rigid_gns_core.teacher_card', 'check the teacher against closed forms'),
    'generate': (
        'rigid_gns_core.generate',
        'generate Bullet trajectories into a folder of HDF5 files',
    ),
    'import': ('rigid_gns_ros.learning.import_bag', 'make a data set of the tracked poses in bags'),
    'calibrate': ('rigid_gns_core.calibrate', 'fit materials to tracked poses'),
    'train': ('rigid_gns_core.train', 'train a simulator from a YAML recipe'),
    'rollout': ('rigid_gns_core.predict', 'predict a trajectory from start positions'),
    'evaluate': ('rigid_gns_core.evaluate', 'score predictions on data or a recorded bag'),
    'report': (
        'rigid_gns_core.report.command',
        'one HTML file of a rollout or a bag: replay, curves, numbers',
    ),
    'view': ('rigid_gns_core.view', 'a rollout or a bag in the viewer Rerun'),
    'render': ('rigid_gns_core.render.command', 'a moving picture of a rollout or a bag'),
    'hard-cases': (
        'rigid_gns_core.hard_cases.command',
        'check the stability of simulators on hard cases',
    ),
    'benchmark': (
        'rigid_gns_core.benchmark.command',
        'speed against error, beside Bullet and MuJoCo',
    ),
    'experiment': (
        'rigid_gns_core.experiments.command',
        "the thesis' experiments: train variants, score them, tables and figures",
    ),
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run `rigid-gns COMMAND ...`; returns the exit code: 0 done, 1 a check failed, 2 bad input."""
    argv = sys.argv[1:] if argv is None else list(argv)
    parser = argparse.ArgumentParser(
        prog='rigid-gns',
        description='Learned simulators of rigid spheres.',
        epilog='rigid-gns COMMAND --help shows the options of a command and an example.',
    )
    subparsers = parser.add_subparsers(dest='command', required=True, metavar='COMMAND')
    chosen = next((word for word in argv if not word.startswith('-')), None)
    for name, (module, text) in COMMANDS.items():
        subparser = subparsers.add_parser(
            name,
            help=text,
            description=text[0].upper() + text[1:] + '.',
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        if name == chosen:
            try:
                stage = importlib.import_module(module)
            except ModuleNotFoundError as error:
                print(
                    f'rigid-gns {name}: error: {error}; this command needs an extra: '
                    "pip install 'rigid_gns_ros[torch,teacher,plot]'",
                    file=sys.stderr,
                )
                return 2
            stage.add_arguments(subparser)
            subparser.set_defaults(run=stage.run)
    arguments = parser.parse_args(argv)
    try:
        return int(arguments.run(arguments) or 0)
    except (ValueError, OSError, FloatingPointError, ModuleNotFoundError) as error:
        print(f'rigid-gns {arguments.command}: error: {error}', file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f'rigid-gns {arguments.command}: interrupted', file=sys.stderr)
        return 130


if __name__ == '__main__':
    sys.exit(main())
