# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns info`: what is there and what is missing, with remedies; it never fails."""

from __future__ import annotations

from importlib import metadata
import json
from pathlib import Path
import shutil
import subprocess
import sys
from typing import Any

import pytest
from rigid_gns_core.commands import cli, info
from rigid_gns_core.files.checkpoint import find_model, WEIGHTS_FOLDER
from rigid_gns_core.kernels.jit import is_compiled


@pytest.fixture(scope='module')
def collected() -> dict[str, Any]:
    return info.collect()


def test_versions_and_parts_are_told(collected: dict[str, Any]) -> None:
    assert collected['version'] == metadata.version('rigid_gns_ros')
    assert collected['libraries']['numpy'] == sys.modules['numpy'].__version__
    assert collected['compiled'] == is_compiled()
    for module, found in collected['optional'].items():
        present = info.importlib.util.find_spec(module) is not None
        assert (found['present'], found['remedy'] is None) == (present, present)
        assert bool(found['version']) == present


def test_nothing_heavy_is_imported() -> None:
    code = (
        'import sys; from rigid_gns_core.commands.info import collect, OPTIONAL; collect(); '
        'print({*OPTIONAL} & {*sys.modules})'
    )
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert done.stdout == 'set()\n'


def test_each_shipped_model_is_described(collected: dict[str, Any]) -> None:
    models = {model['name']: model for model in collected['models']}
    laws = models.pop('laws')
    assert laws['kind'] == 'laws' and laws['default'] and laws['version']
    assert laws['options'] == {'guard': True, 'sleep': True, 'substeps': 8, 'rounds': 4}
    assert set(models) == {path.stem for path in WEIGHTS_FOLDER.glob('*.safetensors')}
    for name, model in models.items():
        assert not model['default']
        card = json.loads((WEIGHTS_FOLDER / f'{name}.json').read_text())
        assert (model['kind'], model['validation']) == (card['kind'], card['validation'])
        assert model['step'] == card['training']['step']
        assert Path(model['path']).stat().st_size == model['bytes']


def test_text_holds_what_the_json_does(
    collected: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    text = info.format_info(collected)
    assert text.startswith(f'rigid_gns_ros   {collected["version"]}\n')
    for name in info.OPTIONAL:
        assert f'\n{name} ' in text
    assert '\nmodel laws (the default)\n' in text and '\nmodel gns\n' in text
    assert 'restitution 0.7746, friction 0.5' in text  # of the GNS
    assert '\n  step         6000\n  steps        6000\n' in text
    assert cli.main(['info', '--json', '--model', 'gns']) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed['libraries'] == collected['libraries']
    assert printed['models'] == [m for m in collected['models'] if m['name'] == 'gns']


def test_a_trained_model_is_described_by_its_path(tmp_path: Path) -> None:
    for suffix in ('.safetensors', '.json'):
        shutil.copy(find_model('gns').with_suffix(suffix), tmp_path / f'best{suffix}')
    described = info.describe_model(str(tmp_path / 'best'))
    assert (described['name'], described['default']) == (str(tmp_path / 'best'), False)


def test_a_damaged_model_does_not_hide_the_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = shutil.copytree(WEIGHTS_FOLDER, tmp_path / 'weights')
    (folder / 'gns.json').write_text('{')
    monkeypatch.setattr('rigid_gns_core.files.checkpoint.WEIGHTS_FOLDER', folder)
    assert cli.main(['info']) == 0
    output = capsys.readouterr().out
    assert 'model gns\n  error        ' in output and 'gns.json: not valid JSON' in output
    assert 'options      guard True, sleep True, substeps 8, rounds 4' in output


def test_what_is_missing_is_told_with_its_remedy(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, 'mujoco', None)
    monkeypatch.setitem(sys.modules, 'rclpy', None)
    assert cli.main(['info']) == 0
    lines = {line.split()[0]: line for line in capsys.readouterr().out.splitlines() if line}
    assert 'missing; for the nodes: source the setup.bash of a ROS 2 Jazzy' in lines['rclpy']
    advice = "missing; for a peer of benchmark: pip install 'mujoco>=3.2'"
    assert advice in lines['mujoco']


def test_cards_are_read_from_the_driver(tmp_path: Path) -> None:
    assert info.graphics_cards(tmp_path) == []
    (tmp_path / '0000:01:00.0').mkdir()
    text = 'Model: \t\t NVIDIA H200\nIRQ:   \t\t 0\n'
    (tmp_path / '0000:01:00.0' / 'information').write_text(text)
    assert info.graphics_cards(tmp_path) == ['NVIDIA H200']
