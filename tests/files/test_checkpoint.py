# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A loader refuses what it does not know, and says what and why."""

import json
import os
from pathlib import Path

from killed_writes import killed_at
import numpy as np
import pytest
from rigid_gns_core.files.checkpoint import (
    CARD_KEYS,
    CheckpointError,
    find_model,
    finish_saving,
    load_card,
    load_weights,
    save_model,
    save_weights,
)
from rigid_gns_core.files.config import to_mapping
from rigid_gns_core.gns.config import GNSConfig
from rigid_gns_core.gns.network import GNS
from rigid_gns_core.prediction.load import load_simulator
import torch

CONFIG = GNSConfig(message_passing_steps=1, width=8)
CARD_CONFIG = to_mapping(CONFIG)


@pytest.fixture
def saved(tmp_path):
    card = {
        'kind': 'gns',
        'config': to_mapping(CONFIG),
        'units': {'radius': 1.0, 'gravity': 9.81, 'dt': 0.1},
        'materials': {'restitution': 0.6, 'friction': 0.5, 'rolling_friction': 0.02},
        'training': {},
        'validation': {},
    }
    save_model(tmp_path / 'model', GNS(CONFIG), card)
    return tmp_path / 'model.safetensors'


def change_card(path, **changes):
    card_path = path.with_suffix('.json')
    card_path.write_text(json.dumps({**json.loads(card_path.read_text()), **changes}))


def test_weights_come_back_as_they_were(saved):
    torch.manual_seed(3)
    network = GNS(CONFIG)
    save_model(saved.with_suffix(''), network, load_card(saved))
    loaded = load_simulator(saved).network.state_dict()
    for name, value in network.state_dict().items():
        torch.testing.assert_close(loaded[name], value, rtol=0, atol=0)


def test_path_works_with_and_without_suffix(saved):
    assert load_simulator(saved).name == load_simulator(saved.with_suffix('')).name == 'model'


def test_unknown_model_lists_the_shipped_ones():
    with pytest.raises(CheckpointError, match=r"no model 'nosuch'.*gns"):
        find_model('nosuch')


def test_missing_card(saved):
    saved.with_suffix('.json').unlink()
    with pytest.raises(CheckpointError, match='card model.json is missing'):
        load_simulator(saved)


@pytest.mark.parametrize(
    ('changes', 'message'),
    [
        ({'format_version': 99}, 'format_version is 99, this program reads 1'),
        ({'kind': 'mystery'}, "kind 'mystery'"),
        ({'colour': 'red'}, "unknown key 'colour', allowed: config, format_version"),
        ({'config': {**CARD_CONFIG, 'widht': 8}}, "unknown key 'widht', allowed: .*width"),
        ({'config': {'width': 8}}, 'lacks connectivity, epsilon'),
        ({'config': {**CARD_CONFIG, 'width': 16}}, 'size mismatch for '),
        ({'config': {**CARD_CONFIG, 'message_passing_steps': 2}}, 'Missing key.*blocks.1'),
        ({'units': {'radius': 0.0, 'gravity': 9.81, 'dt': 0.1}}, 'radius is 0.0, expected a pos'),
        ({'units': {'radius': 1.0}}, "missing key 'gravity'"),
        ({'materials': None}, 'expected a mapping'),
    ],
)
def test_a_card_that_does_not_fit(saved, changes, message):
    change_card(saved, **changes)
    with pytest.raises(ValueError, match=message):
        load_simulator(saved)


def test_a_card_without_units(saved):
    path = saved.with_suffix('.json')
    card = json.loads(path.read_text())
    del card['units']
    path.write_text(json.dumps(card))
    with pytest.raises(CheckpointError, match='units is missing'):
        load_simulator(saved)


def test_one_changed_bit_is_noticed(saved):
    content = bytearray(saved.read_bytes())
    content[-3] ^= 1
    saved.write_bytes(content)
    with pytest.raises(CheckpointError, match='SHA-256 differs'):
        load_simulator(saved)


def test_a_name_with_a_dot(saved, tmp_path):
    network = load_simulator(saved).network
    card = {
        k: v for k, v in load_card(saved).items() if k not in ('format_version', 'weights_sha256')
    }
    save_model(tmp_path / 'v1.2', network, card)
    assert load_simulator(tmp_path / 'v1.2').name == 'v1.2'


def test_truncated_weights(saved):
    saved.write_bytes(saved.read_bytes()[:-100])
    with pytest.raises(CheckpointError, match='damaged'):
        load_simulator(saved)


def test_weights_that_are_not_finite(saved):
    network = GNS(CONFIG)
    with torch.no_grad():
        network.decoder.bias[0] = float('nan')
    save_model(saved.with_suffix(''), network, load_card(saved))
    with pytest.raises(CheckpointError, match='decoder.bias.*not finite'):
        load_simulator(saved)


def test_a_save_that_is_killed_between_its_files_can_be_finished(tmp_path, monkeypatch):
    """Of three files that are put in place, a kill before any leaves the old pair or the new."""
    old, new = ({'w': np.full(3, value, np.float32)} for value in (1.0, 2.0))
    card = dict.fromkeys(CARD_KEYS, '')
    for last in (1, 2, 3):
        path = tmp_path / f'{last}'
        save_weights(path, old, card)
        with monkeypatch.context() as patched:
            patched.setattr(os, 'replace', killed_at(last))
            patched.setattr(Path, 'unlink', lambda *_, **__: None)  # a kill cleans nothing
            with pytest.raises(MemoryError):
                save_weights(path, new, card)
        finish_saving(path)
        weights = path.with_suffix('.safetensors')
        found = load_weights(weights, load_card(weights)['weights_sha256'])
        assert found['w'][0] == (2.0 if last == 3 else 1.0)
        assert not list(tmp_path.glob('.*.next'))
