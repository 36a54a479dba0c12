# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns info`: versions, what is there and what is missing, and the cards of models."""

from __future__ import annotations

import argparse
import importlib.util
import json
from pathlib import Path
import platform
import re
from typing import Any

from .arguments import completes, shipped_models
from ..files.checkpoint import CheckpointError, DEFAULT_MODEL, find_model, LAWS, load_card
from ..installation.extras import remedy
from ..installation.versions import PACKAGE, version_of, versions_of
from ..prediction.laws import LawsSimulator

LIBRARIES = ('numpy', 'scipy', 'numba', 'h5py', 'safetensors', 'mcap', 'joblib')
"""What everything needs."""
# module: (its distributions, what it is for); these are looked for, and not imported
OPTIONAL = {
    'torch': (('torch',), 'train, the model gns'),
    'pybullet': (('pybullet',), 'the teacher: generate, closed-forms'),
    'rclpy': (('rclpy', 'ros-jazzy-rclpy'), 'the nodes'),
    'matplotlib': (('matplotlib',), 'figures'),
    'mujoco': (('mujoco',), 'a peer of benchmark'),
    'distributed': (('distributed',), '--backend dask'),
}
COMPILE = 'python -m rigid_gns_core.engine'

NVIDIA = Path('/proc/driver/nvidia/gpus')


def collect(models: list[str] | None = None) -> dict[str, Any]:
    """All that `rigid-gns info` tells; what is missing is told, not raised.

    Args:
        models: Shipped names or paths; None: all shipped models.

    Raises:
        CheckpointError: One of `models` is not there, or damaged.
    """
    from ..kernels.jit import is_compiled

    return {
        'version': version_of(PACKAGE),
        'python': platform.python_version(),
        'system': f'{platform.system()} {platform.machine()}',
        'libraries': versions_of(LIBRARIES),
        'compiled': is_compiled(),
        'graphics': graphics_cards(),
        'optional': {name: _look_for(name, *about) for name, about in OPTIONAL.items()},
        'models': [describe_model(name) for name in models] if models else _shipped(),
    }


def describe_model(name: str) -> dict[str, Any]:
    """Return what the card of a model says, and where its file is, if it has one.

    Raises:
        CheckpointError: There is no such model, or its card is damaged.
    """
    if name == LAWS:
        card = LawsSimulator().card
        return {'name': name, 'default': name == DEFAULT_MODEL, **card}
    path = find_model(name)
    card = load_card(path)
    training = card['training']
    return {
        'name': path.stem if name == path.stem else name,
        'default': name == DEFAULT_MODEL,
        'path': str(path),
        'bytes': path.stat().st_size,
        'kind': card['kind'],
        'step': training.get('step'),
        'steps': training.get('steps'),
        'data': training.get('data'),
        'trajectories': training.get('trajectories'),
        'materials': card['materials'],
        'validation': card['validation'],
    }


def _shipped() -> list[dict[str, Any]]:
    cards = []
    for name in shipped_models():
        try:
            cards.append(describe_model(name))
        except (CheckpointError, OSError) as error:
            cards.append({'name': name, 'error': str(error)})
    return cards


def graphics_cards(folder: Path = NVIDIA) -> list[str]:
    """NVIDIA cards that a driver knows, whether torch can use them or not."""
    texts = [path.read_text(errors='replace') for path in sorted(folder.glob('*/information'))]
    return re.findall(r'^Model:\s*(.+?)\s*$', '\n'.join(texts), re.M)


def _look_for(module: str, distributions: tuple[str, ...], purpose: str) -> dict[str, Any]:
    present = importlib.util.find_spec(module) is not None
    versions = [version for name in distributions if (version := version_of(name))]
    return {
        'for': purpose,
        'present': present,
        'version': versions[0] if present and versions else None,
        'remedy': None if present else remedy(module),
    }


def format_info(info: dict[str, Any]) -> str:
    """All of it as text, for people and for bug reports."""
    slow = f'not compiled yet, so that the first prediction takes two to three minutes: {COMPILE}'
    rows = {
        PACKAGE: info['version'] or 'a source tree that is not installed',
        'Python': f'{info["python"]}, {info["system"]}',
        'libraries': ', '.join(f'{name} {version}' for name, version in info['libraries'].items()),
        'engine': 'compiled' if info['compiled'] else slow,
        'GPU': ', '.join(info['graphics']) or 'none',
    }
    for name, found in info['optional'].items():
        advice = f': {found["remedy"]}' if found['remedy'] else ''
        rows[name] = f'missing; for {found["for"]}{advice}'
        if found['present']:
            rows[name] = found['version'] or 'present'
    lines = [f'{name:15} {text}' for name, text in rows.items()]
    return '\n'.join([*lines, *map(_model_text, info['models'])])


def _model_text(model: dict[str, Any]) -> str:
    head = f'\nmodel {model["name"]}' + (' (the default)' if model.get('default') else '')
    lines = [head]
    for name, value in model.items():
        if isinstance(value, dict):
            value = ', '.join(f'{key} {part}' for key, part in value.items())
        if name not in ('name', 'default'):
            lines.append(f'  {name:12} {value}')
    return '\n'.join(lines)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `rigid-gns info`."""
    model = parser.add_argument(
        '--model', nargs='+', metavar='NAME', help='shipped names or paths (default: all shipped)'
    )
    completes(model, shipped_models)
    parser.add_argument('--json', action='store_true', help='as JSON, for a script')
    parser.epilog = (
        'examples:\n'
        '  rigid-gns info\n'
        '  rigid-gns info --json\n'
        '  rigid-gns info --model runs/gns/best'
    )


def run(arguments: argparse.Namespace) -> int:
    """Print it; 0, whatever is missing."""
    info = collect(arguments.model)
    print(json.dumps(info, indent=1) if arguments.json else format_info(info))
    return 0
