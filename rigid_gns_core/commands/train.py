# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns train`: trains a model; its options are here, for completion without torch."""

from __future__ import annotations

import argparse
from pathlib import Path

from .arguments import completes, configs, positive, seed_number, shipped_models


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `rigid-gns train`."""
    config = parser.add_argument(
        '--config', default='gns', help='recipe: a file or a name in config/train'
    )
    completes(config, configs('train'))
    parser.add_argument(
        '--data', required=True, type=Path, nargs='+', help='folders made by generate'
    )
    parser.add_argument('--validation', type=Path, help='held-out data to choose the best weights')
    parser.add_argument(
        '--out', required=True, type=Path, help='folder of the run; an existing run is resumed'
    )
    scene = parser.add_argument(
        '--scene',
        metavar='NAME|FILE',
        help='scene of all records instead of their own, such as the one that calibrate fitted',
    )
    completes(scene, configs('scenes'))
    start = parser.add_argument(
        '--from', dest='start', metavar='MODEL', help='weights to start from: a name or a path'
    )
    completes(start, shipped_models)
    parser.add_argument('--steps', type=int, help="optimiser steps instead of the recipe's")
    parser.add_argument('--seed', type=seed_number, help="seed instead of the recipe's")
    parser.add_argument('--threads', type=positive, default=1, help='CPU threads (default 1)')
    parser.add_argument(
        '--device',
        choices=('auto', 'cpu', 'cuda'),
        default='auto',
        help='where the network is trained; auto: CUDA where there is one (default). '
        'The same seed gives the same bytes on the CPU, but not on CUDA',
    )
    parser.epilog = (
        'examples:\n'
        '  rigid-gns train --config gns --data data/gns --validation data/gns_validation '
        '--out runs/gns\n'
        '  rigid-gns evaluate --model runs/gns/best --data data/gns_test\n'
        '  rigid-gns train --config residual --data data/lab --scene lab.yaml --out runs/lab'
    )


def run(arguments: argparse.Namespace) -> int:
    """Run `rigid-gns train`; the exit code."""
    from ..training.train import run as train

    return train(arguments)
