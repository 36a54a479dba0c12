# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trained models on disk: safetensors with a JSON card beside them. Pickle is never read."""

from __future__ import annotations

from collections.abc import Mapping
import hashlib
import json
import os
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load_file, save

from .atomic_file import whole_file
from .strict_json import parse_json
from ..errors import shown, UserError

FORMAT_VERSION = 1
WEIGHTS_FOLDER = Path(__file__).resolve().parents[1] / 'weights'
LAWS = 'laws'
"""Name of the laws of rigid contact, a model without weights."""
DEFAULT_MODEL = LAWS
CARD_KEYS = {
    'format_version',
    'kind',
    'config',
    'units',
    'materials',
    'training',
    'validation',
    'weights_sha256',
}


Tensors = dict[str, NDArray[Any]]


class Network(Protocol):
    """A network with weights: a torch.nn.Module."""

    def state_dict(self) -> Any:
        """Tensors by name."""
        ...


class CheckpointError(UserError):
    """A checkpoint cannot be used."""


def tensors_of(network: Network) -> Tensors:
    """Weights of a network by name."""
    return {name: value.detach().cpu().numpy() for name, value in network.state_dict().items()}


def save_tensors(path: Path, tensors: Mapping[str, NDArray[Any]]) -> None:
    """Write safetensors, whole or not at all."""
    with whole_file(path) as partial:
        partial.write_bytes(_packed(tensors))


def load_tensors(path: Path) -> Tensors:
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


def save_model(path: str | Path, network: Network, card: dict[str, Any]) -> None:
    """Write weights to `path`.safetensors, and the card with their SHA-256 to `path`.json."""
    save_weights(path, tensors_of(network), card)


def save_weights(path: str | Path, tensors: Mapping[str, NDArray[Any]], card: Any) -> None:
    """As `save_model`, of weights by name.

    A process that is killed between the two files leaves the new card beside them, for
    `finish_saving`.
    """
    weights, card_path = Path(f'{path}.safetensors'), Path(f'{path}.json')
    content = _packed(tensors)
    stamps = {'format_version': FORMAT_VERSION, 'weights_sha256': _sha256(content)}
    text = json.dumps({**card, **stamps}, indent=2, allow_nan=False) + '\n'
    coming = _coming(card_path)
    with whole_file(coming) as partial:
        partial.write_text(text, encoding='utf-8')
    try:
        with whole_file(weights) as partial:
            partial.write_bytes(content)
    finally:
        finish_saving(path)  # also where Ctrl-C comes just then


def finish_saving(path: str | Path) -> None:
    """Put the card in place that belongs to the weights, where a kill came before it."""
    weights, card_path = Path(f'{path}.safetensors'), Path(f'{path}.json')
    coming = _coming(card_path)
    if not coming.is_file():
        return
    card = parse_json(coming.read_bytes())
    if weights.is_file() and _sha256(weights.read_bytes()) == card['weights_sha256']:
        os.replace(coming, os.path.realpath(card_path))
    coming.unlink(missing_ok=True)


def _coming(card_path: Path) -> Path:
    path = Path(os.path.realpath(card_path))
    return path.with_name(f'.{path.name}.next')


def _packed(tensors: Mapping[str, NDArray[Any]]) -> bytes:
    return save({name: np.asarray(value, order='C') for name, value in tensors.items()})


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def shipped_networks() -> dict[str, Path]:
    """Paths of the shipped weights, by name of the model."""
    return {path.stem: path for path in sorted(WEIGHTS_FOLDER.glob('*.safetensors'))}


def find_model(name: str | Path) -> Path:
    """Path of the .safetensors of a trained model.

    Args:
        name: A shipped name, or a path with or without the suffix.

    Raises:
        CheckpointError: There is no such model; the shipped ones are listed.
    """
    shipped = shipped_networks()
    if str(name) in shipped:
        return shipped[str(name)]
    path = Path(str(name))
    path = path if path.suffix == '.safetensors' else Path(f'{path}.safetensors')
    if path.is_file():
        return path
    raise CheckpointError(
        f'no model {str(name)!r}: neither a file {path} nor one of the shipped '
        f'({", ".join([LAWS, *shipped])})'
    )


def load_card(path: Path) -> dict[str, Any]:
    """Read the JSON card beside a .safetensors file.

    Raises:
        CheckpointError: It is missing, damaged, or of another format version.
    """
    card_path = path.with_suffix('.json')
    try:
        card: dict[str, Any] = parse_json(card_path.read_bytes())
    except FileNotFoundError:
        raise CheckpointError(f'{path}: its card {card_path.name} is missing') from None
    except UserError as error:
        raise CheckpointError(f'{card_path}: {error}') from error
    version = card.get('format_version') if isinstance(card, dict) else None
    if version != FORMAT_VERSION or version is True:
        raise CheckpointError(
            f'{card_path}: format_version is {shown(version)}, this program reads '
            f'{FORMAT_VERSION}; train again or use the program version that wrote it'
        )
    for key in sorted(CARD_KEYS - set(card)):
        raise CheckpointError(f'{card_path}: {key} is missing')
    for key in sorted(set(card) - CARD_KEYS):
        raise CheckpointError(
            f'{card_path}: unknown key {shown(key)}, allowed: {", ".join(sorted(CARD_KEYS))}'
        )
    return card


def load_weights(path: Path, sha256: str) -> Tensors:
    """Weights of a .safetensors file.

    Args:
        path: The file.
        sha256: Of the file that its card was written with.

    Raises:
        CheckpointError: The file is another one, or a weight is not float32 or not finite.
    """
    tensors = load_tensors(path)
    if _sha256(path.read_bytes()) != sha256:
        raise CheckpointError(
            f'{path}: is not the file that its card was written with (SHA-256 differs); '
            'copy both files again'
        )
    for name, value in tensors.items():
        if value.dtype != np.float32:
            raise CheckpointError(f'{path}: weight {name!r} is {value.dtype}, expected float32')
        if not np.isfinite(value).all():
            raise CheckpointError(f'{path}: weight {name!r} holds values that are not finite')
    return tensors
