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
from ..installation.probes import Probes
from ..installation.versions import PACKAGE, version_of, versions_of
from ..prediction.laws import LawsSimulator

LIBRARIES = ('numpy', 'scipy', 'numba', 'h5py', 'safetensors', 'mcap', 'joblib')
"""What everything needs."""
# module: (distribution, what it is for); these are looked for, and not imported
OPTIONAL = {
    'matplotlib': ('matplotlib', 'figures'),
    'mujoco': ('mujoco', 'a peer of benchmark'),
    'distributed': ('distributed', '--backend dask'),
}

NVIDIA = Path('/proc/driver/nvidia/gpus')


def collect(models: list[str] | None = None) -> dict[str, Any]:
    """All that `rigid-gns info` tells; what is missing or broken is told, not raised.

    Args:
        models: Shipped names or paths; None: all shipped models.

    Raises:
        CheckpointError: One of `models` is not there, or damaged.
    """
    cards = [describe_model(name) for name in models] if models else _shipped()
    with Probes() as probes:  # which run while the rest is looked up
        optional = {name: _look_for(name, *about) for name, about in OPTIONAL.items()}
        libraries = versions_of(LIBRARIES)
        found = probes.results()
    return {
        'version': version_of(PACKAGE),
        'python': platform.python_version(),
        'system': f'{platform.system()} {platform.machine()}',
        'libraries': libraries,
        **found,
        'graphics': graphics_cards(),
        'optional': optional,
        'models': cards,
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


def _look_for(module: str, distribution: str, purpose: str) -> dict[str, Any]:
    present = importlib.util.find_spec(module) is not None
    return {
        'for': purpose,
        'present': present,
        'version': version_of(distribution) if present else None,
        'remedy': None if present else remedy(module),
    }


def format_info(info: dict[str, Any]) -> str:
    """All of it as text, for people and for bug reports."""
    libraries = ', '.join(f'{name} {version}' for name, version in info['libraries'].items())
    rows = [
        (PACKAGE, info['version'] or 'a source tree that is not installed'),
        ('Python', f'{info["python"]}, {info["system"]}'),
        ('libraries', libraries),
        ('engine', _engine(info['engine'])),
        ('torch', _probed(info['torch'], 'train, the model gns')),
        ('GPU', _gpu(info['torch'], info['graphics'])),
        ('pybullet', _probed(info['pybullet'], 'the teacher: generate, closed-forms')),
        ('ROS', _ros(info['ros'])),
    ]
    for name, found in info['optional'].items():
        text = found['version'] or 'present'
        rows.append((name, text if found['present'] else _missing(found['for'], found['remedy'])))
    lines = [f'{name:15} {text}' for name, text in rows]
    return '\n'.join([*lines, *(line for model in info['models'] for line in _model_lines(model))])


def _missing(purpose: str, advice: str | None) -> str:
    return f'missing; for {purpose}' + (f': {advice}' if advice else '')


def _probed(found: dict[str, Any], purpose: str) -> str:
    if found['state'] == 'missing':
        return _missing(purpose, found['remedy'])
    if found['state'] == 'broken':
        return f'{found["version"] or "present"}, but it does not work: {found["error"]}'
    return found['version'] or 'present'


def _engine(found: dict[str, Any]) -> str:
    if found['state'] != 'ready':
        return _probed(found, 'prediction')
    if found['compiled']:
        return 'compiled'
    return f'not compiled yet, so that the first prediction takes a minute: {found["remedy"]}'


def _gpu(torch: dict[str, Any], cards: list[str]) -> str:
    if torch.get('gpus'):
        return ', '.join(torch['gpus']) + f' (CUDA {torch["cuda"]})'
    if not cards:
        return 'none'
    seen = ', '.join(cards)
    if torch['state'] != 'ready':
        return f'{seen}, but no torch to use it'
    if torch['cuda'] is None:
        return f'{seen}, but this torch is a build for the CPU: pytorch.org/get-started has others'
    return (
        f'{seen}, but torch cannot use it: look at nvidia-smi for the CUDA version of the driver'
    )


def _ros(found: dict[str, Any]) -> str:
    text = _probed(found, 'the nodes')
    if found['state'] != 'ready':
        return text
    distribution = f'{found["distribution"]}, ' if found['distribution'] else ''
    return f'{distribution}rclpy {text}, {found["rmw"]}'


def _model_lines(model: dict[str, Any]) -> list[str]:
    head = f'\nmodel {model["name"]}' + (' (the default)' if model.get('default') else '')
    if 'error' in model:
        return [head, f'  damaged: {model["error"]}']
    if model['kind'] == LAWS:
        options = ', '.join(f'{name} {value}' for name, value in model['options'].items())
        return [head, *_rows({'kind': model['kind'], 'options': options})]
    materials = ', '.join(
        f'{name} {value[0]:.3g} to {value[1]:.3g}'
        if isinstance(value, list)
        else f'{name} {value}'
        for name, value in model['materials'].items()
    )
    scores = ', '.join(
        f'{name} ' + ('none' if value is None else f'{value:.4g}')
        for name, value in model['validation'].items()
    )
    rows = {
        'file': f'{model["path"]} ({model["bytes"] / 1e3:.0f} kB)',
        'kind': model['kind'],
        'trained': f'best of {model["steps"]} steps: that after step {model["step"]}, on '
        f'{model["trajectories"]} trajectories of {model["data"]}',
        'materials': materials,
        'validation': scores,
    }
    return [head, *_rows(rows)]


def _rows(rows: dict[str, str]) -> list[str]:
    return [f'  {name:10} {text}' for name, text in rows.items()]


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
