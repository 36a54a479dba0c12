"""Weights on disk: safetensors plus a JSON card beside it. Pickle is never read."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save

FORMAT_VERSION = 1
WEIGHTS_FOLDER = Path(__file__).resolve().parent / 'weights'
DEFAULT_MODEL = 'gns'


class CheckpointError(ValueError):
    """A checkpoint cannot be used."""


def save_tensors(path: Path, tensors: dict[str, torch.Tensor]) -> None:
    """Write safetensors under a temporary name first: a killed run leaves the old file whole."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(path.name + '.part')
    temporary.write_bytes(save({name: value.contiguous() for name, value in tensors.items()}))
    os.replace(temporary, path)


def load_tensors(path: Path) -> dict[str, torch.Tensor]:
    """Read safetensors.

    Raises:
        CheckpointError: The file is missing or damaged.
    """
    if not path.is_file():
        raise CheckpointError(f'{path}: no such file')
    try:
        return load_file(path)
    except (SafetensorError, OSError) as error:
        raise CheckpointError(f'{path}: damaged safetensors file: {error}') from error


def save_model(path: str | Path, network: torch.nn.Module, card: dict[str, Any]) -> None:
    """Write `path`.safetensors and `path`.json; the card gets the format version."""
    path = Path(path)
    save_tensors(path.with_suffix('.safetensors'), dict(network.state_dict()))
    card = {'format_version': FORMAT_VERSION, **card}
    text = json.dumps(card, indent=2, allow_nan=False) + '\n'
    temporary = path.with_suffix('.json.part')
    temporary.write_text(text, encoding='utf-8')
    os.replace(temporary, path.with_suffix('.json'))


def find_model(name: str | Path | None = None) -> Path:
    """Path of a model's .safetensors: of a shipped name, a path (suffix or not), or the default.

    Raises:
        CheckpointError: There is no such model; the shipped ones are listed.
    """
    name = DEFAULT_MODEL if name in (None, '') else name
    shipped = {path.stem: path for path in sorted(WEIGHTS_FOLDER.glob('*.safetensors'))}
    if str(name) in shipped:
        return shipped[str(name)]
    path = Path(str(name))
    path = path if path.suffix == '.safetensors' else path.with_name(path.name + '.safetensors')
    if path.is_file():
        return path
    raise CheckpointError(
        f'no model {str(name)!r}: neither a file {path} nor one of the shipped '
        f'({", ".join(shipped) or "none"})'
    )


def load_card(path: Path) -> dict[str, Any]:
    """Read the JSON card beside a .safetensors file.

    Raises:
        CheckpointError: It is missing, damaged, or of another format version.
    """
    card_path = path.with_suffix('.json')
    try:
        card = json.loads(card_path.read_text(encoding='utf-8'))
    except FileNotFoundError:
        raise CheckpointError(f'{path}: its card {card_path.name} is missing') from None
    except json.JSONDecodeError as error:
        raise CheckpointError(f'{card_path}: not valid JSON: {error}') from error
    version = card.get('format_version') if isinstance(card, dict) else None
    if version != FORMAT_VERSION:
        raise CheckpointError(
            f'{card_path}: format_version is {version!r}, this program reads {FORMAT_VERSION}; '
            'train again or use the program version that wrote it'
        )
    return card


def load_weights(network: torch.nn.Module, path: Path) -> None:
    """Fill `network` from a .safetensors file.

    Raises:
        CheckpointError: Names or shapes differ from the network's, or a weight is not finite.
    """
    tensors = load_tensors(path)
    expected = network.state_dict()
    for name in sorted(set(expected) ^ set(tensors)):
        raise CheckpointError(
            f'{path}: weight {name!r} is {"missing" if name in expected else "unknown"}; '
            'weights and card do not belong together'
        )
    for name, value in tensors.items():
        if value.shape != expected[name].shape:
            raise CheckpointError(
                f'{path}: weight {name!r} has shape {tuple(value.shape)}, '
                f'expected {tuple(expected[name].shape)}'
            )
        if not torch.isfinite(value).all():
            raise CheckpointError(f'{path}: weight {name!r} holds values that are not finite')
    network.load_state_dict(tensors)
