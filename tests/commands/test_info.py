# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns info`: what is there and what is missing, with remedies; it never fails."""

from __future__ import annotations

from importlib import metadata
import json
from pathlib import Path
import shutil
import sys
from typing import Any

import pytest
from rigid_gns_core.commands import cli, info
from rigid_gns_core.files.checkpoint import find_model, WEIGHTS_FOLDER
from rigid_gns_core.installation import probes


@pytest.fixture(scope='module')
def collected() -> dict[str, Any]:
    return info.collect()


def test_versions_and_parts_are_told(collected: dict[str, Any]) -> None:
    assert collected['version'] == metadata.version('rigid_gns_ros')
    assert collected['libraries']['numpy'] == sys.modules['numpy'].__version__
    assert collected['engine']['state'] == 'ready'
    for name, module in (('torch', 'torch'), ('pybullet', 'pybullet'), ('ros', 'rclpy')):
        present = info.importlib.util.find_spec(module) is not None
        assert collected[name]['state'] == ('ready' if present else 'missing')
        assert (collected[name]['remedy'] is None) == present


def test_gpu_is_what_torch_says(collected: dict[str, Any]) -> None:
    torch = pytest.importorskip('torch')
    count = torch.cuda.device_count() if torch.cuda.is_available() else 0
    assert collected['torch']['cuda'] == torch.version.cuda
    names = [torch.cuda.get_device_name(index) for index in range(count)]
    assert collected['torch']['gpus'] == names


def test_ros_is_asked_for_its_middleware(collected: dict[str, Any]) -> None:
    pytest.importorskip('rclpy', reason='ROS 2 is not installed')
    assert collected['ros']['rmw'].startswith('rmw_')


def test_engine_tells_whether_it_is_compiled(collected: dict[str, Any]) -> None:
    from rigid_gns_core.kernels.jit import is_compiled

    assert collected['engine']['compiled'] == is_compiled()


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
    assert 'best of 16000 steps: that after step 15000, on 40 trajectories' in text
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
    assert 'model gns\n  damaged: ' in output and 'gns.json: not valid JSON' in output
    assert 'options    guard True, sleep True, substeps 8, rounds 4' in output


def test_what_is_missing_or_broken_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One module that is not there, one that raises, one that takes its process down."""
    (tmp_path / 'torch.py').write_text("raise ImportError('libcudart.so: cannot open')\n")
    (tmp_path / 'pybullet.py').write_text('import os\nos.abort()\n')
    (tmp_path / 'rclpy.py').write_text("raise ModuleNotFoundError('gone', name='rclpy')\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(sys.modules, 'mujoco', None)
    assert cli.main(['info']) == 0
    lines = {line.split()[0]: line for line in capsys.readouterr().out.splitlines() if line}
    assert 'ImportError: libcudart.so: cannot open' in lines['torch']
    assert 'does not work: its process ended with code -6' in lines['pybullet']
    assert 'missing; for the nodes: source the setup.bash of a ROS 2 Jazzy' in lines['ROS']
    advice = "missing; for a peer of benchmark: pip install 'rigid_gns_ros[bench]'"
    assert advice in lines['mujoco']


def test_a_module_that_never_answers_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / 'pybullet.py').write_text('import time\ntime.sleep(1000)\n')
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(probes, 'TIME_LIMIT', 0.1)
    with probes.Probes() as asked:
        assert asked._result('pybullet')['error'] == 'no answer in 0.1 s'


@pytest.mark.parametrize(
    ('torch', 'cards', 'text'),
    [
        ({'state': 'ready', 'cuda': '12.8', 'gpus': ['H200']}, ['H200'], 'H200 (CUDA 12.8)'),
        ({'state': 'ready', 'cuda': None, 'gpus': []}, [], 'none'),
        (
            {'state': 'ready', 'cuda': None, 'gpus': []},
            ['H200'],
            'H200, but this torch is a build',
        ),
        (
            {'state': 'ready', 'cuda': '12.8', 'gpus': []},
            ['H200'],
            'H200, but torch cannot use it',
        ),
        ({'state': 'missing'}, ['H200'], 'H200, but no torch to use it'),
    ],
)
def test_a_card_that_cannot_be_used_says_why(
    torch: dict[str, Any], cards: list[str], text: str
) -> None:
    assert info._gpu(torch, cards).startswith(text)


def test_cards_are_read_from_the_driver(tmp_path: Path) -> None:
    assert info.graphics_cards(tmp_path) == []
    (tmp_path / '0000:01:00.0').mkdir()
    text = 'Model: \t\t NVIDIA H200\nIRQ:   \t\t 0\n'
    (tmp_path / '0000:01:00.0' / 'information').write_text(text)
    assert info.graphics_cards(tmp_path) == ['NVIDIA H200']
